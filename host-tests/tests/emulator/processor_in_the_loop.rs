//! The paper's experiment with the controller's image in the loop: commands and outputs go over its link, the motor is
//! simulated on the host. `cargo xtask test` builds the image and runs this.

use std::path::Path;

use clap::Parser as _;
use host_tests::TABLE_1;
use host_tests::emulator::{HostLate, Machine, image, keeping_up};
use rotorlead::link::Refusal;
use rotorlead_cli::Arguments;
use serde_json::Value;

/// Seconds of a multisine at each level, its warm-up with it, and of a square wave.
const MULTISINE_S: usize = 30;
const SQUARE_S: usize = 10;
/// What is played before each record, to arm.
const LEAD_IN: usize = 2;
const LOOP_RATE_HZ: usize = 5000;

/// Runs `rotorlead` and gives its JSON. Words that begin with `@` are names in the folder.
fn rotorlead(folder: &Path, words: &[&str]) -> Result<Value, HostLate> {
    let json = folder.join("out.json").display().to_string();
    let word = |word: &&str| match word.strip_prefix('@') {
        Some(name) => folder.join(name).display().to_string(),
        None => (*word).to_owned(),
    };
    let all =
        ["rotorlead", words[0], "--json", &json].map(str::to_owned).into_iter().chain(words[1..].iter().map(word));
    let arguments = Arguments::try_parse_from(all).unwrap_or_else(|error| panic!("{error}"));
    if let Err(report) = arguments.run() {
        // What the command adds says how far it came.
        assert!(report.to_string().contains(&Refusal::NotInjecting.to_string()), "{report:?}");
        return Err(HostLate);
    }
    Ok(serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap())
}

/// One of the paper's levels, in an emulator of its own.
fn level_through_the_image((nominal, ..): (f64, f64, f64)) -> Result<(), HostLate> {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    let point = |&(nominal, gain, pole): &(f64, f64, f64)| {
        format!("[[point]]\nnominal = {nominal}\ngain = {gain}\ntime_constant_s = {}\n", 1.0 / pole)
    };
    write("model.toml", format!("format = 1\n{}", TABLE_1.iter().map(point).collect::<String>()));
    write(
        "plan.toml",
        format!(
            "format = 1\nname = \"paper\"\nseed = 1\nesc_frame_hz = 600\n\
             [[record]]\nnominal = {nominal}\nexcitation = \"multisine\"\nlines = 225\namplitude = 0.05\nperiods = 2\n\
             [[record]]\nnominal = {nominal}\nexcitation = \"square\"\nhalf_period_s = 2.5\namplitude = 0.05\n\
             periods = 1\nrole = \"validate\"\n"
        ),
    );

    let (_emulator, address) = Machine::serve(&image());
    let device = ["device", "--port", &address, "--timeout", "30"];
    // The emulated time runs ahead of the host. With the first settings that somebody chooses there may be pulses. A bandwidth is one number
    // without the slew limit.
    rotorlead(
        folder.path(),
        &[
            &device[..],
            &["set", "output.protocol", "standard_pwm", "motor.*.hold_ms", "1000", "output.slew_per_s", "0"],
        ]
        .concat(),
    )?;
    let words = [&device[..], &["inject", "--compensate", "true"]].concat();
    let files = ["--model", "@model.toml", "--plan", "@plan.toml", "--out", "@pil"];
    let start = std::time::Instant::now();
    let injected = rotorlead(folder.path(), &[&words[..], &files].concat())?;
    // Every output is compared with the library's own path on the host.
    let samples = (MULTISINE_S + SQUARE_S) * LOOP_RATE_HZ + 2 * LEAD_IN;
    assert_eq!(injected["samples"], samples, "{injected}");
    assert_eq!(injected["different"], 0, "{injected}");
    println!("{samples} samples equal, {:.0} a second", samples as f64 / start.elapsed().as_secs_f64());

    let words = ["bandwidth", "--model", "@model.toml", "--compensator", "@pil/compensator.toml"];
    let options = ["--sampled", "--esc-frame", "600", "--records", "@pil"];
    let bandwidths = rotorlead(folder.path(), &[&words[..], &options].concat())?;
    let of_level = |list: &Value| -> Value {
        let points: Vec<&Value> = list.as_array().unwrap().iter().filter(|point| point["nominal"] == nominal).collect();
        assert_eq!(points.len(), 1, "{bandwidths}");
        points[0].clone()
    };
    let number = |value: &Value, key: &str| value[key].as_f64().unwrap();
    let predicted = number(&of_level(&bandwidths["points"]), "compensated_rad_s");
    let found = number(&of_level(&bandwidths["measured"]), "bandwidth_rad_s");
    println!("{nominal}: {predicted:.2} rad/s predicted, {found:.2} found");
    assert!((found / predicted - 1.0).abs() < 0.02, "{bandwidths}");
    Ok(())
}

fn paper_through_the_image(levels: &[(f64, f64, f64)]) {
    for level in levels {
        keeping_up(|| level_through_the_image(*level));
    }
}

/// Where the gain is highest.
#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_papers_highest_level_through_the_image_is_the_hosts_bit_for_bit_with_the_predicted_bandwidth() {
    paper_through_the_image(&TABLE_1[5..]);
}

#[test]
#[ignore = "more than a minute for each level: cargo xtask statistics"]
fn every_level_of_the_paper_through_the_image_is_the_hosts_bit_for_bit_with_the_predicted_bandwidth() {
    paper_through_the_image(&TABLE_1);
}
