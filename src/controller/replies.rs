//! Bidirectional DShot: the replies of the ESCs, and what the flight controller gets of them.

use super::hardware::ControlHardware;
use crate::dshot::{FRESH_MS, Reply, ReplyRelay};
use crate::link::MotorFaults;
use crate::settings::MOTORS;

/// As many as a board holds.
const WINDOWS_PER_TICK: usize = 2;

/// What came from one ESC, wrapping.
#[derive(Clone, Copy, Default)]
struct Counts {
    good: u32,
    bad: u32,
}

/// The replies of the four ESCs.
pub struct Replies {
    counts: [Counts; MOTORS],
    /// `None` where the flight controller awaits none.
    relays: Option<[ReplyRelay; MOTORS]>,
}

impl Replies {
    /// `is_relayed`: the inputs are bidirectional, too.
    pub fn new(is_relayed: bool, loop_rate_hz: u32) -> Self {
        let relay = |_| ReplyRelay::new(super::ticks(FRESH_MS, loop_rate_hz));
        Self { counts: [Counts::default(); MOTORS], relays: is_relayed.then(|| core::array::from_fn(relay)) }
    }

    /// Once per control tick: takes what the ESCs have answered, the newest of each, and offers it where the input has frames (`are_live`).
    #[inline(never)]
    pub fn tick(&mut self, are_live: [bool; MOTORS], hardware: &mut impl ControlHardware) -> [Option<Reply>; MOTORS] {
        let mut replies = [None; MOTORS];
        for (motor, (counts, reply)) in self.counts.iter_mut().zip(&mut replies).enumerate() {
            for _ in 0..WINDOWS_PER_TICK {
                let Some(window) = hardware.take_reply(motor) else { break };
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
        let Some(relays) = &mut self.relays else { return replies };
        for (motor, ((relay, reply), is_live)) in relays.iter_mut().zip(replies).zip(are_live).enumerate() {
            let received = reply.filter(|_| is_live);
            if let Some(offer) = relay.tick(received, hardware.is_offer_taken(motor)) {
                hardware.offer_reply(motor, offer);
            }
        }
        replies
    }

    /// Offers none: no tick runs for a while.
    pub fn withdraw(&mut self, hardware: &mut impl ControlHardware) {
        for (motor, relay) in self.relays.iter_mut().flatten().enumerate() {
            hardware.offer_reply(motor, relay.withdraw());
        }
    }

    /// Adds what came to the faults of the motors.
    pub fn count(&self, faults: &mut [MotorFaults; MOTORS]) {
        for (motor, counts) in faults.iter_mut().zip(self.counts) {
            (motor.replies, motor.bad_replies) = (counts.good, counts.bad);
        }
    }
}
