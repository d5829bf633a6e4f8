//! What host and controller say to each other. Variants are numbered in the order in which they stand here.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{FrameFaults, Series};
use crate::settings::{MOTORS, Origin, PulseProtocol, Settings, SettingsError, Warnings};

/// Samples in one [`InjectRequest`].
pub const INJECT_SAMPLES: usize = 128;
/// How long every motor is at rest before a host may change or store anything without the jumper: longer than a throttle of zero in
/// flight lasts, milliseconds.
pub const REST_MS: u32 = 3000;
/// Samples in one [`Record`].
pub const RECORD_SAMPLES: usize = 32;

/// From the host.
///
/// [`Refusal::UnknownMotor`] answers any request whose motor does not exist.
// Requests live one at a time, on the stack of the task that answers them: boxes are not to be had, nor needed.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Request {
    /// 0: who are you, and how are you? Answered by [`Message::Info`].
    Info,
    /// 1: answered by [`Message::Settings`].
    GetSettings,
    /// 2: use these settings from now on, without storing them. Answered by [`Message::SettingsTaken`], or refused: a
    /// motor is not disarmed ([`Refusal::NotDisarmed`]) or not for long enough ([`Refusal::NotRested`]), a value is wrong
    /// ([`Refusal::Settings`]), or the compensator cannot be designed ([`Refusal::Design`]).
    SetSettings(Settings),
    /// 3: store the settings in use. Refused unless every motor is disarmed for long enough, since an erase stalls the core.
    SaveSettings,
    /// 4: where a motor's command comes from, and whether the compensator is in its path. Starts the motor's path
    /// afresh, and the numbering of injected samples at 0; injections that were under way are refused
    /// ([`Refusal::NotInjecting`]). Refused while the motor is not at rest ([`Refusal::Exciting`], or
    /// [`Refusal::NotDisarmed`]: a host brings an injected motor to a stop with a disarmed command first) or, without the jumper,
    /// not at rest for long enough ([`Refusal::NotRested`]), and
    /// [`Source::Inject`] without the jumper ([`Refusal::BenchDisabled`]), without chosen settings
    /// ([`Refusal::NoSettings`]), while pulses come at any input, armed or not ([`Refusal::InputLive`]), and while the
    /// host drives another motor ([`Refusal::Exciting`], [`Refusal::Injecting`]).
    SetMode {
        /// The motor, from 0.
        motor: u8,
        /// Where its command comes from.
        source: Source,
        /// Whether the compensator is in the path.
        compensate: bool,
    },
    /// 5: play a multisine. Refused as [`Source::Inject`] is, outside the limits of the settings, where it has more lines
    /// than the clock has time for ([`Refusal::TooSlow`]), or while another one plays or any motor is injected.
    Excite(ExciteRequest),
    /// 6: the host is still there; at least every [`DEAD_MAN_MS`](crate::settings::DEAD_MAN_MS) while something plays. Where
    /// the jumper is not there any more ([`Refusal::BenchDisabled`]) what plays ramps down.
    KeepAlive,
    /// 7: ramp down now. Answered at once; the ramp takes its time.
    StopExcitation,
    /// 8: record, or with `None` stop recording. [`Message::Record`] follows with the tag of this request, first
    /// [`Message::Done`].
    Record(Option<RecordRequest>),
    /// 9: commands for a motor whose source is [`Source::Inject`], one consumed per tick. Without any there is no tick, so
    /// that the outputs do not depend on when frames arrive; the ESC gets the last command itself meanwhile. A host that
    /// sends none for the motor's hold time has lost it, and so has one at whose controller pulses come up at any input:
    /// the motor stops and goes back to its pulses. One at rest goes back after
    /// [`INJECT_TIMEOUT_MS`](super::INJECT_TIMEOUT_MS). Answered by [`Message::Injected`] when the last of them was consumed,
    /// so a host may keep [`INJECT_WINDOW`](super::INJECT_WINDOW) requests under way.
    Inject(InjectRequest),
    /// 10: answered by [`Message::Faults`].
    Faults,
    /// 11: leave the firmware for the boot loader in the chip's ROM, which takes another image by USB. Refused without the jumper
    /// ([`Refusal::BenchDisabled`]), while a motor is not at rest ([`Refusal::NotDisarmed`]), and by a board that has no such loader
    /// ([`Refusal::NoBootLoader`]). Every motor stays at rest from the answer on, and 0.1 s later the controller is gone.
    BootLoader,
}

