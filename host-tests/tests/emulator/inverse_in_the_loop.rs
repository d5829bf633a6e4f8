//! The controller's image with the inverse in the loop: commands and outputs go over its link, and the rotor, whose time
//! constant depends on its speed, is simulated on the host. `cargo xtask test` builds the image and runs this.

use std::f64::consts::TAU;

use host_tests::emulator::{HostLate, Machine, Start, image, keeping_up};
use host_tests::{EscFrames, TABLE_1, gain_at, paper_curve, pole_at};
use rotorlead::compensator::Filter;
use rotorlead::controller::{channels, filters};
use rotorlead::design::RotorCurve;
use rotorlead::excitation::{Multisine, ODD_LINES_45_HZ};
use rotorlead::inverse::COEFFICIENT_BITS;
use rotorlead::link::{Message, Request};
use rotorlead::settings::{CompensatorKind, Settings, Validated};
use rotorlead::throttle::{Command, Throttle};

const LOOP_RATE_HZ: f64 = 5000.0;
/// Frames of the ESC, as in the paper.
const ESC_FRAME_HZ: f64 = 600.0;
/// Small enough for the rotor at 0.40 to follow without a limit: an inverse asks it for seven times a step.
const AMPLITUDE: f64 = 0.02;
/// Periods of 10 s: one for the transient to decay, and the one that is evaluated.
const PERIODS: usize = 2;

/// The inverse of the paper's motors, with the longest hold time: the emulated time runs ahead of a host.
fn settings(slew_per_s: f64) -> Validated {
    let mut settings = Settings { compensator: CompensatorKind::Inverse, ..Settings::default() };
    settings.slew_per_s = slew_per_s;
    let curve = RotorCurve::through(&paper_curve()).unwrap();
    for motor in &mut settings.motors {
        (motor.curve, motor.hold_ms) = (Some(curve), 1000);
    }
    settings.validate().unwrap()
}

/// What the image makes of commands for motor 0, which has to be what the library makes of them.
fn through_the_image(settings: &Validated, commands: &[Command]) -> Result<Vec<f64>, HostLate> {
    let image = image();
    let mut machine = Machine::boot(&Start::new(&image));
    let taken = machine.link.ask(&Request::SetSettings(Settings::clone(settings)));
    assert_eq!(taken, Message::SettingsTaken(settings.warnings()));
    assert_eq!(machine.link.ask(&Request::GetSettings), Message::Settings(Settings::clone(settings)));
    machine.link.take_over();
    let start = std::time::Instant::now();
    let outputs = machine.link.inject(0, commands)?;
    println!("{} samples, {:.0} a second", commands.len(), commands.len() as f64 / start.elapsed().as_secs_f64());
    let [mut channel, ..] = channels(settings, filters(settings).unwrap()).unwrap();
    channel.set_enabled(true);
    for (sample, (&command, &output)) in commands.iter().zip(&outputs).enumerate() {
        assert_eq!(output, channel.inject(command).to_bits(), "sample {sample}");
    }
    Ok(outputs.into_iter().map(|bits| Throttle::from_bits(bits).to_f64()).collect())
}

/// The stop and the level at which the filter is put to rest.
fn lead_in(level: f64) -> [Command; 2] {
    [Command::ZERO, Command::saturating_from_f64(level)]
}

/// The -3 dB bandwidth of the reference model with the rounded coefficients of the inverse, rad/s.
fn predicted_bandwidth_rad_s(settings: &Validated) -> f64 {
    let [Filter::Inverse(inverse), ..] = filters(settings).unwrap() else { panic!("no inverse") };
    let one = f64::from(1_u32 << COEFFICIENT_BITS);
    let (a, b) = (f64::from(inverse.coefficients.a()) / one, f64::from(inverse.coefficients.b()) / one);
    // A^2 / (z^2 - (2 - B - A^2) z + 1 - B)
    let gain = |omega: f64| {
        let (sin, cos) = (omega / LOOP_RATE_HZ).sin_cos();
        let c = 2.0 - b - a * a;
        let (re, im) = (2.0 * cos * cos - 1.0 - c * cos + 1.0 - b, 2.0 * sin * cos - c * sin);
        a * a / re.hypot(im)
    };
    let (mut low, mut high) = (10.0, 1000.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if gain(middle) > 10.0_f64.powf(-0.15) { low = middle } else { high = middle }
    }
    low
}

