//! One report of every command that writes any, from experiments that are small.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Two levels, to which a simulated actuator may add what its first model has not got.
pub const MODEL: &str = "format = 1\n[[point]]\nnominal = 0.5\ngain = 10.1718\ntime_constant_s = 0.1076554\n\
                         [[point]]\nnominal = 0.65\ngain = 16.1063\ntime_constant_s = 0.0707839\n";
/// A slew limit, so that a diagnosis has something to find.
const EFFECT: &str = "[[effect]]\nkind = \"slew_limit\"\n[effect.parameters]\nrate_per_s = 0.6\n";

/// The static curve of a motor for steps through its range.
const STATIC_MAP: &str = "[static_map]\ncommand = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]\n\
                          response = [0.1, 0.6, 1.4, 2.4, 3.5, 4.8, 6.2, 7.8]\n";
const STAIRS: &str = "format = 1\nname = \"stairs\"\nseed = 1\nloop_rate_hz = 200\nsample_rate_hz = 200\n\
                      [noise]\nsigma_n = 0.02\n[[record]]\nnominal = 0.5\nexcitation = \"staircase\"\n\
                      levels = [0.3, 0.4, 0.5, 0.6, 0.7, 0.6, 0.5, 0.4, 0.3]\nhold_s = 2\n";

/// The paper's measured bandwidths at three levels, and a model of these.
const BANDWIDTHS: &str = "u_nom,uncompensated_rad_s,compensated_rad_s\n0.4,7.6139,10.5564\n0.5,11.7689,68.9652\n\
                          0.65,14.7953,97.1847\n";
const LOWEST: &str = "[[point]]\nnominal = 0.4\ngain = 9.9955\ntime_constant_s = 0.15934\n";

const HAMMER: &str = "format = 1\nname = \"hammer\"\ncommand = \"force_n\"\noutput = \"thrust_n\"\n\
                      [[record]]\nfile = \"blow.csv\"\nnominal = 0\nexcitation = \"free\"\n";

/// What is run, and the report that it writes, if any.
const RUNS: [(&str, Option<&str>); 17] = [
    ("simulate --model limited.toml --plan plan.toml --out stand --report simulate.html", Some("simulate")),
    ("report stand --out report.html", Some("report")),
    ("identify stand --out found.toml --report identify.html", Some("identify")),
    ("validate stand --model found.toml --report validate.html", Some("validate")),
    (
        "design --model model.toml --loop-rate 200 --omega-g 100 --out compensator.toml --report design.html",
        Some("design"),
    ),
    ("simulate --model model.toml --plan plan.toml --compensator compensator.toml --out faster", None),
    (
        "bandwidth --model model.toml --compensator compensator.toml --records stand --records faster \
         --report bandwidth.html",
        Some("bandwidth"),
    ),
    ("diagnose stand --model model.toml --report diagnose.html", Some("diagnose")),
    ("diagnose stand --redesign --report redesign.html", Some("redesign")),
    ("diagnose --bandwidths bandwidths.csv --model three.toml --report bandwidths.html", Some("bandwidths")),
    ("excite --band 0.1..30 --rate 200 --starts 1 --out period.csv --report excite.html", Some("excite")),
    ("identify --stand hammer --order 4 --top 150 --out stand.toml --report stand.html", Some("stand")),
    ("simulate --model curved.toml --plan stairs-plan.toml --out stairs", None),
    ("report stairs --out stairs.html", Some("stairs")),
    ("identify stairs --out stairs.toml --report stairs-identify.html", Some("stairs-identify")),
    ("vehicle --report vehicle.html", Some("vehicle")),
    ("demo --out demo --report demo.html", Some("demo")),
];

/// Writes reports of every kind into `folder`.
pub fn write(folder: &Path) -> Vec<PathBuf> {
    let put = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    put("plan.toml", &host_tests::stand_plan());
    put("model.toml", MODEL);
    put("limited.toml", &format!("{MODEL}{EFFECT}"));
    put("three.toml", &MODEL.replacen("[[point]]", &format!("{LOWEST}[[point]]"), 1));
    put("bandwidths.csv", BANDWIDTHS);
    put("curved.toml", &format!("{MODEL}{STATIC_MAP}"));
    put("stairs-plan.toml", STAIRS);
    fs::create_dir(folder.join("hammer")).unwrap();
    put("hammer/experiment.toml", HAMMER);
    put("hammer/blow.csv", &blow());
    let mut reports = Vec::new();
    for (arguments, report) in RUNS {
        run(folder, arguments);
        reports.extend(report.map(|name| folder.join(format!("{name}.html"))));
    }
    reports
}

/// Runs the program, which has to succeed.
pub fn run(folder: &Path, arguments: &str) {
    let output = Command::new(assert_cmd::cargo::cargo_bin("rotorlead"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A blow on a stand with modes at 40 and 110 Hz, 2 s at 2 kHz, with a ripple for noise.
fn blow() -> String {
    let mut csv = String::from("time_s,command,thrust_n\n");
    let steps = 100;
    let h = 1.0 / 2000.0 / f64::from(steps);
    let force = |t: f64| 20.0 * (-0.5 * ((t - 0.02) / 1e-3).powi(2)).exp();
    // Undamped angular frequency in rad/s, damping, share of the thrust; position and velocity.
    let modes = [(251.3_f64, 0.04, 0.7), (691.2, 0.025, 0.3)];
    let mut states = [(0.0, 0.0); 2];
    let mut seed = 1u64;
    for row in 0..4000 {
        let t = f64::from(row) / 2000.0;
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let ripple = 6e-3 * ((seed >> 33) as f64 / 2f64.powi(31) - 0.5);
        let thrust: f64 = modes.iter().zip(&states).map(|((.., share), (position, _))| share * position).sum();
        writeln!(csv, "{t},{},{}", force(t), thrust + ripple).unwrap();
        for step in 0..steps {
            let u = force(t + (f64::from(step) + 0.5) * h);
            for ((omega, damping, _), (position, velocity)) in modes.iter().zip(&mut states) {
                *velocity += h * (omega * omega * (u - *position) - 2.0 * damping * omega * *velocity);
                *position += h * *velocity;
            }
        }
    }
    csv
}
