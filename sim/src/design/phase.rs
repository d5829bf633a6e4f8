//! The phase of the whole chain, from the pulse in to the response, and how far it can be used.

use num_complex::Complex64;

use super::{BandwidthPoint, Chain, Latency};
use crate::identify::{Bandwidth, first_frequency};
use crate::plant::{ActiveEffect, Model, OperatingPoint, Point};

/// The phase of one chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseAtBandwidth {
    /// At the bandwidth, degrees, not wrapped; `None` where there is no bandwidth in the range searched.
    pub phase_deg: Option<f64>,
    /// Where the phase is -90 degrees.
    ///
    /// A rate loop around a body that integrates its torque crosses -180 degrees there: no gain crossover lies above.
    pub minus_90: Bandwidth,
}

/// The phases at one nominal command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainPhase {
    /// Command around which they hold, 0..1.
    pub nominal: f64,
    /// Mean latency from pulse in to pulse out, seconds.
    pub latency_s: f64,
    /// Dead time of the model: that of its point, and of its effects, seconds.
    pub model_dead_time_s: f64,
    /// With the command passed on as it is.
    pub uncompensated: PhaseAtBandwidth,
    /// With the compensator in front.
    pub compensated: PhaseAtBandwidth,
}

impl ChainPhase {
    /// All that comes late without a change of its shape, seconds.
    #[must_use]
    pub fn dead_time_s(&self) -> f64 {
        self.latency_s + self.model_dead_time_s
    }

    /// Whether dead time takes the use from the bandwidth that the compensator gains. `bandwidths` are those of the same
    /// point.
    ///
    /// A dead time `theta` limits the crossover of any feedback loop to about `1 / theta`, where it lags 1 rad (57 degrees)
    /// alone (Skogestad & Postlethwaite, *Multivariable Feedback Control*, ch. 5, limitations imposed by time delays).
    /// The gain is lost where all of these hold: the compensator raises the bandwidth; the new bandwidth is above `1 / theta`;
    /// the whole chain lags more than 90 degrees there. The last leaves out slow levels, whose lag is still small at their
    /// new bandwidth.
    #[must_use]
    pub fn is_gain_lost(&self, bandwidths: &BandwidthPoint) -> bool {
        let (before, after) = (rad_s(bandwidths.uncompensated), rad_s(bandwidths.compensated));
        after > before && after * self.dead_time_s() > 1.0 && rad_s(self.compensated.minus_90) < after
    }
}

/// The phases at each of `points`, the bandwidths of `model` with `effects` in `chain`.
///
/// `phase = arg C(j w) + arg 1 / (1 + j w tau) + effects - w (latency + dead time)`, with the mean latency. A dead time of
/// the model counts once, as do tick and frame where the chain has them as holds: a hold's mean delay is the mean wait.
#[must_use]
pub fn chain_phases(
    model: &Model,
    effects: &[ActiveEffect],
    chain: Chain,
    latency: &Latency,
    points: &[BandwidthPoint],
) -> Vec<ChainPhase> {
    let latency_s = latency.total().mean_s;
    let late_s = latency_s - chain.mean_waits_s(latency);
    let at = |(point, bandwidths): (&Point, &BandwidthPoint)| {
        let around = OperatingPoint { nominal: point.nominal, lag: point.lag(), response: 0.0 };
        let model_dead_time_s = point.delay_s + effects.iter().map(dead_time_s).sum::<f64>();
        let uncompensated = |omega: f64| {
            let lag = Complex64::new(1.0, omega * point.time_constant_s).inv();
            // Summed as angles, which a product would wrap.
            let shaped = effects.iter().filter(|effect| dead_time_s(effect) == 0.0);
            let effects: f64 = shaped.map(|effect| effect.response(&around, omega).arg()).sum();
            lag.arg() + chain.holds(omega).arg() + effects - omega * (late_s + model_dead_time_s)
        };
        let compensated = |omega: f64| uncompensated(omega) + chain.filter(omega).arg();
        let limit_rad_s = chain.limit_rad_s();
        ChainPhase {
            nominal: point.nominal,
            latency_s,
            model_dead_time_s,
            uncompensated: phase_at(uncompensated, bandwidths.uncompensated, limit_rad_s),
            compensated: phase_at(compensated, bandwidths.compensated, limit_rad_s),
        }
    };
    model.points.iter().zip(points).map(at).collect()
}

