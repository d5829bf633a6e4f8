//! Rise time, overshoot and settling time of simulated command steps, without and with a compensator: a bandwidth is that of small
//! signals.

use rotorlead::throttle::Command;
use rotorlead_plant::{Actuator, CompensatorDesign, EscTiming, Law, Model, PlantError};
use serde::Serialize;

/// A step is followed for so many of the longest time constants of the model. Derived: `e^-12`, 6e-6 of the step, is left.
const FOLLOWED: f64 = 12.0;
/// A way of a smaller share of the response is rounding: nothing moves. Chosen: far above a double's rounding, far below a step.
const MOVES: f64 = 1e-9;
/// Share of the step around its end within which the response has settled. Standard: the 5 % settling time, three time constants of a lag.
const SETTLED: f64 = 0.05;

/// A step of the flight controller's command at a nominal command, without and with a compensator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StepPoint {
    /// The command before the step, 0..1.
    pub nominal: f64,
    /// Size of the step, a command; negative downward.
    pub step: f64,
    /// Of the actuator alone.
    pub uncompensated: StepResponse,
    /// With the compensator in front.
    pub compensated: StepResponse,
}

/// How the response of an actuator follows a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StepResponse {
    /// From 10 to 90 % of the way, seconds; `None` where nothing moves.
    pub rise_s: Option<f64>,
    /// By how much the response passes its end, as a part of the step; 0 where it does not.
    pub overshoot: f64,
    /// From the step until the response stays within 5 % of its end, seconds; `None` where nothing moves.
    pub settling_s: Option<f64>,
}

/// Steps of these `sizes`, up and down, at each point of `model` that leaves them room, with the effects of the model. The rotor follows
/// its own speed ([`Law::FollowingSpeed`]), the filter is the controller's own with its limits, and the ESC takes over a command at its
/// frames.
///
/// # Errors
/// [`PlantError`] when the model cannot be simulated.
pub fn steps(
    model: &Model,
    design: &CompensatorDesign,
    esc_frame_hz: Option<f64>,
    sizes: &[f64],
) -> Result<Vec<StepPoint>, PlantError> {
    steps_at(1.0, model, design, esc_frame_hz, sizes)
}

/// The same at a voltage of so many of the model's.
pub(super) fn steps_at(
    supply: f64,
    model: &Model,
    design: &CompensatorDesign,
    esc_frame_hz: Option<f64>,
    sizes: &[f64],
) -> Result<Vec<StepPoint>, PlantError> {
    let longest_s = model.points.iter().map(|point| point.time_constant_s).fold(0.0, f64::max);
    let (rate_hz, duration_s) = (design.loop_rate_hz(), FOLLOWED * longest_s);
    let mut found = Vec::new();
    for nominal in model.points.iter().map(|point| point.nominal) {
        for step in sizes.iter().flat_map(|size| [*size, -size]) {
            if !(0.0..=1.0).contains(&(nominal + step)) {
                continue;
            }
            let followed = StepSimulation { model, esc_frame_hz, nominal, step, rate_hz, duration_s, supply };
            found.push(StepPoint {
                nominal,
                step,
                uncompensated: StepResponse::from_samples(&followed.responses(None)?, rate_hz),
                compensated: StepResponse::from_samples(&followed.responses(Some(design))?, rate_hz),
            });
        }
    }
    Ok(found)
}

/// A step at one nominal command, as [`steps`] simulates it.
#[derive(Clone, Copy, Debug)]
pub struct StepSimulation<'a> {
    /// What is driven, with its effects.
    pub model: &'a Model,
    /// Rate at which the ESC takes over a command, hertz; `None` for an ESC without frames.
    pub esc_frame_hz: Option<f64>,
    /// The command before the step, 0..1.
    pub nominal: f64,
    /// Size of the step, a command; negative downward.
    pub step: f64,
    /// Commands per second.
    pub rate_hz: f64,
    /// How long it is followed, seconds.
    pub duration_s: f64,
    /// Voltage of the supply over that of the model: what the rotor gets of a command.
    pub supply: f64,
}

impl StepSimulation<'_> {
    /// The response at the step and after every tick, in response units, without or with a compensator, whose loop rate is that of
    /// the commands.
    ///
    /// # Errors
    /// [`PlantError`] when the model cannot be simulated.
    pub fn responses(&self, design: Option<&CompensatorDesign>) -> Result<Vec<f64>, PlantError> {
        let timing = EscTiming { frame_hz: self.esc_frame_hz, frame_phase: 0.0 };
        let mut actuator = Actuator::new(self.model, Law::FollowingSpeed(self.supply * self.nominal), timing)?;
        let mut running = design.map(|design| design.running(Command::saturating_from_f64(self.nominal)));
        let command = Command::saturating_from_f64(self.nominal + self.step);
        let mut responses = vec![actuator.response()];
        for tick in 1..=(self.duration_s * self.rate_hz) as u32 {
            let to_esc = running.as_mut().map_or(command, |running| running.update(command));
            actuator.advance(self.supply * to_esc.to_f64(), f64::from(tick) / self.rate_hz);
            responses.push(actuator.response());
        }
        Ok(responses)
    }
}

