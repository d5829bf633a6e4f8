//! Which instructions pass to an ESC, and what becomes of the throttle where one does not.
//!
//! | instruction | what it is | what becomes of it |
//! |---|---|---|
//! | 0 | stop | passes |
//! | 1 to 5 | beacons | pass |
//! | 6, 11 | information, settings to be sent | pass |
//! | 7, 8 | turn one way or the other, to be saved | pass |
//! | 9 | 3D mode off | passes |
//! | 10 | 3D mode on: 48 to 1047 turn the motor backwards | dropped while any motor compensates, passes otherwise |
//! | 12 | save | passes |
//! | 13, 14 | extended telemetry on, off | pass |
//! | 15 to 19 | nobody has given them a meaning | dropped |
//! | 20, 21 | turn the saved way or the other, not saved | pass |
//! | 22 to 31 | lamps, sound | pass |
//! | 32 to 35, 42 to 47 | reports on the signal line, in a form of their own | dropped: the line would be driven from both ends |
//! | 36 | AM32's settings: the frames that follow are data | dropped: the filter would shape them |
//! | 37 to 41 | nobody has given them a meaning | dropped |
//!
//! In the place of a dropped one goes a stop. Where the outputs have pulses none passes. A throttle whose direction the ESC was
//! to be told, and was not, is a stop, until the ESC is told to turn as before: turtle mode must not turn motors the usual way. So is
//! one of an ESC that was told of 3D mode, while a motor compensates.
//!
//! Sources: Betaflight (`dshot_command.h`), AM32 (`dshot.c`), BLHeli_32's list.

/// Frames in a row with which an ESC takes an instruction that changes how it turns. Fewer are a disturbance.
const REPEATS: u8 = 6;
const MODE_3D_OFF: u8 = 9;
const MODE_3D_ON: u8 = 10;
/// What changes how an ESC turns, and what takes it back.
const DIRECTIONS: [(u8, u8); 3] = [(8, 7), (MODE_3D_ON, MODE_3D_OFF), (21, 20)];

/// What a flight controller has asked of an ESC with one of [`DIRECTIONS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Asked {
    /// To turn as it always does.
    #[default]
    Usual,
    /// To turn otherwise, and the ESC heard it.
    Told,
    /// The same, and the ESC heard nothing.
    Untold,
}

/// What a flight controller has asked of an ESC, which stays with the ESC when settings change.
#[derive(Clone, Copy, Debug, Default)]
pub struct Directions([Asked; DIRECTIONS.len()]);

/// The instructions of one line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instructions {
    /// Whether the output takes any.
    are_relayed: bool,
    /// The last one, and how often it came in a row.
    last: (u8, u8),
    directions: Directions,
}

impl Instructions {
    /// Of a line whose frames go on as frames, or do not.
    pub const fn new(are_relayed: bool, directions: Directions) -> Self {
        Self { are_relayed, last: (0, 0), directions }
    }

    /// What was asked of the ESC.
    pub const fn directions(&self) -> Directions {
        self.directions
    }

    /// One has come: whether it may go on. `compensates`: whether some motor does.
    pub fn take(&mut self, instruction: u8, compensates: bool) -> bool {
        let passes = self.are_relayed
            && match instruction {
                MODE_3D_ON => !compensates,
                0..=14 | 20..=31 => true,
                _ => false,
            };
        let repeats = if self.last.0 == instruction { self.last.1.saturating_add(1) } else { 1 };
        self.last = (instruction, repeats);
        if repeats >= REPEATS {
            for ((turn, back), asked) in DIRECTIONS.iter().zip(&mut self.directions.0) {
                if instruction == *turn {
                    *asked = if passes { Asked::Told } else { Asked::Untold };
                } else if instruction == *back {
                    *asked = Asked::Usual;
                }
            }
        }
        passes
    }

    /// A throttle has come: whether the ESC turns the way that it means. `compensates`: whether some motor does.
    pub fn take_throttle(&mut self, compensates: bool) -> bool {
        self.last = (0, 0);
        DIRECTIONS.iter().zip(&self.directions.0).all(|((turn, _), asked)| match asked {
            Asked::Usual => true,
            Asked::Told => *turn != MODE_3D_ON || !compensates,
            Asked::Untold => false,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(are_relayed: bool) -> Instructions {
        Instructions::new(are_relayed, Directions::default())
    }

    fn take_often(instructions: &mut Instructions, instruction: u8, compensates: bool) -> bool {
        let mut passes = (0..REPEATS).map(|_| instructions.take(instruction, compensates));
        let first = passes.next().unwrap();
        assert!(passes.all(|passes| passes == first));
        first
    }

    #[test]
    fn each_instruction_passes_or_not_as_the_table_says() {
        for instruction in 0..48 {
            let expected = matches!(instruction, 0..=14 | 20..=31);
            assert_eq!(line(true).take(instruction, false), expected, "{instruction}");
            assert_eq!(line(true).take(instruction, true), expected && instruction != 10, "{instruction}");
            assert!(!line(false).take(instruction, false), "{instruction}");
        }
    }

    #[test]
    fn a_throttle_whose_direction_was_not_told_is_none_until_it_is_taken_back() {
        for (turn, back) in DIRECTIONS {
            let mut pulses = line(false);
            assert!(pulses.take_throttle(false));
            // One frame that happens to have a right checksum grounds nobody.
            for _ in 1..REPEATS {
                pulses.take(turn, false);
            }
            assert!(pulses.take_throttle(false));
            take_often(&mut pulses, turn, false);
            assert!(!pulses.take_throttle(false) && !pulses.take_throttle(false));
            for (_, other) in DIRECTIONS.into_iter().filter(|(_, other)| *other != back) {
                take_often(&mut pulses, other, false);
                assert!(!pulses.take_throttle(false), "{other} takes {turn} back");
            }
            take_often(&mut pulses, back, false);
            assert!(pulses.take_throttle(false));

            let mut frames = line(true);
            take_often(&mut frames, turn, false);
            assert!(frames.take_throttle(false), "the ESC was told");
        }
        let mut compensated = line(true);
        assert!(!take_often(&mut compensated, MODE_3D_ON, true));
        assert!(!compensated.take_throttle(true), "it may mean backwards");
    }

    /// Whether the compensator was in the path when 3D mode was switched on, or came there later, with other settings.
    #[test]
    fn an_esc_in_3d_mode_has_no_throttle_while_a_motor_compensates() {
        let mut told = line(true);
        assert!(take_often(&mut told, MODE_3D_ON, false));
        let mut later = Instructions::new(true, told.directions());
        for line in [&mut told, &mut later] {
            assert!(line.take_throttle(false));
            assert!(!line.take_throttle(true));
            assert!(take_often(line, MODE_3D_OFF, true));
            assert!(line.take_throttle(true));
        }
        let mut untold = line(false);
        take_often(&mut untold, 21, false);
        assert!(
            !Instructions::new(false, untold.directions()).take_throttle(false),
            "other settings tell the ESC nothing"
        );
    }
}