/// A multisine around one of the paper's operating points.
fn operating_point_through_the_image(nominal: f64) -> Result<(), HostLate> {
    // The slew of an AM32.
    let settings = settings(160.0);
    let mut multisine = Multisine::new(ODD_LINES_45_HZ, nominal, AMPLITUDE, LOOP_RATE_HZ).unwrap();
    multisine.start(None);
    let period: Vec<Command> = (0..multisine.ticks_per_period()).map(|_| multisine.update()).collect();
    let commands = [&lead_in(nominal)[..], &period.repeat(PERIODS)].concat();
    let outputs = through_the_image(&settings, &commands)?;

    let curve = paper_curve();
    let (mut esc, mut v) = (EscFrames::new(ESC_FRAME_HZ, nominal), nominal);
    let mut rotor = Vec::new();
    for output in &outputs[lead_in(nominal).len()..] {
        rotor.push(v);
        v += (esc.hold(*output) - v) * (1.0 - (-pole_at(&curve, v) / LOOP_RATE_HZ).exp());
    }
    let input: Vec<f64> = period.iter().map(|command| command.to_f64()).collect();
    let rotor = &rotor[rotor.len() - input.len()..];
    // Lines are odd multiples of 0.1 Hz. The bandwidth lies between two of them, in a straight line of decibels.
    let gain_db = |harmonic| 20.0 * gain_at(&input, rotor, harmonic).log10();
    let omega = |harmonic: f64| TAU * 0.1 * harmonic;
    let lines: Vec<(f64, f64)> = (101..221).step_by(2).map(|line| (omega(line as f64), gain_db(line))).collect();
    let found = lines.windows(2).find(|pair| pair[1].1 < -3.0).map(|pair| {
        let [(low, low_db), (high, high_db)] = [pair[0], pair[1]];
        low + (high - low) * (low_db + 3.0) / (low_db - high_db)
    });
    let (found, predicted) = (found.unwrap(), predicted_bandwidth_rad_s(&settings));
    println!("{nominal}: {predicted:.2} rad/s predicted, {found:.2} found");
    assert!((found / predicted - 1.0).abs() < 0.02, "{nominal}: {found} for {predicted}");
    assert!(gain_db(1).abs() < 0.05, "{}", gain_db(1));
    Ok(())
}

fn operating_points_through_the_image(points: &[(f64, f64, f64)]) {
    for (nominal, ..) in points {
        keeping_up(|| operating_point_through_the_image(*nominal));
    }
}

/// Where the time constant, and with it the lead, is longest.
#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_inverse_at_the_lowest_operating_point_is_the_hosts_bit_for_bit_with_the_predicted_bandwidth() {
    operating_points_through_the_image(&TABLE_1[..1]);
}

#[test]
#[ignore = "some forty seconds for each level: cargo xtask statistics"]
fn every_level_of_the_paper_with_the_inverse_is_the_hosts_bit_for_bit_with_the_predicted_bandwidth() {
    operating_points_through_the_image(&TABLE_1);
}

/// Steps that the slew limits for long, and some that meet the ends of the range.
#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn large_steps_with_a_slew_limit_are_the_hosts_bit_for_bit() {
    for slew_per_s in [20.0, 160.0] {
        let levels = [0.4, 0.7, 0.4, 0.35, 0.65, 0.95, 0.65];
        let held = levels.iter().flat_map(|&level| [Command::saturating_from_f64(level); 1500]);
        let commands: Vec<Command> = lead_in(levels[0]).into_iter().chain(held).collect();
        let outputs = keeping_up(|| through_the_image(&settings(slew_per_s), &commands));
        // The largest change is the slew, rounded down to steps of 2^-16.
        let slew = (slew_per_s / LOOP_RATE_HZ * 65_536.0).floor() / 65_536.0;
        let changes = outputs[2..].windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let limited = changes.clone().filter(|change| *change == slew).count();
        let at_ends = outputs[2..].iter().filter(|&&output| output == 1.0 || output < 0.0501).count();
        println!("{slew_per_s}: {limited} ticks at the slew, {at_ends} at an end of the range");
        assert!(changes.clone().all(|change| change <= slew));
        assert!(limited > 30 && at_ends > 100, "{limited} {at_ends}");
    }
}
