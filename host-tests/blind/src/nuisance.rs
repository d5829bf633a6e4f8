//! What stands add to any record: forces that are none of the motor's, and stamps that are not as they should be. None of it is an
//! effect, and none may be named.

use std::f64::consts::TAU;

use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::excitation::{ROWS, ROWS_HZ};
use super::noise::Noise;
use super::rotor::rpm;

/// A sort of nuisance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sort {
    /// Hum of the mains with harmonics, far above that of the noise.
    MainsHum,
    /// The blades pass an arm of the stand: a line that moves with the speed.
    PropellerPassing,
    /// The load cell warms up or cools down, and its zero with it.
    ThermalDrift,
    /// The air of the room moves.
    Gusts,
    /// Rows that the logger has lost, one or several at a time.
    MissingRows,
    /// Rows that are even, with stamps that are not.
    StampJitter,
}

impl Sort {
    /// Those that are forces; the tool may refuse records whose stamps are uneven.
    pub const FORCES: [Self; 4] = [Self::MainsHum, Self::PropellerPassing, Self::ThermalDrift, Self::Gusts];
    /// All.
    pub const ALL: [Self; 6] =
        [Self::MainsHum, Self::PropellerPassing, Self::ThermalDrift, Self::Gusts, Self::MissingRows, Self::StampJitter];

    /// Its name in the truth.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::MainsHum => "mains_hum",
            Self::PropellerPassing => "propeller_passing",
            Self::ThermalDrift => "thermal_drift",
            Self::Gusts => "gusts",
            Self::MissingRows => "missing_rows",
            Self::StampJitter => "stamp_jitter",
        }
    }

    /// One of this sort, the same over all records of a case. Sizes are drawn so that every decade is as likely as any other.
    #[must_use]
    pub fn draw(self, rng: &mut ChaCha8Rng) -> Nuisance {
        let mut within = |low: f64, high: f64| low * (high / low).powf(rng.random_range(0.0..1.0));
        let values = match self {
            // Part of the swing, nothing: the mains are those of the noise.
            Self::MainsHum => [within(0.01, 0.05), 0.0],
            // Part of the thrust, blades.
            Self::PropellerPassing => [within(0.003, 0.03), if rng.random_bool(0.5) { 2.0 } else { 3.0 }],
            // Part of the swing in the end, time constant in seconds.
            Self::ThermalDrift => [within(0.01, 0.05), within(10.0, 100.0)],
            // Standard deviation as a part of the swing, corner in hertz.
            Self::Gusts => [within(0.01, 0.05), within(0.1, 2.0)],
            // Losses per second, most rows at a time.
            Self::MissingRows => [within(0.1, 1.0), within(1.0, 20.0).round()],
            // Seconds, nothing.
            Self::StampJitter => [within(10e-6, 200e-6), 0.0],
        };
        Nuisance { sort: self, values }
    }

    /// One of `first`, and in every second case another force.
    #[must_use]
    pub fn draw_some(first: Self, rng: &mut ChaCha8Rng) -> Vec<Nuisance> {
        let mut sorts = vec![first];
        if rng.random_bool(0.5) {
            let mut others: Vec<Self> = Self::FORCES.into_iter().filter(|sort| *sort != first).collect();
            others.shuffle(rng);
            sorts.push(others[0]);
        }
        sorts.into_iter().map(|sort| sort.draw(rng)).collect()
    }
}

/// A nuisance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nuisance {
    /// What it is.
    pub sort: Sort,
    /// Its numbers; what they mean is said where they are drawn.
    pub values: [f64; 2],
}

impl Nuisance {
    /// Adds its newtons to the rows of one record, whose rotor has the thrust `rotor_n` there, beside mains of `mains_hz`.
    pub fn add(&self, thrust_n: &mut [f64], rotor_n: &[f64], swing_n: f64, mains_hz: f64, rng: &mut ChaCha8Rng) {
        let [first, second] = self.values;
        let size = first * swing_n;
        let time_s = |row: usize| row as f64 / ROWS_HZ;
        match self.sort {
            Sort::MainsHum => {
                // A rectifier's second harmonic, and odd ones of the net.
                for harmonic in [1.0, 2.0, 3.0, 5.0] {
                    let phase: f64 = rng.random_range(0.0..TAU);
                    for (row, value) in thrust_n.iter_mut().enumerate() {
                        *value += size / harmonic * (TAU * harmonic * mains_hz * time_s(row) + phase).sin();
                    }
                }
            }
            Sort::PropellerPassing => {
                let mut phase: f64 = rng.random_range(0.0..TAU);
                for (value, rotor_n) in thrust_n.iter_mut().zip(rotor_n) {
                    *value += first * rotor_n * phase.sin();
                    phase += TAU * second * rpm(*rotor_n) / 60.0 / ROWS_HZ;
                }
            }
            Sort::ThermalDrift => {
                // Every record finds the cell warmer or colder than the one before left it.
                let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
                let in_the_end = sign * size * rng.random_range(0.5..1.0);
                let warmed = |time_s: f64| 1.0 - (-time_s / second).exp();
                for (row, value) in thrust_n.iter_mut().enumerate() {
                    *value += in_the_end * warmed(time_s(row)) / warmed(time_s(ROWS));
                }
            }
            Sort::Gusts => {
                let air = Noise { colored: vec![(size, second)], ..Noise::white(0.0) };
                for (value, gust) in thrust_n.iter_mut().zip(air.sample(ROWS, rng)) {
                    *value += gust;
                }
            }
            Sort::MissingRows | Sort::StampJitter => {}
        }
    }