/// Where a motor's command comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Source {
    /// The flight controller's pulses.
    Pulse,
    /// The host, sample by sample.
    Inject,
}

/// A multisine to be played.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ExciteRequest {
    /// The motor, from 0.
    pub motor: u8,
    /// Its lines.
    pub lines: LineSet,
    /// Command around which it plays, Q2.29.
    pub nominal: i32,
    /// Peak deviation from it, Q2.29.
    pub amplitude: i32,
    /// Whole periods to play, 1 or more, between the ramps.
    pub periods: u16,
}

/// A set of lines that the controller has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum LineSet {
    /// [`ODD_LINES_30_HZ`](crate::excitation::ODD_LINES_30_HZ)
    Odd30Hz,
    /// [`ODD_LINES_45_HZ`](crate::excitation::ODD_LINES_45_HZ)
    Odd45Hz,
}

impl LineSet {
    /// The lines.
    #[must_use]
    pub const fn lines(self) -> crate::excitation::Lines<'static> {
        match self {
            Self::Odd30Hz => crate::excitation::ODD_LINES_30_HZ,
            Self::Odd45Hz => crate::excitation::ODD_LINES_45_HZ,
        }
    }
}

/// What to record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct RecordRequest {
    /// The motor, from 0.
    pub motor: u8,
    /// One tick in so many; 0 for that of the settings.
    pub divisor: u16,
}

/// Commands for a motor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct InjectRequest {
    /// The motor, from 0.
    pub motor: u8,
    /// Number of the first sample, counted from the request that set the mode: a frame that was lost or came twice is
    /// refused, not played.
    pub first: u32,
    /// Commands in Q2.29.
    pub samples: Series<INJECT_SAMPLES>,
}

/// From the controller.
#[allow(clippy::large_enum_variant)] // As for requests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Message {
    /// 0: it was done.
    Done,
    /// 1: it was not done, and nothing was changed.
    Refused(Refusal),
    /// 2: who and how.
    Info(Info),
    /// 3: the settings in use.
    Settings(Settings),
    /// 4: the settings are in use, with these reservations.
    SettingsTaken(Warnings),
    /// 5: what went wrong so far.
    Faults(Faults),
    /// 6: what the injected commands came to.
    Injected(Injected),
    /// 7: samples of the recorder.
    Record(Record),
}

