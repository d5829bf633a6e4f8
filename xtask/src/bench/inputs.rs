//! The capture hardware, which the emulator has not got: TIM2's count, flags and stamps, and the levels of the pins.
//!
//! The application runs as it is. Where it loads one of these registers, the value is supplied from here; everything else
//! is the emulator's.

use super::trace::Hardware;

/// Inputs of the controller.
pub const INPUTS: usize = 4;

const TIM2: u32 = 0x4000_0000;
const STATUS: u32 = TIM2 + 0x10;
const COUNT: u32 = TIM2 + 0x24;
const CAPTURES: u32 = TIM2 + 0x34;
const GPIOA_LEVELS: u32 = 0x4002_0010;
/// The link's UART, and the bits of its status that are set when a byte has come, the one after it was lost, and the next
/// may be sent.
const USART3_STATUS: u32 = 0x4000_4800;
const BUSY: u32 = 1 << 5 | 1 << 3 | 1 << 7;
/// The core's interrupt control and state. While the debugger steps through a tick the emulated time runs on, and the next
/// tick looks due, which it is not where nobody stops the core.
const INTERRUPT_STATE: u32 = 0xE000_ED04;

/// The four inputs. Time is in counts of the timer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inputs {
    /// The timer's count.
    pub now: u32,
    levels: u32,
    flags: u32,
    stamps: [u32; INPUTS],
    /// The UART has work both ways, and a lost byte, whenever it is asked.
    pub link_is_busy: bool,
}

impl Inputs {
    /// Edges now, of the inputs that `changes` says, to this level.
    pub fn edges(&mut self, changes: [bool; INPUTS], high: bool) {
        for (input, _) in changes.into_iter().enumerate().filter(|(_, changes)| *changes) {
            let bit = 1 << input;
            self.levels = if high { self.levels | bit } else { self.levels & !bit };
            self.flags |= bit << 1;
            self.stamps[input] = self.now;
        }
    }

    /// Whether there are stamps that were not read.
    pub const fn pending(&self) -> bool {
        self.flags != 0
    }
}

impl Hardware for Inputs {
    fn load(&mut self, address: u32) -> Option<u32> {
        match address {
            STATUS => Some(self.flags),
            COUNT => Some(self.now),
            GPIOA_LEVELS => Some(self.levels),
            INTERRUPT_STATE => Some(0),
            USART3_STATUS => self.link_is_busy.then_some(BUSY),
            _ => {
                let input = address.checked_sub(CAPTURES)? / 4;
                let stamp = *self.stamps.get(input as usize)?;
                // A read of the stamp clears its flag.
                self.flags &= !(2 << input);
                Some(stamp)
            }
        }
    }
}
