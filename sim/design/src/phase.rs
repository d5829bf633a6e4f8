//! The phase of the whole chain, from the pulse in to the response, and how far it can be used.

use num_complex::Complex64;
use rotorlead_plant::effect::transport_delay;
use rotorlead_plant::{ActiveEffect, Model, OperatingPoint, Point, hold_delay_s};

use super::{BandwidthPoint, Chain, FrameStart, Latency};
use rotorlead_identify::frequency_response::bandwidth::{Bandwidth, first_frequency};

/// The phase of one chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseAtBandwidth {
    /// Mean delay from pulse in to the ESC that it counts, seconds.
    pub late_s: f64,
    /// Mean waits for tick and frame, or the delay of the holds in their place, that are part of it, seconds.
    pub waits_s: f64,
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
    /// All that comes late without a change of its shape where the compensator is in front, seconds.
    #[must_use]
    pub fn dead_time_s(&self) -> f64 {
        self.compensated.late_s + self.model_dead_time_s
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
    pub fn is_dead_time_limited(&self, bandwidths: &BandwidthPoint) -> bool {
        let (before, after) = (bandwidths.uncompensated.reached_rad_s(), bandwidths.compensated.reached_rad_s());
        after > before && after * self.dead_time_s() > 1.0 && self.compensated.minus_90.reached_rad_s() < after
    }
}

/// The phases at each of `points`, the bandwidths of `model` with `effects` in `chain`.
///
/// `phase = arg C(j w) + arg 1 / (1 + j w tau) + effects - w (late + dead time)`. What comes late is the latency; where the
/// chain is sampled, its holds of loop and ESC stand in it for the waits for tick and frame, which are the same delay.
#[must_use]
pub fn chain_phases(
    model: &Model,
    effects: &[ActiveEffect],
    chain: Chain,
    latency: &Latency,
    points: &[BandwidthPoint],
) -> Vec<ChainPhase> {
    let latency_s = latency.total().mean_s;
    let known_s = latency.input_pulse.mean_s + latency.input_filter.mean_s;
    let at = |(point, bandwidths): (&Point, &BandwidthPoint)| {
        let around = OperatingPoint { nominal: point.nominal, lag: point.lag(), response: 0.0 };
        let model_dead_time_s = point.delay_s + effects.iter().map(dead_time_s).sum::<f64>();
        let shape = |omega: f64| {
            let lag = Complex64::new(1.0, omega * point.time_constant_s).inv();
            // Summed as angles, which a product would wrap.
            let shaped = effects.iter().filter(|effect| dead_time_s(effect) == 0.0);
            let effects: f64 = shaped.map(|effect| effect.response(&around, omega).arg()).sum();
            lag.arg() + effects - omega * (known_s + model_dead_time_s)
        };
        let [passed_on_s, filtered_s] = chain.waits_s(latency);
        let uncompensated = |omega: f64| shape(omega) - omega * passed_on_s;
        let compensated = |omega: f64| shape(omega) - omega * filtered_s + chain.filter(point.nominal, omega).arg();
        let limit_rad_s = chain.limit_rad_s();
        let phase = |phase_rad: &dyn Fn(f64) -> f64, waits_s: f64, bandwidth: Bandwidth| PhaseAtBandwidth {
            late_s: known_s + waits_s,
            waits_s,
            phase_deg: bandwidth.rad_s().map(|omega| phase_rad(omega).to_degrees()),
            minus_90: first_frequency(|omega| phase_rad(omega) <= -std::f64::consts::FRAC_PI_2, limit_rad_s),
        };
        ChainPhase {
            nominal: point.nominal,
            latency_s,
            model_dead_time_s,
            uncompensated: phase(&uncompensated, passed_on_s, bandwidths.uncompensated),
            compensated: phase(&compensated, filtered_s, bandwidths.compensated),
        }
    };
    model.points.iter().zip(points).map(at).collect()
}

/// The pure delay of an effect.
fn dead_time_s(effect: &ActiveEffect) -> f64 {
    if effect.kind().id == transport_delay::ID { effect.value("delay_s").unwrap_or(0.0) } else { 0.0 }
}

