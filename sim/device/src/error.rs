//! What can go wrong between host and controller.

use miette::Diagnostic;
use rotorlead::link::{Refusal, VERSION};
use rotorlead::settings::{DEAD_MAN_MS, SettingsError};
use thiserror::Error;

/// Why a controller did not do what was asked.
#[derive(Debug, Error, Diagnostic)]
pub enum DeviceError {
    /// The port cannot be opened.
    #[error("`{address}` cannot be opened: {reason}")]
    #[diagnostic(help("give a serial port (/dev/ttyUSB0, COM3) that no other program has open, or tcp:HOST:PORT"))]
    Open {
        /// What was to be opened.
        address: String,
        /// What the operating system says.
        reason: String,
    },
    /// No port was named, and none is a controller's by its USB.
    #[error("no controller is plugged in by USB")]
    #[diagnostic(help(
        "plug the board in by a cable that carries data, or name the port: `--port /dev/ttyUSB0` or `--port COM3` of an adapter, or tcp:HOST:PORT"
    ))]
    NotPlugged,
    /// No port was named, and several may be a controller's.
    #[error("several controllers may be plugged in by USB: {}", .ports.join(", "))]
    #[diagnostic(help("name the one that is meant with --port"))]
    SeveralPlugged {
        /// Their names.
        ports: Vec<String>,
    },
    /// The line broke.
    #[error("`{address}`: {reason}")]
    #[diagnostic(help("check the cable; the controller stops an excitation by itself when it hears nothing"))]
    Line {
        /// The port.
        address: String,
        /// What the operating system says.
        reason: String,
    },
    /// No answer came.
    #[error("`{address}`: no answer to {request} within {seconds} s")]
    #[diagnostic(help(
        "is this the controller's port, powered, and at its baud rate? Firmware of a link before version 8 does not answer this program either"
    ))]
    NoAnswer {
        /// The port.
        address: String,
        /// What was asked.
        request: &'static str,
        /// For how long it was waited.
        seconds: f64,
    },
    /// Frames come, but of another version.
    #[error("`{address}`: the controller speaks version {version} of the link, and this program version {VERSION}")]
    #[diagnostic(help("flash the firmware that belongs to this program"))]
    OtherVersion {
        /// The port.
        address: String,
        /// The controller's version.
        version: u8,
    },
    /// The controller said no.
    #[error("the controller refused {request}: {refusal}")]
    #[diagnostic(help("{}", remedy(.refusal)))]
    Refused {
        /// What was asked.
        request: &'static str,
        /// Its reason.
        refusal: Refusal,
    },
    /// The controller answered something else.
    #[error("the controller answered {request} with something else")]
    #[diagnostic(help("this is an error of firmware or host program, which should be reported"))]
    Unexpected {
        /// What was asked.
        request: &'static str,
    },
    /// The controller says that it runs with settings with which it could not.
    #[error("the controller's settings are none that it could run with: {error}")]
    #[diagnostic(help("flash the firmware that belongs to this program, or find out what disturbs the line"))]
    Impossible {
        /// The first that is wrong.
        error: SettingsError,
    },
    /// Samples of a recording did not arrive.
    #[error("{missing} samples are missing at tick {tick} of the recording")]
    #[diagnostic(help("the line is too slow for the rate, or noisy: record with a larger --divisor"))]
    SamplesLost {
        /// How many.
        missing: u32,
        /// Where.
        tick: u32,
    },
    /// The speed was to be recorded, and the ESC did not say it.
    #[error("the ESC gave no speed at tick {tick} of the recording, in row {row}")]
    #[diagnostic(help(
        "record while the motor is driven, by an ESC whose bidirectional DShot is on: `rotorlead device faults` counts its replies, good and bad"
    ))]
    NoSpeed {
        /// The row, from 0.
        row: usize,
        /// Its tick.
        tick: u64,
    },
    /// A motor turns faster than it may.
    #[error("the motor turned at {rpm:.0} rpm, and --most-rpm allows {most_rpm:.0}: the excitation was stopped")]
    #[diagnostic(help(
        "is its propeller on, and --motor-poles the number of its magnets? Raise --most-rpm only where the motor may turn so fast"
    ))]
    TooFast {
        /// Its speed.
        rpm: f64,
        /// The highest that is allowed.
        most_rpm: f64,
    },
    /// The controller's dead-man has ended an excitation.
    #[error("the controller heard nothing from this program for {DEAD_MAN_MS} ms, and stopped the motor")]
    #[diagnostic(help("something holds this machine or the line up: close what else runs, and play it again"))]
    HostSilent,
    /// The recorded excitation is not the one that was asked for.
    #[error("the recording does not hold {rows} rows of the excitation that was asked for, bit for bit")]
    #[diagnostic(help(
        "the controller stopped it: read its faults with `rotorlead device faults`, and its state with info"
    ))]
    NotPlayed {
        /// Rows that were looked for.
        rows: usize,
    },
    /// The motor does not come to rest after an excitation.
    #[error("motor {motor} is still being excited {seconds} s after it was to stop")]
    #[diagnostic(help("cut its power; this is an error of the firmware, which should be reported"))]
    NotAtRest {
        /// The motor.
        motor: u8,
        /// How long it was waited for.
        seconds: f64,
    },
    /// The outputs of an injection are not those of the samples that were sent.
    #[error("{got} outputs came back at sample {first}, where {expected} were expected")]
    #[diagnostic(help("this is an error of firmware or host program, which should be reported"))]
    Outputs {
        /// Number of the first sample.
        first: u32,
        /// How many were expected.
        expected: usize,
        /// How many there were.
        got: usize,
    },
    /// A setting's name or value is wrong.
    #[error("{message}")]
    #[diagnostic(help("{help}"))]
    Setting {
        /// What is wrong.
        message: String,
        /// What to do.
        help: String,
    },
    /// Nobody has chosen the settings, and this would put the defaults to use.
    #[error(
        "nobody has chosen the settings of this controller, so its outputs are low: {act} would put out the standard PWM of \
         the defaults, whose stop pulse is 40 % to an ESC that takes a raw duty"
    )]
    #[diagnostic(help("{help}"))]
    NotChosen {
        /// What was asked for.
        act: &'static str,
        /// What to do.
        help: String,
    },
    /// An option does not fit the controller's settings.
    #[error("{message}")]
    #[diagnostic(help("{help}"))]
    Option {
        /// What is wrong.
        message: String,
        /// What to do.
        help: &'static str,
    },
    /// The plan or the model cannot be run.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Bench(#[from] rotorlead_plant::bench::BenchError),
}