    /// Changes the stamps of one record; a row without one is not in the file.
    pub fn restamp(&self, stamps_s: &mut [Option<f64>], rng: &mut ChaCha8Rng) {
        let [first, second] = self.values;
        match self.sort {
            Sort::MissingRows => {
                let mut left = 0;
                // The first row stays: a record begins where it begins.
                for stamp in &mut stamps_s[1..] {
                    if rng.random_bool(first / ROWS_HZ) {
                        left = rng.random_range(1..=second as usize);
                    }
                    if left > 0 {
                        (*stamp, left) = (None, left - 1);
                    }
                }
            }
            Sort::StampJitter => {
                for stamp in stamps_s.iter_mut().flatten() {
                    *stamp += rng.random_range(-first..first);
                }
            }
            Sort::MainsHum | Sort::PropellerPassing | Sort::ThermalDrift | Sort::Gusts => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    const REST_N: f64 = 3.0;

    fn added(sort: Sort, values: [f64; 2], seed: u64) -> Vec<f64> {
        let mut thrust_n = vec![0.0; ROWS];
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Nuisance { sort, values }.add(&mut thrust_n, &vec![REST_N; ROWS], 2.0, 50.0, &mut rng);
        thrust_n
    }

    fn stamps(sort: Sort, values: [f64; 2]) -> Vec<Option<f64>> {
        let mut stamps: Vec<Option<f64>> = (0..ROWS).map(|row| Some(row as f64 / ROWS_HZ)).collect();
        Nuisance { sort, values }.restamp(&mut stamps, &mut ChaCha8Rng::seed_from_u64(1));
        stamps
    }

    /// Size of a line.
    fn line(values: &[f64], hz: f64) -> f64 {
        let (mut re, mut im) = (0.0, 0.0);
        for (row, value) in values.iter().enumerate() {
            let (sin, cos) = (TAU * hz * row as f64 / ROWS_HZ).sin_cos();
            (re, im) = (re + value * cos, im + value * sin);
        }
        2.0 * f64::hypot(re, im) / values.len() as f64
    }

    #[test]
    fn hum_has_its_lines_and_no_others() {
        let hum = added(Sort::MainsHum, [0.02, 0.0], 1);
        for (hz, size) in [(50.0, 0.04), (100.0, 0.02), (150.0, 0.04 / 3.0), (200.0, 0.0), (250.0, 0.008)] {
            assert!((line(&hum, hz) - size).abs() < 1e-9, "{hz}");
        }
    }

    #[test]
    fn blades_pass_as_often_as_the_rotor_turns_times_their_number() {
        // 3 N at 6000 rpm: 100 revolutions per second.
        let passing = added(Sort::PropellerPassing, [0.01, 3.0], 1);
        assert!((line(&passing, 300.0) - 0.03).abs() < 1e-6 && line(&passing, 200.0) < 1e-6);
    }

    #[test]
    fn a_cell_drifts_along_its_exponential_and_not_alike_in_every_record() {
        let [one, other] = [1, 2].map(|seed| added(Sort::ThermalDrift, [0.05, 20.0], seed));
        let warmed = |time_s: f64| 1.0 - f64::exp(-time_s / 20.0);
        assert_eq!(one[0], 0.0);
        assert!((one[15_000] / one[29_999] - warmed(15.0) / warmed(29.999)).abs() < 1e-9);
        assert!((0.05..=0.1).contains(&one[29_999].abs()) && one[29_999] != other[29_999]);
    }

    #[test]
    fn gusts_have_their_size_and_are_slow() {
        let gusts = added(Sort::Gusts, [0.02, 1.0], 3);
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
        // 30 s have some hundred independent values of this corner.
        assert!(((square(&mut gusts.iter().copied()) / ROWS as f64).sqrt() / 0.04 - 1.0).abs() < 0.2);
        let change = square(&mut gusts.windows(2).map(|pair| pair[1] - pair[0])) / square(&mut gusts.iter().copied());
        // 2 (1 - e^(-w / rate)).
        assert!((change / (2.0 * TAU / ROWS_HZ) - 1.0).abs() < 0.2, "{change}");
    }

    #[test]
    fn as_many_rows_are_missing_as_are_lost_at_a_time() {
        let stamps = stamps(Sort::MissingRows, [1.0, 1.0]);
        let missing = stamps.iter().filter(|stamp| stamp.is_none()).count();
        // 30 of them, give or take the root.
        assert!((15..=45).contains(&missing) && stamps[0] == Some(0.0), "{missing}");
    }

    #[test]
    fn stamps_are_off_by_as_much_as_they_may_be() {
        let stamps = stamps(Sort::StampJitter, [1e-4, 0.0]);
        let off: Vec<f64> =
            stamps.iter().enumerate().map(|(row, at)| (at.unwrap() - row as f64 / ROWS_HZ).abs()).collect();
        let largest = off.iter().fold(0.0_f64, |largest, off| largest.max(*off));
        assert!((0.99e-4..=1.0001e-4).contains(&largest), "{largest}");
    }

    #[test]
    fn a_force_is_none_of_the_stamps_and_the_other_way_round() {
        for sort in Sort::ALL {
            let mut rng = ChaCha8Rng::seed_from_u64(4);
            let nuisance = sort.draw(&mut rng);
            let adds = added(sort, nuisance.values, 4).iter().any(|value| *value != 0.0);
            let restamps = stamps(sort, [nuisance.values[0], nuisance.values[1]]) != stamps(Sort::Gusts, [0.0; 2]);
            assert_eq!((adds, restamps), (Sort::FORCES.contains(&sort), !Sort::FORCES.contains(&sort)), "{sort:?}");
        }
    }
}