impl Chain<'_> {
    /// Mean delay from where a pulse's value is known until the ESC has it, seconds: of a command that is passed on, and of
    /// what the filter makes of it.
    fn waits_s(&self, latency: &Latency) -> [f64; 2] {
        match self {
            Self::Continuous(_) | Self::Designed(_) => [latency.tick.mean_s + latency.output_frame.mean_s; 2],
            Self::Sampled { design, esc_frame_hz: None } => {
                [hold_delay_s(design.loop_rate_hz(), None) + latency.output_frame.mean_s; 2]
            }
            Self::Sampled { design, esc_frame_hz: Some(esc_frame_hz) } => match latency.frame_start {
                FrameStart::FreeRunning => [hold_delay_s(design.loop_rate_hz(), Some(*esc_frame_hz)); 2],
                // The frame starts in the tick that reads the pulse. It holds a command that is passed on until the next
                // pulse, a wait for the flight controller. What the filter comes to meanwhile waits for the next frame.
                FrameStart::FollowsInput => [latency.tick.mean_s, latency.tick.mean_s + 0.5 / esc_frame_hz],
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::table_1;
    use rotorlead_plant::{Catalog, CompensatorDesign, Effect, hold_response};

    use super::*;
    use crate::{DesignOptions, bandwidths, bandwidths_with, design};

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
            let effects = Catalog::standard().active_effects(model).unwrap();
            let points = bandwidths_with(model, &effects, chain);
            chain_phases(model, &effects, chain, &Latency::standard(5000.0), &points)
        };
        let chain = Chain::Continuous(design.lead());
        let effects = vec![effect("transport_delay", "delay_s", 0.036)];
        for (a, b) in of(&late(0.036), chain).iter().zip(of(&Model { effects, ..table_1() }, chain)) {
            close(a.model_dead_time_s, b.model_dead_time_s, 1e-15);
            close(a.compensated.phase_deg.unwrap(), b.compensated.phase_deg.unwrap(), 1e-6);
            close(a.compensated.minus_90.reached_rad_s(), b.compensated.minus_90.reached_rad_s(), 1e-6);
        }
        // An effect with a shape turns the phase by its own.
        let effects = vec![effect("second_pole", "time_constant_s", 0.01)];
        for (with, point) in of(&Model { effects, ..table_1() }, chain).iter().zip(&table_1().points) {
            assert_eq!(with.model_dead_time_s, 0.0);
            let omega = with.uncompensated.minus_90.reached_rad_s();
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
            let chain = Chain::Sampled { design: &CompensatorDesign::from(design), esc_frame_hz };
            let points = bandwidths(&model, chain);
            for (found, point) in chain_phases(&model, &[], chain, &free, &points).iter().zip(&model.points) {
                let omega = found.compensated.minus_90.rad_s().unwrap();
                let held = hold_response(5000.0, esc_frame_hz, omega).arg() + design.response(omega).arg();
                let phase = held - (omega * point.time_constant_s).atan() - omega * late_s;
                close(phase.to_degrees(), -90.0, 1e-9);
                // Half a tick of the loop less what its ticks share with the frames.
                let shared_s = if esc_frame_hz.is_some() { 0.5e-4 } else { 0.0 };
                close(found.dead_time_s(), free.total().mean_s - shared_s, 1e-15);
                assert_eq!(found.uncompensated.late_s, found.compensated.late_s);
            }
        }
    }

    /// `b0, b1, b2` and `a1, a2` of a second-order section.
    struct Tustin {
        b: [f64; 3],
        a: [f64; 2],
    }

    /// C(s) at 5 kHz: `s -> a (1 - z^-1) / (1 + z^-1)` with `a = 2 * 5000`.
    fn tustin(lead: &rotorlead::design::LeadParameters) -> Tustin {
        let (q, m) = (lead.omega_f_rad_s / 1e4, 1e4 / lead.omega_z_rad_s);
        let d = 1.0 + 2.0 * lead.damping * q + q * q;
        let numerator = [1.0 + m, 2.0, 1.0 - m];
        let denominator = [2.0 * (q * q - 1.0), 1.0 - 2.0 * lead.damping * q + q * q];
        Tustin { b: numerator.map(|b| q * q * b / d), a: denominator.map(|a| a / d) }
    }

    /// The phase from the pulses in to what the ESC holds, tick by tick: a sinusoid, sampled by pulses at 399.3 Hz whose
    /// value is known at once, through the filter where there is one, and out in the tick that reads the pulse.
    fn phase_of_following_frames(filter: Option<&Tustin>, omega: f64) -> f64 {
        let (tick_s, input_s) = (1.0 / 5000.0, 1.0 / 399.3);
        let periods_s = 40.0 * std::f64::consts::TAU / omega;
        let begins: Vec<f64> = (0..).map(|n| f64::from(n) * input_s).take_while(|&at| at < 2.0 * periods_s).collect();
        let value = |at: f64| Complex64::from_polar(1.0, omega * at);
        let (mut inputs, mut outputs) = ([Complex64::ZERO; 3], [Complex64::ZERO; 3]);
        let mut frames = Vec::new();
        let mut read = 0;
        for tick_at in (0..).map(|k| f64::from(k) * tick_s).take_while(|&at| at < 2.0 * periods_s) {
            let fresh = begins[read..].iter().take_while(|&&at| at <= tick_at).count();
            read += fresh;
            inputs = [begins[..read].last().map_or(Complex64::ZERO, |&at| value(at)), inputs[0], inputs[1]];
            let output = filter.map_or(inputs[0], |filter| {
                let made: Complex64 = inputs.iter().zip(filter.b).map(|(x, b)| x * b).sum();
                made - outputs[0] * filter.a[0] - outputs[1] * filter.a[1]
            });
            outputs = [output, outputs[0], outputs[1]];
            if fresh > 0 {
                frames.push((tick_at, output));
            }
        }
        // The Fourier integral of steps over the second half.
        let integral = |steps: &[(f64, Complex64)]| -> Complex64 {
            let ends = steps.iter().skip(1).map(|step| step.0).chain([2.0 * periods_s]);
            let pieces = steps.iter().zip(ends).filter(|(_, end)| *end > periods_s);
            let turn = |at: f64| Complex64::from_polar(1.0, -omega * at);
            pieces.map(|((begin, held), end)| held * (turn(begin.max(periods_s)) - turn(end))).sum()
        };
        let pulses: Vec<_> = begins.iter().map(|&at| (at, value(at))).collect();
        (integral(&frames) / integral(&pulses)).arg()
    }

    #[test]
    fn frames_that_follow_hold_what_the_filter_makes_and_not_what_is_passed_on() {
        let model = table_1();
        let design = design(&model, &DesignOptions::default()).unwrap();
        let following = Latency::standard(5000.0);
        assert_eq!(following.frame_start, FrameStart::FollowsInput);
        let chain = Chain::Sampled { design: &CompensatorDesign::from(design), esc_frame_hz: Some(399.3) };
        let [passed_on_s, filtered_s] = chain.waits_s(&following);
        let section = tustin(design.lead());
        for omega in [30.0, 60.0, 94.0, 125.0] {
            let passed_on = phase_of_following_frames(None, omega);
            close((passed_on + omega * passed_on_s).to_degrees(), 0.0, 0.05);
            let filtered = phase_of_following_frames(Some(&section), omega) - design.response(omega).arg();
            // Half a frame is 9 degrees at 125 rad/s. What frames fold back of the filter's steps stays under half of one.
            close((filtered + omega * filtered_s).to_degrees(), 0.0, 0.5);
        }
        // The parts of each phase: the bandwidths' table counts the same.
        let points = bandwidths(&model, chain);
        for (found, point) in chain_phases(&model, &[], chain, &following, &points).iter().zip(&model.points) {
            for (of, late_s, filter) in [
                (found.uncompensated, following.total().mean_s, 0.0),
                (found.compensated, following.total().mean_s + 0.5 / 399.3, 1.0),
            ] {
                close(of.late_s, late_s, 1e-15);
                let omega = of.minus_90.rad_s().unwrap();
                let lag = (omega * point.time_constant_s).atan();
                let phase = filter * design.response(omega).arg() - lag - omega * late_s;
                close(phase.to_degrees(), -90.0, 1e-9);
            }
        }
    }

    #[test]
    fn a_gain_is_lost_to_much_dead_time_and_not_to_little() {
        let lost = |delay_s: f64| {
            let (points, phases) = paper(&late(delay_s));
            phases.iter().zip(&points).map(|(phase, point)| phase.is_dead_time_limited(point)).collect::<Vec<_>>()
        };
        assert_eq!(lost(0.0), [false; 6]);
        // The fastest level has 94 rad/s: with 1.6 ms of latency 1 rad of lag is reached at 9.0 ms. The slow ones have up to
        // 18 rad/s, and 37.6 ms reach it at 26.6 rad/s.
        assert!(!lost(0.0088)[5]);
        assert!(lost(0.0092)[5]);
        assert_eq!(lost(0.036), [false, false, false, true, true, true]);
    }
}