impl DeviceError {
    /// What to do about it; empty where nothing is known.
    #[must_use]
    pub fn own_help(&self) -> String {
        self.help().map(|help| help.to_string()).unwrap_or_default()
    }

    /// Whether nobody answers any more, so that there is no use in asking for anything.
    #[must_use]
    pub const fn is_of_the_line(&self) -> bool {
        matches!(self, Self::Open { .. } | Self::Line { .. } | Self::NoAnswer { .. } | Self::OtherVersion { .. })
    }
}

/// What to do about a refusal.
fn remedy(refusal: &Refusal) -> &'static str {
    match refusal {
        Refusal::UnknownMotor => "count motors from 0",
        Refusal::NotDisarmed { .. } => "disarm the flight controller and stop any excitation first",
        Refusal::NotRested { .. } => {
            "ask again a few seconds after the motors have stopped, or fit the jumper of docs/wiring.md"
        }
        Refusal::NoSettings => {
            "`rotorlead device set` output.protocol to that of the ESC, and what else differs from it"
        }
        Refusal::BenchDisabled => "fit the jumper of docs/wiring.md, and take it out again before a flight",
        Refusal::TooSlow { .. } => "lower loop_rate_hz, use fewer lines, or find out why the faster clock does not run",
        Refusal::InputLive { .. } => "disconnect the flight controller's signal: only the host may drive the motor",
        Refusal::Settings(_) => "correct the value; `rotorlead device get` shows what is set",
        Refusal::Design => {
            "change omega_z_rad_s, omega_f_rad_s or damping, or with compensator inverse the keys inverse.* or \
             motor.*.time_constant_s; `rotorlead design` makes ones that fit"
        }
        Refusal::SaveFailed => "the flash may be worn out: use another controller",
        Refusal::CommandOutsideLimits { .. } => "lower --nominal or --amplitude, or raise the excitation's limits",
        Refusal::TooLong { .. } => "play fewer periods, or raise excitation.max_duration_s",
        Refusal::Exciting => "wait until it has ended, or stop it with `rotorlead device stop`",
        Refusal::Injecting { .. } => "end that injection, or send nothing for a second: it then ends by itself",
        Refusal::NotInjecting | Refusal::OutOfSequence { .. } | Refusal::WindowFull => {
            "start again: the line lost a frame, this program was held up for a second, or another one uses the line"
        }
        Refusal::NoDshot => "use pulses, or a board that speaks DShot: docs/board-rp2040.md is one",
        Refusal::NoBootLoader => "flash it by its button or probe: see the page of the board",
        Refusal::Divisor => "give a divisor from 1 to 5000",
    }
}
