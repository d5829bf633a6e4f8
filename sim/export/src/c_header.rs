//! A compensator as constants in C, for firmware with Rotorlead's C interface.

use std::fmt::Write as _;

use rotorlead_plant::{CompensatorDesign, FilterDesign};

/// A header in C99 and C++11 with the parameters of a compensator, and a function that designs it: beside `rotorlead.h` of this
/// version. Limits of the output are the caller's, who knows what the ESC idles at.
///
/// # Panics
/// Never: a string takes all.
#[must_use]
pub fn c_header(design: &CompensatorDesign) -> String {
    let mut text = format!(
        "/* A compensator by Rotorlead {}. Numbers have the digits that give the host's design to the last bit. */\n#ifndef \
         MOTOR_COMPENSATOR_H\n#define MOTOR_COMPENSATOR_H\n\n#include \"rotorlead.h\"\n\n/* Call a step so often, hertz. */\nstatic const double \
         motor_loop_rate_hz = {:?};\n\n",
        env!("CARGO_PKG_VERSION"),
        design.loop_rate_hz()
    );
    let slew_per_s = design.slew_per_s().unwrap_or(0.0);
    let call = match &design.kind {
        FilterDesign::Lead(lead) => {
            let lead = lead.lead();
            let numbers = [lead.omega_z_rad_s, lead.omega_f_rad_s, lead.damping, slew_per_s];
            structure(
                &mut text,
                "Zero and poles in rad/s, damping, slew per second",
                "rotorlead_lead motor_lead",
                &numbers,
            );
            "rotorlead_design_lead(compensator, &motor_lead, motor_loop_rate_hz, min, max)"
        }
        FilterDesign::Inverse(inverse) => {
            let (reference, (from, to)) = (inverse.design().reference(), inverse.range().compensated);
            let numbers = [reference.omega_f_rad_s, reference.damping, slew_per_s, from, to];
            let what =
                "Natural frequency in rad/s, damping, slew per second, commands from and to which it is in the path";
            structure(&mut text, what, "rotorlead_inverse motor_inverse", &numbers);
            text += "/* Commands, and time constants there in seconds. */\nstatic const rotorlead_point motor_points[] = {\n";
            for point in inverse.points() {
                writeln!(text, "    {{ {:?}, {:?} }},", point.command, point.tau_s).expect("a string takes all");
            }
            text += "};\n\n";
            "rotorlead_design_inverse(compensator, &motor_inverse, motor_points, sizeof motor_points / sizeof motor_points[0],\n        \
             motor_loop_rate_hz, min, max)"
        }
    };
    text += "/* Designs it for an output from `min` to `max`, commands from 0 to 1. */\nstatic inline rotorlead_status \
             motor_design(rotorlead_compensator *compensator, double min, double max)\n{\n";
    writeln!(text, "    return {call};\n}}\n\n#endif").expect("a string takes all");
    text
}

fn structure(text: &mut String, what: &str, name: &str, numbers: &[f64]) {
    let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
    writeln!(text, "/* {what}. */\nstatic const {name} = {{ {} }};\n", numbers.join(", ")).expect("a string takes all");
}
