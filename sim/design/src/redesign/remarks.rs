//! What a lead does about each effect, and what it cannot do. What else to do about it is the effect's own remedy.

use rotorlead_plant::effect::{Linearity, Site};
use rotorlead_plant::effect::{
    asymmetric_lag, backlash, clock_skew, command_quantization, dead_band, esc_frame_hold, gain_drift, second_pole,
    slew_limit, stand_resonance, supply_sag, transport_delay, winding_heating,
};
use rotorlead_plant::{ActiveEffect, CompensatorDesign};

/// Whether a motor in flight has it too: stand and sensor stay on the ground, and what changes with time has no bandwidth.
pub(super) fn persists_in_flight(effect: &ActiveEffect) -> bool {
    let kind = effect.kind();
    let stays_on_the_ground = matches!(kind.site, Site::Stand | Site::Sensor);
    let changes_with_time = kind.site >= Site::Air && kind.linearity == Linearity::Absent;
    !stays_on_the_ground && !changes_with_time
}

/// In a sentence or two; `None` where the numbers need no remark.
pub(super) fn remark(effect: &ActiveEffect, design: &CompensatorDesign) -> Option<String> {
    let value = |name: &str| effect.value(name).unwrap_or(f64::NAN);
    let step_peak = design.step_peak();
    let peak = 10_f64.powf(design.asymptotic_peak_db() / 20.0);
    let is_inverse = design.as_inverse().is_some();
    Some(match effect.kind().id {
        transport_delay::ID => format!(
            "A delay of {:.2} ms stays: a lead cannot see what is to come. It leaves the magnitude alone and costs phase, {:.0} \
             degrees at the poles of the filter, which brings the frequency of 90 degrees of lag down.",
            1e3 * value("delay_s"),
            (value("delay_s") * design.natural_rad_s()).to_degrees()
        ),
        esc_frame_hold::ID => format!(
            "Frames of {:.0} Hz hold each command for {:.1} ms, half of which is delay on average. A lead does not remove it.",
            value("frame_hz"),
            1e3 / value("frame_hz")
        ),
        slew_limit::ID if is_inverse => format!(
            "Nothing in front of it makes it faster than {:.3} duty/s. The inverse is designed with this limit, and its state is that of a \
             rotor that gets no more.",
            effect.slew_per_s().unwrap_or(f64::NAN)
        ),
        slew_limit::ID => format!("Nothing in front of it makes it faster than {:.3} duty/s.", effect.slew_per_s().unwrap_or(f64::NAN)),
        dead_band::ID => format!(
            "Changes under {:.4} are ignored, with or without the filter. It makes commands up to {peak:.1} times larger, their \
             noise too: what the flight controller sends while hovering passes the band more often.",
            value("width")
        ),
        command_quantization::ID => format!(
            "A grid of {:.4}: where the flight controller's output has it, ahead of the filter, each of its steps is answered by \
             up to {:.4}.",
            value("step"),
            step_peak * value("step")
        ),
        backlash::ID => format!(
            "Play of {:.4} to either side is not undone by a lead: amplitudes near it lose gain at every frequency.",
            value("half_width")
        ),
        stand_resonance::ID => format!(
            "The mode at {:.1} Hz is the stand's and stays on the ground: it is left out here. What was measured near it, around \
             {:.0} rad/s, says little of the motor.",
            value("frequency_hz"),
            std::f64::consts::TAU * value("frequency_hz")
        ),
        gain_drift::ID => format!(
            "The gain drifts by {:.1} % with a time constant of {:.0} s. A bandwidth is counted from the static value and does \
             not see it; a lead does not remove it, and thrust is off by as much.",
            100.0 * value("drift"),
            value("time_s")
        ),
        supply_sag::ID => {
            "The sag of the supply is below the band of the filter, and stays: a bandwidth counts from the static \
                         value with the sag in it."
                .to_owned()
        }
        winding_heating::ID => {
            "The windings heat within seconds, below the band of the filter. A lead does not cool them: after a high load thrust is \
             lower, and the flight controller has to ask for more."
                .to_owned()
        }
        second_pole::ID => format!(
            "A second lag of {:.1} ms is counted. Where it is the sensor's or the logger's, the motor is faster than said here.",
            1e3 * value("time_constant_s")
        ),
        asymmetric_lag::ID if is_inverse => {
            "Rising and falling differ: the table has the shorter time constant, so that neither overshoots, and the other direction \
             stays slower."
                .to_owned()
        }
        asymmetric_lag::ID => {
            "Rising and falling differ: one linear filter fits neither exactly, and overshoots on the faster one."
                .to_owned()
        }
        clock_skew::ID => "The clock of the logger is no part of the motor, and is left out.".to_owned(),
        _ if !persists_in_flight(effect) => format!("No motor in flight has the {}: it is left out here.", effect.kind().title),
        _ => return None,
    })
}