impl StepResponse {
    /// From the response at every tick, from that of the step to one long after.
    fn from_samples(responses: &[f64], rate_hz: f64) -> Self {
        let (Some(&start), Some(&end)) = (responses.first(), responses.last()) else { return Self::NONE };
        let largest = responses.iter().fold(0.0_f64, |largest, response| largest.max(response.abs()));
        if (end - start).abs() <= MOVES * largest {
            return Self::NONE;
        }
        let parts = || responses.iter().map(|response| (response - start) / (end - start));
        // Between two ticks the response is all but straight. Standard: a rise is from 10 to 90 %.
        let first = |level: f64| {
            let after = parts().position(|part| part >= level)?;
            let (low, high) = (parts().nth(after.checked_sub(1)?)?, parts().nth(after)?);
            Some((after as f64 - (high - level) / (high - low)) / rate_hz)
        };
        let rise_s = first(0.1).zip(first(0.9)).map(|(from, to)| to - from);
        let overshoot = parts().fold(0.0, |most, part| f64::max(most, part - 1.0));
        let settling_s = parts().rposition(|part| (part - 1.0).abs() > SETTLED).map(|last| (last + 1) as f64 / rate_hz);
        Self { rise_s, overshoot, settling_s }
    }

    const NONE: Self = Self { rise_s: None, overshoot: 0.0, settling_s: None };
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::{model, table_1};

    use super::super::{DesignOptions, InverseOptions, design, design_inverse};
    use super::*;

    fn inverse(options: &InverseOptions) -> CompensatorDesign {
        design_inverse(&table_1(), options).unwrap().compensator.into()
    }

    #[test]
    fn a_lag_rises_in_its_time_constants() {
        let one = model(&[(0.5, 10.0, 0.1, 0.0)]);
        let options = DesignOptions { omega_g_rad_s: 500.0, ..DesignOptions::default() };
        let lead = design(&one, &options).unwrap().into();
        let found = steps(&one, &lead, None, &[0.1]).unwrap();
        assert_eq!(found.len(), 2);
        for point in found {
            let StepResponse { rise_s, overshoot, settling_s } = point.uncompensated;
            assert!((rise_s.unwrap() - 0.1 * 9f64.ln()).abs() < 1e-4, "{rise_s:?}");
            assert!((settling_s.unwrap() - 0.1 * 20f64.ln()).abs() < 3e-4 && overshoot < 1e-6, "{settling_s:?}");
            assert!(point.compensated.rise_s.unwrap() < 0.4 * rise_s.unwrap(), "{point:?}");
        }
    }

    #[test]
    fn an_inverse_makes_steps_alike_at_all_points_and_keeps_to_its_slew() {
        let free = steps(&table_1(), &inverse(&InverseOptions::default()), Some(600.0), &[0.05]).unwrap();
        assert_eq!(free.len(), 12);
        for StepPoint { nominal, step, compensated, .. } in free {
            let (rise_s, overshoot) = (compensated.rise_s.unwrap(), compensated.overshoot);
            // The whole of it is inside the range that the inverse covers, or bypassed beyond.
            if (0.35..=0.70).contains(&(nominal + step)) {
                assert!((0.022..0.026).contains(&rise_s) && overshoot < 0.06, "{nominal} {step}: {rise_s} {overshoot}");
            }
        }
        let slow = inverse(&InverseOptions { slew_per_s: Some(20.0), ..InverseOptions::default() });
        let large = steps(&table_1(), &slow, None, &[0.25]).unwrap();
        let up = large.iter().find(|point| point.nominal == 0.4 && point.step > 0.0).unwrap();
        let rise_s = up.compensated.rise_s.unwrap();
        assert!(
            rise_s > 0.03 && rise_s < 0.7 * up.uncompensated.rise_s.unwrap() && up.compensated.overshoot < 0.06,
            "{up:?}"
        );
    }

    #[test]
    fn steps_without_room_are_left_out() {
        let found = steps(&table_1(), &inverse(&InverseOptions::default()), None, &[0.5]).unwrap();
        assert!(found.iter().all(|point| (0.0..=1.0).contains(&(point.nominal + point.step))));
        // Up from 0.40 to 0.50, down from 0.50 to 0.65.
        assert_eq!(found.len(), 3 + 4);
    }
}
