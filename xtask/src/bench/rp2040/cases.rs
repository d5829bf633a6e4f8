//! What the controller does while it is measured: four motors that are disarmed first, and then follow new commands.

use emulator::rp2040::{Bytes, CYCLES_PER_S, Edge, Responder, Run, frames, pulses, reply};
use rotorlead::design::SpeedCurve;
use rotorlead::dshot::{Checksum, Frame, REPLY_BITS, Reply, Speed, Value};
use rotorlead::link::{FRAME_BYTES, Request, encode};
use rotorlead::settings::{CompensatorKind, MOTORS, Pulse, PulseProtocol, Settings};
use rotorlead::throttle::Command;
use rotorlead_rp2040::generated::{INPUT_1, OUTPUT_1};

use super::flash;
use crate::bench::application::with_inverse;
use crate::run::Result;

/// When the flight controller arms the motors: behind the start of the controller, which designs the lead, or four inverses.
const ARMED: u64 = ms(330);
const ARMED_INVERSE: u64 = ms(1330);
/// How long after that calls begin to be counted, and for how long.
const SETTLED: u64 = ms(30);
const COUNTED: u64 = ms(90);
/// When the lines begin: within the start of the controller.
const LINES_BEGIN: u64 = ms(1);
/// Nothing begins so shortly before the end that it would outlast it.
const BEFORE_END: u64 = ms(3);
/// From one request of the host to the next.
const REQUEST_PERIOD: u64 = ms(10);

/// Pulses: standard PWM at its defaults, in at 400 Hz and out at up to 450 Hz. All four inputs have a new one in the same tick.
const PULSE_PERIOD: u64 = CYCLES_PER_S / 400;
const STOP_US: u64 = 1000;
/// Pulses of an armed motor, by turns: they step by more than the inverse's slew allows in a tick.
const ARMED_US: [u64; 4] = [1400, 1500, 1420, 1550];

/// Frames of DShot.
const SPEED: Speed = Speed::Dshot600;
const FRAME_HZ: u16 = 4000;
const FRAME_PERIOD: u64 = CYCLES_PER_S / FRAME_HZ as u64;
/// Their values in turn while armed: from the first on, each so much above the one before, within a range.
const ARMED_VALUES: (u64, u64, u64) = (800, 97, 400);

/// Frames that ESCs answer, from a number on that is out before calls are counted, and what they say: as fast as the motors were at a command of
/// 0.47, by [`SPEEDS`] over the commands between [`KNOWN`].
const ANSWERED_HZ: u16 = 1000;
const ANSWERED: std::ops::Range<u16> = 900..1500;
const SAID_US: u32 = 820;
const KNOWN: [f64; 2] = [0.3, 0.8];
const SPEEDS: [u32; 3] = [52_000, 80_000, 100_000];
/// From the end of a frame to its answer.
const ESC_DELAY_US: u64 = 30;

/// What is held of the start: with the design of one lead, and of four inverses, which have one for each motor.
const START_S: f64 = 0.3;
const START_WITH_INVERSES_S: f64 = 0.5;

const fn ms(ms: u64) -> u64 {
    ms * CYCLES_PER_S / 1000
}

const fn us(us: u64) -> u64 {
    us * CYCLES_PER_S / 1_000_000
}

/// What is put on the four inputs.
#[derive(Clone, Copy)]
enum Lines {
    Pulses,
    Frames,
}

/// Something that the controller does.
pub struct Case {
    pub key: &'static str,
    pub name: &'static str,
    pub settings: Settings,
    /// When the motors are armed.
    pub armed: u64,
    /// The first control tick is to come earlier than this, seconds after the reset.
    pub latest_start_s: f64,
    lines: Lines,
    /// Whether the ESCs answer.
    pub esc: bool,
}

impl Case {
    /// Everything that is measured.
    pub fn all() -> Result<[Self; 6]> {
        let (pass, lead) = (settings(false), settings(true));
        let dshot = Pulse { protocol: PulseProtocol::Dshot600, frame_hz: FRAME_HZ };
        let case = |key, name, settings, lines| Self {
            key,
            name,
            settings,
            armed: ARMED,
            latest_start_s: START_S,
            lines,
            esc: false,
        };
        let with_inverses = |key, name, settings, esc| {
            let case = case(key, name, settings, Lines::Pulses);
            Self { armed: ARMED_INVERSE, latest_start_s: START_WITH_INVERSES_S, esc, ..case }
        };
        let inverse = with_inverse(lead.clone())?;
        let output = Pulse { protocol: PulseProtocol::Dshot600Bidirectional, frame_hz: ANSWERED_HZ };
        let answered = Settings { output, ..inverse.clone() };
        let [from, to] = KNOWN.map(Command::saturating_from_f64);
        let speeds = [Some(SpeedCurve::new(from, to, SPEEDS)); MOTORS];
        let rpm = Settings { compensator: CompensatorKind::Rpm, speeds, ..answered.clone() };
        Ok([
            case("pass", "pulses, no compensator", pass, Lines::Pulses),
            case("lead", "pulses, lead", lead.clone(), Lines::Pulses),
            with_inverses("inverse", "pulses, inverse", inverse, false),
            case("dshot", "DShot600, lead", Settings { input: dshot, output: dshot, ..lead }, Lines::Frames),
            with_inverses("answered", "DShot600 replies, inverse", answered, true),
            with_inverses("rpm", "DShot600 replies, rpm", rpm, true),
        ])
    }