/// Why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Refusal {
    /// 0: there is no such motor.
    UnknownMotor,
    /// 1: a motor is not disarmed.
    NotDisarmed {
        /// The motor.
        motor: u8,
    },
    /// 2: nobody has chosen the settings; set some first.
    NoSettings,
    /// 3: a pulse input is live; disconnect the flight controller for an excitation or an injection.
    InputLive {
        /// Its motor.
        motor: u8,
    },
    /// 4: the settings are wrong.
    Settings(SettingsError),
    /// 5: the compensator cannot be designed with these numbers at this loop rate.
    Design,
    /// 6: the flash did not take the settings; the old ones are still stored.
    SaveFailed,
    /// 7: nominal and amplitude leave the excitation's limits.
    CommandOutsideLimits {
        /// Lowest command allowed, Q2.29: the motor's idle.
        min_command: i32,
        /// Highest command allowed, Q2.29.
        max_command: i32,
        /// Largest amplitude allowed, Q2.29.
        max_amplitude: i32,
    },
    /// 8: so many periods take longer than an excitation may.
    TooLong {
        /// Longest time allowed, seconds.
        max_duration_s: u16,
    },
    /// 9: something plays already.
    Exciting,
    /// 10: the motor's source is not the host.
    NotInjecting,
    /// 11: these samples do not follow on the last ones.
    OutOfSequence {
        /// Number of the sample that is expected.
        expected: u32,
    },
    /// 12: [`INJECT_WINDOW`](super::INJECT_WINDOW) requests are under way already.
    WindowFull,
    /// 13: the divisor is out of range.
    Divisor,
    /// 14: the jumper that allows excitation and injection is not fitted.
    BenchDisabled,
    /// 15: so many lines take more of a control tick than there is.
    TooSlow {
        /// Lines of the excitation.
        lines: u16,
        /// Control ticks per second.
        loop_rate_hz: u32,
        /// Core clock that runs, hertz.
        core_hz: u32,
        /// What the excitation and the link would take of a tick, percent.
        percent: u32,
    },
    /// 16: the host injects commands into a motor already; it drives one at a time.
    Injecting {
        /// The motor.
        motor: u8,
    },
    /// 17: this board does not speak DShot.
    NoDshot,
    /// 18: without the jumper, a motor has to be at rest for [`REST_MS`] before anything is changed or stored: a throttle of zero
    /// in flight is no landing.
    NotRested {
        /// The motor.
        motor: u8,
    },
    /// 19: this board has no boot loader that firmware can call.
    NoBootLoader,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |bits: i32| crate::throttle::Throttle::from_bits(bits).to_f64();
        match *self {
            Self::NoDshot => {
                f.write_str("the pins of this board do not speak DShot; choose ")?;
                let mut pulses = PulseProtocol::ALL.iter().filter(|protocol| protocol.dshot().is_none());
                while let Some(protocol) = pulses.next() {
                    f.write_str(protocol.name())?;
                    f.write_str(match pulses.clone().count() {
                        0 => " for input.protocol and output.protocol",
                        1 => " or ",
                        _ => ", ",
                    })?;
                }
                Ok(())
            }
            Self::NoBootLoader => write!(f, "this board has no boot loader that its firmware can call"),
            Self::UnknownMotor => write!(f, "there is no such motor; they are 0 to {}", MOTORS - 1),
            Self::NotDisarmed { motor } => write!(f, "motor {motor} is not disarmed"),
            Self::NotRested { motor } => write!(
                f,
                "motor {motor} is not at rest for {} s yet, and the jumper that says that nobody flies is not fitted",
                REST_MS / 1000
            ),
            Self::NoSettings => write!(
                f,
                "the controller has no settings that somebody has chosen, and puts out no pulses; set some first"
            ),
            Self::InputLive { motor } => {
                write!(
                    f,
                    "pulses, or edges that are no pulses of input.protocol, come at the input of motor {motor}; unplug the \
                     flight controller"
                )
            }
            Self::BenchDisabled => write!(
                f,
                "the jumper that allows excitation and injection is not fitted; see docs/wiring.md, and fit it with \
                 propellers off or behind a cage"
            ),
            Self::TooSlow { lines, loop_rate_hz, core_hz, percent } => write!(
                f,
                "an excitation of {lines} lines at loop_rate_hz {loop_rate_hz} takes {percent} % of each control tick of a \
                 core at {} MHz, more than {} %; lower loop_rate_hz, or use fewer lines",
                core_hz / 1_000_000,
                super::MAX_LOAD_PERCENT
            ),
            Self::Settings(error) => error.fmt(f),
            Self::Design => write!(f, "the compensator cannot be designed with these numbers at this loop rate"),
            Self::SaveFailed => write!(f, "the flash did not take the settings; the old ones are still stored"),
            Self::CommandOutsideLimits { min_command, max_command, max_amplitude } => write!(
                f,
                "outside the limits of the settings: commands from {:.4} to {:.4}, amplitudes up to {:.4}",
                number(min_command),
                number(max_command),
                number(max_amplitude)
            ),
            Self::TooLong { max_duration_s } => write!(f, "longer than the {max_duration_s} s that the settings allow"),
            Self::Exciting => write!(f, "an excitation is under way"),
            Self::Injecting { motor } => {
                write!(f, "motor {motor} takes injected commands, and the host drives one motor at a time")
            }
            Self::NotInjecting => write!(f, "the motor does not take injected commands; set its mode first"),
            Self::OutOfSequence { expected } => write!(f, "sample {expected} was expected: a frame was lost"),
            Self::WindowFull => write!(f, "too many injections are under way"),
            Self::Divisor => write!(f, "the divisor of the recorder is out of range"),
        }
    }
}

/// Who a controller is, and how it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Info {
    /// Version of the firmware: major, minor, patch.
    pub firmware: [u8; 3],
    /// Which clock runs.
    pub clock: Clock,
    /// Frequency of the core, hertz.
    pub core_hz: u32,
    /// Frequency of the timers that capture and put out pulses, hertz.
    pub timer_hz: u32,
    /// What the crystal was measured to be.
    pub crystal: CrystalCheck,
    /// Whether the clock tells a disarmed pulse from an armed one. If not, no motor is armed by pulses.
    pub may_arm: bool,
    /// Control ticks since the start; wraps.
    pub ticks: u32,
    /// Why it started.
    pub reset: ResetReason,
    /// At which supply voltage the chip resets.
    pub brown_out: BrownOut,
    /// Where the settings come from.
    pub settings: Origin,
    /// Whether pulses may go out. If not, nobody has chosen the settings, and every output stays low.
    pub outputs_enabled: bool,
    /// Whether the jumper that allows excitation and injection is fitted.
    pub bench_enabled: bool,
    /// The state of each motor's path.
    pub motors: [ChannelState; MOTORS],
    /// What is in each motor's path.
    pub paths: [Path; MOTORS],
    /// Which motors have gone on after this reset, at their last command.
    pub resumed: [bool; MOTORS],
}

