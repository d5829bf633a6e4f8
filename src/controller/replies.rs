//! Bidirectional DShot: the replies of the ESCs, and what the flight controller gets of them.

use super::hardware::{InputFrameHardware, OutputHardware};
use crate::dshot::{FRESH_MS, Reply, ReplyRelay};
use crate::link::{MotorFaults, NO_TURN};
use crate::settings::MOTORS;

/// As many as a board holds.
const WINDOWS_PER_TICK: usize = 2;

/// What came from one ESC, wrapping.
#[derive(Clone, Copy, Default)]
struct Counts {
    good: u32,
    bad: u32,
}

/// How fast one motor turns, as its ESC has said it last.
#[derive(Clone, Copy)]
struct Turn {
    turn_us: i32,
    /// Ticks for which it is still held.
    left: u32,
}

impl Turn {
    const NONE: Self = Self { turn_us: NO_TURN, left: 0 };

    fn tick(&mut self, reply: Option<Reply>, held_ticks: u32) {
        if let Some(turn_us) = reply.and_then(Reply::turn_us) {
            *self = Self { turn_us: i32::from(turn_us), left: held_ticks };
        } else {
            self.left = self.left.saturating_sub(1);
            if self.left == 0 {
                *self = Self::NONE;
            }
        }
    }
}

/// The replies of the four ESCs.
pub struct Replies {
    counts: [Counts; MOTORS],
    turns: [Turn; MOTORS],
    /// Ticks for which a turn is held.
    held_ticks: u32,
    /// `None` where the flight controller awaits none.
    relays: Option<[ReplyRelay; MOTORS]>,
}

impl Replies {
    /// `is_relayed`: the inputs are bidirectional, too. `frame_ticks`: from a frame of the outputs to the next.
    pub fn new(is_relayed: bool, frame_ticks: u32, loop_rate_hz: u32) -> Self {
        let fresh_ticks = super::ticks(FRESH_MS, loop_rate_hz);
        // Until a frame and the one after it have stayed without a reply.
        let held_ticks = fresh_ticks.max(frame_ticks.saturating_mul(3));
        let relays = is_relayed.then(|| core::array::from_fn(|_| ReplyRelay::new(fresh_ticks)));
        Self { counts: [Counts::default(); MOTORS], turns: [Turn::NONE; MOTORS], held_ticks, relays }
    }

    /// Once per control tick: takes what the ESCs have answered, the newest of each, and offers it where the input has frames (`are_live`).
    #[inline(never)]
    pub fn tick(
        &mut self,
        are_live: [bool; MOTORS],
        outputs: &mut impl OutputHardware,
        inputs: &mut impl InputFrameHardware,
    ) {
        let mut replies = [None; MOTORS];
        for (motor, (counts, reply)) in self.counts.iter_mut().zip(&mut replies).enumerate() {
            for _ in 0..WINDOWS_PER_TICK {
                let Some(window) = outputs.take_reply(motor) else { break };
                match window.reply() {
                    Some(Ok(good)) => {
                        counts.good = counts.good.wrapping_add(1);
                        *reply = Some(good);
                    }
                    Some(Err(_)) => counts.bad = counts.bad.wrapping_add(1),
                    None => {}
                }
            }
        }
        for (turn, reply) in self.turns.iter_mut().zip(replies) {
            turn.tick(reply, self.held_ticks);
        }
        let Some(relays) = &mut self.relays else { return };
        for (motor, ((relay, reply), is_live)) in relays.iter_mut().zip(replies).zip(are_live).enumerate() {
            let received = reply.filter(|_| is_live);
            if let Some(offer) = relay.tick(received, inputs.is_offer_taken(motor)) {
                inputs.offer_reply(motor, offer);
            }
        }
    }

    /// Microseconds of an electrical turn of this motor, or [`NO_TURN`] where its ESC has not said it for the longer of [`FRESH_MS`] and three frames.
    #[must_use]
    pub fn turn_us(&self, motor: usize) -> i32 {
        self.turns.get(motor).map_or(NO_TURN, |turn| turn.turn_us)
    }

    /// Offers none: no tick runs for a while.
    pub fn withdraw(&mut self, inputs: &mut impl InputFrameHardware) {
        for (motor, relay) in self.relays.iter_mut().flatten().enumerate() {
            inputs.offer_reply(motor, relay.withdraw());
        }
    }

    /// Adds what came to the faults of the motors.
    pub fn count(&self, faults: &mut [MotorFaults; MOTORS]) {
        for (motor, counts) in faults.iter_mut().zip(self.counts) {
            (motor.replies, motor.bad_replies) = (counts.good, counts.bad);
        }
    }
}
