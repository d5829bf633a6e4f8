//! The STM32F405's image in QEMU, which models neither inputs nor outputs: requests over the link, and the widths in the
//! registers of the outputs.
//!
//! The emulated time is that of the control ticks, and runs by itself: a request is sent when its tick has come, or later.

use rotorlead::controller::Plan;
use rotorlead::link::{Message, Refusal, Request, Source};
use rotorlead::settings::{MOTORS, Settings, Store};

use super::table::Column;
use super::{Miss, Outcome, Outputs, Play, STARTED, Target};
use crate::emulator::{HostLate, Machine, Start, image, keeping_up};
use crate::flash::Flash;
use crate::pins::{JUMPER, us};

/// Compare register of the first output: channel 1 of TIM3.
const OUTPUT_1: u32 = 0x4000_0434;
/// Bytes of a sector of the settings.
const SECTOR: usize = 128 * 1024;

/// The STM32F405's image.
pub struct Stm32;

impl Target for Stm32 {
    fn column(&self) -> Column {
        Column::Stm32
    }

    fn play(&self, play: &Play) -> Result<Outcome, Miss> {
        check(play)?;
        Ok(keeping_up(|| attempt(play)))
    }
}

/// What QEMU and the board lack.
fn check(play: &Play) -> Result<(), Miss> {
    if play.edges.iter().any(|edge| edge.pin != JUMPER) {
        return Err(Miss::Cannot("no inputs"));
    }
    // Pins read 0, which is fitted.
    let is_fitted = play.edges.iter().all(|edge| edge.cycle == 0 && !edge.is_high);
    let needs_jumper = |request: &Request| {
        matches!(request, Request::SetMode { source: Source::Inject, .. } | Request::Excite(_) | Request::Inject(_))
    };
    let is_driven = play.requests.iter().any(|(_, request)| needs_jumper(request));
    if !is_fitted || is_driven && play.edges.is_empty() {
        return Err(Miss::Cannot("no jumper"));
    }
    if !play.thrust.is_empty() {
        return Err(Miss::Cannot("no converter"));
    }
    let speaks_dshot =
        |settings: &Settings| [settings.input, settings.output].iter().any(|pulse| pulse.protocol.dshot().is_some());
    if play.settings.as_ref().is_some_and(speaks_dshot) {
        return Err(Miss::Cannot("no DShot"));
    }
    Ok(())
}

/// The sectors of the settings after these were saved.
fn saved(settings: &Settings) -> Vec<u8> {
    let settings = settings.clone().validate().unwrap_or_else(|error| panic!("{error}"));
    let mut store = Store::new(Flash::<SECTOR>::blank(), Flash::<SECTOR>::SECTORS);
    store.save(&settings).unwrap_or_else(|error| panic!("{error:?}"));
    store.into_flash().bytes
}

fn attempt(play: &Play) -> Result<Outcome, HostLate> {
    let image = image();
    let flash = play.settings.as_ref().map(saved);
    let mut machine = Machine::boot(&Start { settings_flash: flash.as_deref(), ..Start::new(&image) });
    let info = machine.link.info();
    let settings = play.settings.clone().unwrap_or_default();
    let plan = Plan::new(&settings.clone().validate().expect("checked"), info.timer_hz, info.may_arm).expect("pulses");
    let (_, frames) = plan.output.pulses().expect("pulses");
    let mut played = Played { machine, counter_hz: frames.counter_hz, answers: Vec::new(), widths_us: Vec::new() };
    let ticks = |cycles: u64| (cycles as f64 / us(1e6) as f64 * f64::from(settings.loop_rate_hz)) as u32;
    // What comes late shifts what comes after it.
    let (mut cycle_before, mut tick) = (STARTED, info.ticks);
    let mut wait_until = |played: &mut Played, cycle: u64| {
        tick = played.wait(tick.wrapping_add(ticks(cycle - cycle_before)));
        cycle_before = cycle;
    };
    for (cycle, request) in &play.requests {
        wait_until(&mut played, *cycle);
        played.machine.link.send(request);
    }
    wait_until(&mut played, play.end);
    let Message::Faults(faults) = played.ask(&Request::Faults) else { panic!("no faults") };
    let is_late = faults.dead_man > 0 || played.answers.contains(&Message::Refused(Refusal::NotInjecting));
    if is_late {
        return Err(HostLate);
    }
    Ok(Outcome { outputs: Outputs::Registers(played.widths_us), answers: played.answers, end: play.end })
}

struct Played {
    machine: Machine,
    counter_hz: u32,
    answers: Vec<Message>,
    widths_us: Vec<[f64; MOTORS]>,
}

impl Played {
    /// Notes what is answered until a tick has come, and gives the tick that it is then.
    fn wait(&mut self, due: u32) -> u32 {
        loop {
            let Message::Info(info) = self.ask(&Request::Info) else { panic!("no info") };
            let widths = [0, 1, 2, 3].map(|output| self.machine.monitor.word(OUTPUT_1 + 4 * output));
            self.widths_us.push(widths.map(|counts| f64::from(counts) * 1e6 / f64::from(self.counter_hz)));
            if info.ticks.wrapping_sub(due).cast_signed() >= 0 {
                return info.ticks;
            }
        }
    }

    /// The answer to a question that is not the play's.
    fn ask(&mut self, request: &Request) -> Message {
        let own = self.machine.link.send(request);
        loop {
            let answer = self.machine.link.receive();
            if answer.tag == own && !matches!(answer.message, Message::Record(_)) {
                return answer.message;
            }
            self.answers.push(answer.message);
        }
    }
}
