//! The columns that a record's CSV file may have, and what their values may be.

use super::manifest::CommandKind;
use super::{Output, Record};
use crate::files::{AcceptedRange, shown};

/// A column of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    TimeS,
    Command,
    ThrustN,
    Rpm,
    EscCommand,
    VoltageV,
    CurrentA,
    SetpointRoll,
    SetpointPitch,
    SetpointYaw,
    SetpointThrottle,
}

impl Column {
    /// Every column, in the order in which they are written.
    pub(super) const ALL: [Self; 11] = [
        Self::TimeS,
        Self::Command,
        Self::ThrustN,
        Self::Rpm,
        Self::EscCommand,
        Self::VoltageV,
        Self::CurrentA,
        Self::SetpointRoll,
        Self::SetpointPitch,
        Self::SetpointYaw,
        Self::SetpointThrottle,
    ];

    /// Its name in the header.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::TimeS => "time_s",
            Self::Command => "command",
            Self::ThrustN => "thrust_n",
            Self::Rpm => "rpm",
            Self::EscCommand => "esc_command",
            Self::VoltageV => "voltage_v",
            Self::CurrentA => "current_a",
            Self::SetpointRoll => "setpoint_roll_rad_s",
            Self::SetpointPitch => "setpoint_pitch_rad_s",
            Self::SetpointYaw => "setpoint_yaw_rad_s",
            Self::SetpointThrottle => "setpoint_throttle",
        }
    }

    /// The column of that name.
    pub(super) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|column| column.name() == name)
    }

    /// The column that holds the response.
    pub(super) fn for_output(output: Output) -> Self {
        match output {
            Output::ThrustN => Self::ThrustN,
            Output::Rpm => Self::Rpm,
        }
    }

    /// Its values in `record`; `None` when the record has not got it.
    pub(super) fn values(self, record: &Record) -> Option<&[f64]> {
        match self {
            Self::TimeS => Some(&record.time_s),
            Self::Command => Some(&record.command[..]).filter(|command| !command.is_empty()),
            Self::ThrustN => record.thrust_n.as_deref(),
            Self::Rpm => record.rpm.as_deref(),
            Self::EscCommand => record.esc_command.as_deref(),
            Self::VoltageV => record.voltage_v.as_deref(),
            Self::CurrentA => record.current_a.as_deref(),
            Self::SetpointRoll => record.setpoints.roll_rad_s.as_deref(),
            Self::SetpointPitch => record.setpoints.pitch_rad_s.as_deref(),
            Self::SetpointYaw => record.setpoints.yaw_rad_s.as_deref(),
            Self::SetpointThrottle => record.setpoints.throttle.as_deref(),
        }
    }

    /// Accepts and returns `value`, which follows `previous` in the same column.
    ///
    /// A response may be negative: the zero of a thrust sensor drifts. A command is a duty, or of another `kind`.
    pub(super) fn accept(self, kind: CommandKind, previous: Option<f64>, value: f64) -> Result<f64, Refusal> {
        if !value.is_finite() {
            return Err(Refusal::new(
                format!("{value} is not a finite number"),
                "remove the row, or fill it with what was measured",
            ));
        }
        match (self, previous) {
            (Self::TimeS, Some(previous)) if value == previous => {
                return Err(Refusal::new(
                    format!("time stands still at {}", shown(value)),
                    "remove the repeated row, or write the times with more digits",
                ));
            }
            (Self::TimeS, Some(previous)) if value < previous => {
                return Err(Refusal::new(
                    format!("time runs backwards, from {} to {}", shown(previous), shown(value)),
                    "sort the rows by time, and give each run a record of its own",
                ));
            }
            _ => {}
        }
        let quantity = match (self, kind) {
            (Self::Command, CommandKind::ForceN) => &AcceptedRange::THRUST_N,
            _ => self.quantity(),
        };
        let AcceptedRange { least, greatest, .. } = *quantity;
        if (least..=greatest).contains(&value) {
            return Ok(value);
        }
        Err(if greatest == 1.0 {
            Refusal::new(
                format!("{} is outside 0 to 1", shown(value)),
                "a command is a duty from 0 to 1: divide a percentage by 100, \
                     scale a pulse width by its range",
            )
        } else {
            Refusal::new(
                format!("{} is not from {} to {}", shown(value), shown(least), shown(greatest)),
                "remove the row where it was not measured, or give the column in the unit of its name",
            )
        })
    }

    fn quantity(self) -> &'static AcceptedRange {
        match self {
            Self::TimeS => &AcceptedRange::TIME_S,
            Self::Command | Self::EscCommand => &AcceptedRange::DUTY,
            Self::ThrustN => &AcceptedRange::THRUST_N,
            Self::Rpm => &AcceptedRange::RPM,
            Self::VoltageV => &AcceptedRange::VOLTAGE_V,
            Self::CurrentA => &AcceptedRange::CURRENT_A,
            Self::SetpointRoll | Self::SetpointPitch | Self::SetpointYaw => &AcceptedRange::RATE_RAD_S,
            Self::SetpointThrottle => &AcceptedRange::DUTY,
        }
    }
}

/// Why a value is refused, and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    pub(super) message: String,
    pub(super) help: &'static str,
}

impl Refusal {
    pub(super) fn new(message: String, help: &'static str) -> Self {
        Self { message, help }
    }
}

/// The least number of rows of a record. The command of a row acts until the next one, so one row
/// holds no response to its command, and no sample interval. What an estimator needs beyond that
/// depends on the estimator, which says so itself.
pub(super) const LEAST_ROWS: usize = 2;

/// What to do about a record that is shorter.
pub(super) const TOO_FEW_ROWS: &str = "a response needs a row after the one that holds its command: record longer";