/// What is in a motor's path now, whatever is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Path {
    /// Whether the compensator is in it.
    pub compensates: bool,
    /// The input as a command, Q2.29; [`NO_INPUT`](super::NO_INPUT) where there is none.
    pub command: i32,
    /// What the ESC gets, Q2.29; [`NO_PULSE`](super::NO_PULSE) where that is no pulse.
    pub output: i32,
    /// Pulses or frames that come in a second, as measured; 0 where none do.
    pub input_hz: u32,
    /// Those that go out in a second; 0 where none do.
    pub output_hz: u32,
}

impl Path {
    /// Nothing comes in, and nothing goes out.
    pub const SILENT: Self =
        Self { compensates: false, command: super::NO_INPUT, output: super::NO_PULSE, input_hz: 0, output_hz: 0 };

    /// Whether pulses come that no output follows: more than go out. Both rates are by one clock, to the hertz.
    #[must_use]
    pub const fn leaves_pulses_over(&self) -> bool {
        self.output_hz > 0 && self.input_hz > self.output_hz + 1
    }
}

/// Which clock runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Clock {
    /// The crystal, through the PLL.
    Crystal,
    /// The crystal did not start: the internal oscillator, through the PLL. 1 % of error.
    InternalPll,
    /// Neither crystal nor PLL came: the internal oscillator itself.
    Internal,
}

/// What a crystal was measured to be, against the internal oscillator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum CrystalCheck {
    /// There was nothing to count: no crystal, or no timer that counts it.
    NotChecked,
    /// What the board has, within the oscillator's tolerance.
    Right {
        /// Its frequency in hertz, as exact as the oscillator: -8 to +4.5 %.
        measured_hz: u32,
    },
    /// Another one. The controller does not run on it, and arms no motor.
    Wrong {
        /// Its frequency in hertz, as exact as the oscillator: -8 to +4.5 %.
        measured_hz: u32,
    },
}

/// At which supply voltage the chip resets, as its option bytes say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum BrownOut {
    /// The option bytes cannot be read.
    Unknown,
    /// It does not, above that of the power-on reset, some 1.7 V.
    Off,
    /// Level 1, some 2.2 V.
    Level1,
    /// Level 2, some 2.5 V.
    Level2,
    /// Level 3, some 2.8 V.
    Level3,
}

/// Why a controller started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ResetReason {
    /// Power came.
    PowerOn,
    /// The supply sagged.
    BrownOut,
    /// The reset pin.
    Pin,
    /// Something asked for it.
    Software,
    /// The control task stood still.
    Watchdog,
    /// The code panicked, here.
    Panic(PanicPlace),
    /// A fault of the processor.
    Fault {
        /// Where, or 0 where the stack could not be read.
        program_counter: u32,
        /// What: the core's configurable fault status register (CFSR).
        status: u32,
    },
    /// The crystal stopped.
    CrystalLost,
    /// An interrupt came that nothing was set up for: its number, negative for the core's exceptions.
    StrayInterrupt(i16),
    /// The supply fell below the threshold of the chip's voltage detector.
    SupplyLow,
}

/// A place in the source, in a size that is known beforehand: the line, and the end of the file's name, which tells
/// files apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct PanicPlace {
    /// The line, from 1; 0 where it is not known.
    pub line: u32,
    /// The last bytes of the file's name, with zeros in front where it is shorter.
    pub file: [u8; PANIC_FILE_BYTES],
}

/// Bytes that are kept of a file's name.
pub const PANIC_FILE_BYTES: usize = 24;

impl PanicPlace {
    /// This line of this file.
    #[must_use]
    pub fn new(file: &str, line: u32) -> Self {
        let mut end = [0; PANIC_FILE_BYTES];
        for (to, from) in end.iter_mut().rev().zip(file.bytes().rev()) {
            *to = from;
        }
        Self { line, file: end }
    }
}

