//! Something outside that shares a line with the chip, and answers on it: an ESC with bidirectional DShot.

use serde::{Deserialize, Serialize};

use super::Edge;

/// From a moment on nothing outside drives a pin: its pull decides, or the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Release {
    /// When.
    pub cycle: u64,
    /// Number of the GPIO.
    pub pin: u8,
}

/// One step of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Drive {
    /// Cycles since the question's last fall.
    pub after: u64,
    /// The level that is driven from then on; `None` lets go of the line.
    pub level: Option<bool>,
}

/// Counts what the chip says on a line, and answers there. While it drives the line itself it does not count.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Responder {
    /// Number of the GPIO.
    pub pin: u8,
    /// Falls of the line in one question.
    pub falls: u32,
    /// What it does after each question, one after the other; afterwards it is silent. `None` where [`super::Live::advance`] is given
    /// what answers.
    pub answers: Option<Vec<Vec<Drive>>>,
}

/// A question on a line: as many falls as its responder counts, and the rise behind each.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(transparent)]
pub struct Question {
    /// The edges of one pin, in order.
    pub edges: Vec<Edge>,
}

/// A pin that the chip and the world outside have begun to drive at once, with whatever levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub struct Conflict {
    /// When.
    pub cycle: u64,
    /// Number of the GPIO.
    pub pin: u8,
}