    /// From when on calls are counted.
    pub fn from(&self) -> u64 {
        self.armed + SETTLED
    }

    fn end(&self) -> u64 {
        self.from() + COUNTED
    }

    /// The last cycle at which something begins on a line.
    fn last(&self) -> u64 {
        self.end() - BEFORE_END
    }

    /// The case as a run of an image, in which a host asks over the link, too.
    pub fn run(&self, image: &std::path::Path) -> Result<Run> {
        let mut run = Run::new(image, self.end());
        run.flash.push(flash::stored(&self.settings)?);
        run.inputs.extend((INPUT_1..).take(MOTORS).flat_map(|pin| self.line(pin)));
        run.uart_in = requests(self.from(), self.last())?;
        run.watch.extend((OUTPUT_1..).take(MOTORS));
        run.handlers_from = self.from();
        if self.esc {
            run.responders.extend((OUTPUT_1..).take(MOTORS).map(esc));
        }
        Ok(run)
    }

    fn line(&self, pin: u8) -> Vec<Edge> {
        match self.lines {
            Lines::Pulses => pulses(pin, LINES_BEGIN, PULSE_PERIOD, self.last(), |n| {
                let is_armed = LINES_BEGIN + n * PULSE_PERIOD >= self.armed;
                us(if is_armed { ARMED_US[n as usize % ARMED_US.len()] } else { STOP_US })
            }),
            Lines::Frames => {
                let starts = (LINES_BEGIN..self.last()).step_by(FRAME_PERIOD as usize);
                frames(
                    pin,
                    SPEED.bits_per_s(),
                    (0..).zip(starts).map(|(n, start)| (start, frame(n, start >= self.armed))),
                )
            }
        }
    }

    /// The longest time that an output is high which stops its motor: a pulse, or a bit that is a zero.
    pub fn longest_stop(&self) -> u64 {
        match self.lines {
            Lines::Pulses => us(STOP_US),
            Lines::Frames => CYCLES_PER_S * 3 / 8 / u64::from(SPEED.bits_per_s()),
        }
    }
}

/// An ESC that answers what is counted.
fn esc(pin: u8) -> Responder {
    let levels = Reply::from_period_us(Some(SAID_US)).to_levels();
    let answer = reply(SPEED.bits_per_s(), levels, REPLY_BITS, us(ESC_DELAY_US), 1.0);
    let answers = (0..ANSWERED.end).map(|n| if ANSWERED.contains(&n) { answer.clone() } else { Vec::new() });
    Responder { pin, falls: 16, answers: Some(answers.collect()) }
}

fn settings(compensate: bool) -> Settings {
    let mut settings = Settings::default();
    // A loss is held from the first command after the hold time on: here from the second one.
    for motor in &mut settings.motors {
        (motor.compensate, motor.hold_ms) = (compensate, 0);
    }
    settings
}

fn frame(n: u64, is_armed: bool) -> u16 {
    let (first, step, range) = ARMED_VALUES;
    let value = if is_armed { first + n * step % range } else { 0 };
    let value = Value::new(value as u16).expect("values are below 2048");
    Frame::new(value, false, Checksum::Normal).to_bits()
}

/// A short request each so often, which has the link receive and send.
fn requests(from: u64, last: u64) -> Result<Vec<Bytes>> {
    let mut frame = [0; FRAME_BYTES];
    let length = encode(1, &Request::Info, &mut frame).map_err(|error| error.to_string())?;
    let at = |cycle| Bytes { cycle, bytes: frame[..length].to_vec() };
    Ok((from..last).step_by(REQUEST_PERIOD as usize).map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_stop_the_motor_first_and_no_longer_once_it_is_armed() {
        for case in Case::all().unwrap() {
            let line = case.line(INPUT_1);
            let (highs, _) = line[1..].as_chunks::<2>();
            let longest = |from: u64, to: u64| {
                let within = highs.iter().filter(|[rise, _]| (from..to).contains(&rise.cycle));
                within.map(|[rise, fall]| fall.cycle - rise.cycle).max().unwrap()
            };
            assert!(longest(0, case.armed).abs_diff(case.longest_stop()) <= 1, "{}", case.key);
            assert!(longest(case.from(), case.end()) > case.longest_stop() * 6 / 5, "{}", case.key);
            assert!(line.iter().all(|edge| edge.cycle < case.end()), "{}", case.key);
        }
    }

    #[test]
    fn every_case_is_one_that_the_controller_takes() {
        for case in Case::all().unwrap() {
            let run = case.run(std::path::Path::new("image")).unwrap();
            assert_eq!((run.flash.len(), run.watch.as_slice()), (1, &[6, 7, 8, 9][..]), "{}", case.key);
            assert!(run.uart_in.len() >= 8, "{}", case.key);
        }
    }
}