impl fmt::Display for PanicPlace {
    /// `FILE:LINE`, with an ellipsis where the file's name was cut.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = self.file.split(|&byte| byte == 0).next_back().unwrap_or_default();
        if shown.len() == PANIC_FILE_BYTES {
            f.write_str("…")?;
        }
        // A character that was cut in two is left out.
        for part in shown.utf8_chunks() {
            f.write_str(part.valid())?;
        }
        write!(f, ":{}", self.line)
    }
}

/// The state of a motor's path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ChannelState {
    /// No pulse has come yet.
    NoSignal,
    /// Pulses come that would arm, but none below the threshold came before them.
    Locked,
    /// Pulses come, below the arming threshold.
    Disarmed,
    /// The motor turns on the flight controller's command.
    Armed,
    /// The pulses are gone, and the last command is held.
    Holding,
    /// The pulses are gone, and the output is at the stop.
    Lost,
    /// The excitation drives the motor.
    Excitation,
    /// The host drives the motor.
    Injected,
}

/// What went wrong since the start. All counts wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Faults {
    /// Frames of the link that were dropped.
    pub link: FrameFaults,
    /// Bytes of the link that came faster than they were taken.
    pub link_overruns: u32,
    /// Control ticks that began before the last one was done.
    pub missed_deadlines: u32,
    /// Times that the lowest priority, which talks to the host, was away for 20 s while a flight controller turned a motor.
    pub idle_hangs: u32,
    /// Samples of the recorder that the link was too slow for.
    pub record_dropped: u32,
    /// Excitations that ended because the host was silent.
    pub dead_man: u32,
    /// What went wrong at each motor's input.
    pub motors: [MotorFaults; MOTORS],
}

/// What went wrong at one motor's input, and what came from its ESC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct MotorFaults {
    /// Pulses too short to be one.
    pub glitches: u32,
    /// Edges that were missed.
    pub missing_edges: u32,
    /// Pulses outside the protocol's range.
    pub out_of_range: u32,
    /// Pulses that came too soon after another.
    pub too_soon: u32,
    /// Times that the signal was lost.
    pub lost: u32,
    /// Times that the input was masked, since it had more edges than its frame rate allows.
    pub masked: u32,
    /// DShot: what came and is no frame, by its length or its checksum.
    pub bad_frames: u32,
    /// DShot: instructions that came faster than the output takes them, and control ticks with words that came faster than they were
    /// taken.
    pub dropped_frames: u32,
    /// DShot: instructions that may not pass to an ESC behind a compensator, and throttles whose direction the ESC was not told.
    pub refused_frames: u32,
    /// Bidirectional DShot: replies of the ESC.
    pub replies: u32,
    /// Bidirectional DShot: what the ESC's line had behind a frame and is no reply, by its code or its checksum.
    pub bad_replies: u32,
}

/// What injected commands came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Injected {
    /// Number of the first one.
    pub first: u32,
    /// What went to the ESC for each, Q2.29; [`NO_PULSE`](super::NO_PULSE) where that was no pulse.
    pub outputs: Series<INJECT_SAMPLES>,
}

/// Samples of the recorder, `divisor` ticks apart, without a gap inside.
///
/// Samples that were lost, on the wire or because the link is slower than they come, show in `first_tick`: it is that of
/// the last record plus `divisor` for each of its samples, or something is missing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Record {
    /// The motor, from 0.
    pub motor: u8,
    /// Ticks from one sample to the next.
    pub divisor: u16,
    /// Tick of the first sample, counted from the start of the recording; wraps.
    pub first_tick: u32,
    /// The pulse input as a command, Q2.29; [`NO_INPUT`](super::NO_INPUT) where there is none.
    pub input: Series<RECORD_SAMPLES>,
    /// The command before the compensator, Q2.29.
    pub before: Series<RECORD_SAMPLES>,
    /// The command after it, to the ESC, Q2.29; [`NO_PULSE`](super::NO_PULSE) where that was no pulse.
    pub after: Series<RECORD_SAMPLES>,
    /// The thrust sensor's channel of the converter, counts, taken in the same tick before the command changed.
    pub adc: Series<RECORD_SAMPLES>,
    /// Bidirectional DShot: an electrical turn in microseconds, of the ESC's newest reply before the tick; 65408 where the motor
    /// stands, and [`NO_TURN`](super::NO_TURN) where there is none.
    pub turn_us: Series<RECORD_SAMPLES>,
}
