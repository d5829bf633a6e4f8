//! Staircases of motors whose physics is known, written as a log and read like one.

use std::fmt::Write as _;
use std::path::Path;

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};
use rotorlead_records::import::{ImportOptions, import_bytes};
use rotorlead_records::shared_data::data;
use rotorlead_records::{Excitation, Experiment};

/// Steps of the integration for each row.
const STEPS_PER_ROW: usize = 20;

/// The response of a level, 0..1, to its command.
pub type Map = fn(f64) -> f64;

/// A motor with what is before and behind it.
pub struct Stand {
    pub levels: &'static [f64],
    pub hold_s: f64,
    pub rate_hz: f64,
    /// Time constants of the speed, up and down, seconds.
    pub tau_s: [f64; 2],
    /// Speed that a command leads to.
    pub map: Map,
    /// Fastest change of the command, duty/s.
    pub ramp_per_s: f64,
    /// The response is thrust, so many newtons at speed 1, and goes with the square of the speed.
    pub thrust_n: Option<f64>,
    /// The sensor takes means over so long, and then has a time constant, seconds.
    pub mean_s: f64,
    pub filter_s: f64,
    /// Standard deviation of a reading.
    pub noise: f64,
    /// Readings are whole multiples of it, where it is not zero; and each stands in so many rows.
    pub count: f64,
    pub rows_per_reading: usize,
    /// The reading repeats its last value while the command is zero.
    pub freezes: bool,
    /// Share by which the speed falls within 10 s, for good.
    pub drift: f64,
}

pub const EQUAL_STEPS: &[f64] = &[0.3, 0.45, 0.6, 0.75, 0.6, 0.45, 0.3, 0.45, 0.6, 0.45, 0.3];
pub const SEVERAL_STEPS: &[f64] = &[0.2, 0.8, 0.2, 0.35, 0.5, 0.65, 0.5, 0.8, 0.35, 0.2, 0.65, 0.3];

impl Default for Stand {
    fn default() -> Self {
        Self {
            levels: SEVERAL_STEPS,
            hold_s: 1.5,
            rate_hz: 250.0,
            tau_s: [0.05; 2],
            map: f64::sqrt,
            ramp_per_s: f64::INFINITY,
            thrust_n: None,
            mean_s: 0.0,
            filter_s: 0.0,
            noise: 0.001,
            count: 0.0,
            rows_per_reading: 1,
            freezes: false,
            drift: 0.0,
        }
    }
}

impl Stand {
    pub fn log(&self, seed: u64) -> Experiment {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let dt = 1.0 / (self.rate_hz * STEPS_PER_ROW as f64);
        let rows_per_level = (self.hold_s * self.rate_hz) as usize;
        let respond = |speed: f64| self.thrust_n.map_or(speed, |full| full * speed * speed);
        let mut passed = self.levels[0];
        let mut speed = (self.map)(passed);
        let means = ((self.mean_s / dt) as usize).max(1);
        let (mut past, mut filtered) = (vec![respond(speed); means], respond(speed));
        let mut sum: f64 = past.iter().sum();
        let mut reading = f64::NAN;
        let mut text =
            String::from(if self.thrust_n.is_some() { "time_s,command,thrust_n\n" } else { "time_s,command,rpm\n" });
        for row in 0..rows_per_level * self.levels.len() {
            let command = self.levels[row / rows_per_level];
            let time_s = row as f64 / self.rate_hz;
            let noise: f64 = StandardNormal.sample(&mut rng);
            if !(self.freezes && command == 0.0) || reading.is_nan() {
                if row % self.rows_per_reading == 0 {
                    reading = filtered + self.noise * noise;
                }
                if self.count > 0.0 {
                    reading = (reading / self.count).round() * self.count;
                }
            }
            // A speed of 1 are 25 000 rpm.
            let scale = if self.thrust_n.is_some() { 1.0 } else { 25_000.0 };
            writeln!(
                text,
                "{time_s:.4},{command},{:.6}",
                scale * reading * (1.0 - self.drift * (1.0 - (-time_s / 10.0).exp()))
            )
            .unwrap();
            for step in 0..STEPS_PER_ROW {
                let most = self.ramp_per_s * dt;
                passed += (command - passed).clamp(-most, most);
                let way = (self.map)(passed) - speed;
                speed += way * dt / self.tau_s[usize::from(way < 0.0)];
                let place = (row * STEPS_PER_ROW + step) % means;
                sum += respond(speed) - past[place];
                past[place] = respond(speed);
                let mean = sum / means as f64;
                filtered = if self.filter_s > 0.0 { filtered + (mean - filtered) * dt / self.filter_s } else { mean };
            }
        }
        read(text.as_bytes())
    }
}

fn read(log: &[u8]) -> Experiment {
    let options = ImportOptions {
        excitation: Some(Excitation::Staircase),
        columns: vec!["command=command:duty".parse().unwrap()],
        ..ImportOptions::default()
    };
    import_bytes(Path::new("log.csv"), log, &options).unwrap().experiment
}

/// A log beside the workspace; `None` where it is not there.
pub fn case(name: &str) -> Option<Experiment> {
    Some(read(&std::fs::read(data(&format!("cases/{name}/log.csv"))?).unwrap()))
}