fn phase_at(phase_rad: impl Fn(f64) -> f64, bandwidth: Bandwidth, limit_rad_s: f64) -> PhaseAtBandwidth {
    PhaseAtBandwidth {
        phase_deg: bandwidth.rad_s().map(|omega| phase_rad(omega).to_degrees()),
        minus_90: first_frequency(|omega| phase_rad(omega) <= -std::f64::consts::FRAC_PI_2, limit_rad_s),
    }
}

/// The pure delay of an effect.
fn dead_time_s(effect: &ActiveEffect) -> f64 {
    if effect.kind().id == "transport_delay" { effect.value("delay_s").unwrap_or(0.0) } else { 0.0 }
}

/// The frequency, or up to where there is none.
fn rad_s(bandwidth: Bandwidth) -> f64 {
    match bandwidth {
        Bandwidth::At(omega) | Bandwidth::Beyond(omega) => omega,
    }
}

impl Chain<'_> {
    /// The mean waits of `latency` that the holds of the chain have already.
    fn mean_waits_s(&self, latency: &Latency) -> f64 {
        match self {
            Self::Continuous(_) => 0.0,
            Self::Sampled { esc_frame_hz: None, .. } => latency.tick.mean_s,
            Self::Sampled { esc_frame_hz: Some(_), .. } => latency.tick.mean_s + latency.output_frame.mean_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{DesignOptions, bandwidths, bandwidths_with, design};
    use crate::plant::testing::table_1;
    use crate::plant::{Catalog, Effect, hold_response};

    fn close(a: f64, b: f64, tolerance: f64) {
        assert!((a - b).abs() < tolerance, "{a} is not {b}");
    }

    /// Table 1 with this dead time in its points.
    fn late(delay_s: f64) -> Model {
        let mut model = table_1();
        model.points.iter_mut().for_each(|point| point.delay_s = delay_s);
        model
    }

    fn paper(model: &Model) -> (Vec<BandwidthPoint>, Vec<ChainPhase>) {
        let design = design(model, &DesignOptions::default()).unwrap();
        let chain = Chain::Continuous(design.lead());
        let points = bandwidths(model, chain);
        let phases = chain_phases(model, &[], chain, &Latency::standard(5000.0), &points);
        (points, phases)
    }

    #[test]
    fn the_phase_is_that_of_lag_and_compensator_less_the_dead_time() {
        let model = late(0.036);
        let design = design(&model, &DesignOptions::default()).unwrap();
        let (points, phases) = paper(&model);
        let theta_s = 0.036 + 1.6022e-3;
        for ((point, found), bandwidths) in model.points.iter().zip(&phases).zip(&points) {
            close(found.dead_time_s(), theta_s, 1e-15);
            let lag = |omega: f64| -(omega * point.time_constant_s).atan() - omega * theta_s;
            let lead = |omega: f64| design.lead().response(omega).arg();
            let (before, after) = (bandwidths.uncompensated.rad_s().unwrap(), bandwidths.compensated.rad_s().unwrap());
            close(found.uncompensated.phase_deg.unwrap(), lag(before).to_degrees(), 1e-9);
            close(found.compensated.phase_deg.unwrap(), (lag(after) + lead(after)).to_degrees(), 1e-9);
            for (omega, phase) in [
                (found.uncompensated.minus_90, &lag as &dyn Fn(f64) -> f64),
                (found.compensated.minus_90, &|omega| lag(omega) + lead(omega)),
            ] {
                close(phase(omega.rad_s().unwrap()).to_degrees(), -90.0, 1e-9);
            }
        }
        // The fastest: the zero cancels its pole, and what is left is two poles, at -90 degrees where they are.
        let (fastest, after) = (phases[5], points[5].compensated.rad_s().unwrap());
        let poles = design.lead();
        let two = Complex64::new(
            poles.omega_f_rad_s.powi(2) - after.powi(2),
            2.0 * poles.damping * poles.omega_f_rad_s * after,
        );
        close(fastest.compensated.phase_deg.unwrap(), (-two.arg() - after * theta_s).to_degrees(), 1e-9);
        assert!(fastest.compensated.phase_deg.unwrap() < -270.0, "not wrapped: {fastest:?}");
    }

    #[test]
    fn a_dead_time_counts_the_same_in_a_point_and_as_an_effect() {
        let effect = |kind: &str, parameter: &str, value: f64| Effect {
            kind: kind.to_owned(),
            parameters: [(parameter.to_owned(), value)].into(),
            std: Default::default(),
        };
        let design = design(&table_1(), &DesignOptions::default()).unwrap();
        let of = |model: &Model, chain: Chain| {
            let effects = Catalog::standard().of_model(model).unwrap();
            let points = bandwidths_with(model, &effects, chain);
            chain_phases(model, &effects, chain, &Latency::standard(5000.0), &points)
        };
        let chain = Chain::Continuous(design.lead());
        let effects = vec![effect("transport_delay", "delay_s", 0.036)];
        for (a, b) in of(&late(0.036), chain).iter().zip(of(&Model { effects, ..table_1() }, chain)) {
            close(a.model_dead_time_s, b.model_dead_time_s, 1e-15);
            close(a.compensated.phase_deg.unwrap(), b.compensated.phase_deg.unwrap(), 1e-6);
            close(rad_s(a.compensated.minus_90), rad_s(b.compensated.minus_90), 1e-6);
        }
        // An effect with a shape turns the phase by its own.
        let effects = vec![effect("second_pole", "time_constant_s", 0.01)];
        for (with, point) in of(&Model { effects, ..table_1() }, chain).iter().zip(&table_1().points) {
            assert_eq!(with.model_dead_time_s, 0.0);
            let omega = rad_s(with.uncompensated.minus_90);
            let phase = -(omega * point.time_constant_s).atan() - (omega * 0.01).atan() - omega * 1.6022e-3;
            close(phase.to_degrees(), -90.0, 1e-9);
        }
    }

    #[test]
    fn holds_take_the_place_of_the_waits_that_they_are() {
        let model = table_1();
        let design = design(&model, &DesignOptions::default()).unwrap();
        let pulse = Latency::standard(5000.0).input;
        // As fast out as in: frames run freely.
        let free = Latency::new(pulse, pulse, 5000.0).unwrap();
        let beyond_s = free.input_pulse.mean_s + free.input_filter.mean_s;
        for (esc_frame_hz, late_s) in [(Some(400.0), beyond_s), (None, beyond_s + free.output_frame.mean_s)] {
            let chain = Chain::Sampled { design: &design, esc_frame_hz };
            let points = bandwidths(&model, chain);
            for (found, point) in chain_phases(&model, &[], chain, &free, &points).iter().zip(&model.points) {
                let omega = found.compensated.minus_90.rad_s().unwrap();
                let held = hold_response(5000.0, esc_frame_hz, omega).arg() + design.response(omega).arg();
                let phase = held - (omega * point.time_constant_s).atan() - omega * late_s;
                close(phase.to_degrees(), -90.0, 1e-9);
                close(found.dead_time_s(), free.total().mean_s, 1e-15);
            }
        }
    }

    #[test]
    fn a_gain_is_lost_to_much_dead_time_and_not_to_little() {
        let lost = |delay_s: f64| {
            let (points, phases) = paper(&late(delay_s));
            phases.iter().zip(&points).map(|(phase, point)| phase.is_gain_lost(point)).collect::<Vec<_>>()
        };
        assert_eq!(lost(0.0), [false; 6]);
        // The fastest level has 94 rad/s: with 1.6 ms of latency 1 rad of lag is reached at 9.0 ms. The slow ones have up to
        // 18 rad/s, and 37.6 ms reach it at 26.6 rad/s.
        assert!(!lost(0.0088)[5]);
        assert!(lost(0.0092)[5]);
        assert_eq!(lost(0.036), [false, false, false, true, true, true]);
    }
}
