//! What repeats of an experiment show of the estimates: how often intervals hold the truth, how far the estimates spread, and
//! where their mean is.
//!
//! A few hundred repeats say little of one parameter. [`Pooled`] says it of all parameters of all cases together. Those of one
//! repeat depend on each other: what is summed over them is therefore one number per repeat, whose own scatter over the
//! repeats is the error of its mean.

use nalgebra::DMatrix;
use rotorlead_identify::estimate::Estimate;

/// An estimate and its 95 % interval.
pub type Found = (Estimate, (f64, f64));

/// Repeats of one case.
#[derive(Clone, Debug)]
pub struct Tally {
    /// The case, in words.
    pub name: String,
    truth: Vec<f64>,
    bound: Vec<f64>,
    /// Repeats without a model.
    pub failed: u64,
    count: f64,
    covered: Vec<f64>,
    /// Sums of the errors over their bounds, and of the products of two.
    sum: Vec<f64>,
    products: DMatrix<f64>,
    /// Sums over the repeats of the number of intervals that hold the truth, and of its square.
    held: [f64; 2],
    /// The same of the squares of the errors over their bounds.
    size: [f64; 2],
}

/// What the repeats show of one parameter.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// True value.
    pub truth: f64,
    /// Intervals that hold it, percent.
    pub coverage: f64,
    /// Standard deviation of the estimates over the Cramer-Rao bound.
    pub spread_over_bound: f64,
    /// Mean error over the standard deviation.
    pub bias_over_std: f64,
}

impl Tally {
    /// None yet, of parameters with these true values and bounds of their standard deviations.
    pub fn new(name: String, truth: Vec<f64>, bound: Vec<f64>) -> Self {
        let n = truth.len();
        Self {
            name,
            truth,
            bound,
            failed: 0,
            count: 0.0,
            covered: vec![0.0; n],
            sum: vec![0.0; n],
            products: DMatrix::zeros(n, n),
            held: [0.0; 2],
            size: [0.0; 2],
        }
    }

    /// One repeat; `None` where it has no model.
    pub fn add(&mut self, found: Option<Vec<Found>>) {
        let Some(found) = found else {
            self.failed += 1;
            return;
        };
        let n = self.truth.len();
        assert_eq!(found.len(), n);
        self.count += 1.0;
        let error: Vec<f64> = (0..n).map(|j| (found[j].0.value - self.truth[j]) / self.bound[j]).collect();
        let (mut held, mut size) = (0.0, 0.0);
        for (j, (_, (low, high))) in found.iter().enumerate() {
            let covers = f64::from(u8::from((*low..=*high).contains(&self.truth[j])));
            self.covered[j] += covers;
            held += covers;
            self.sum[j] += error[j];
            size += error[j] * error[j];
            for (i, other) in error.iter().enumerate() {
                self.products[(i, j)] += other * error[j];
            }
        }
        for (sums, value) in [(&mut self.held, held), (&mut self.size, size)] {
            sums[0] += value;
            sums[1] += value * value;
        }
    }

    fn std(&self, j: usize) -> f64 {
        (self.products[(j, j)] / self.count - (self.sum[j] / self.count).powi(2)).sqrt()
    }

    /// By parameter.
    pub fn shown(&self) -> Vec<Shown> {
        let of = |j: usize| Shown {
            truth: self.truth[j],
            coverage: 100.0 * self.covered[j] / self.count,
            spread_over_bound: self.std(j),
            bias_over_std: self.sum[j] / self.count / self.std(j),
        };
        (0..self.truth.len()).map(of).collect()
    }

    /// A line for each parameter.
    pub fn print(&self) {
        println!("{} failed {}", self.name, self.failed);
        for shown in self.shown() {
            println!(
                "    {:>7}: coverage {:6.2} spread/bound {:.4} bias/std {:+.3}",
                shown.truth, shown.coverage, shown.spread_over_bound, shown.bias_over_std
            );
        }
    }

    fn correlation(&self, i: usize, j: usize) -> f64 {
        (self.products[(i, j)] / self.count - self.sum[i] * self.sum[j] / self.count.powi(2))
            / self.std(i)
            / self.std(j)
    }
}

/// A mean, and its own standard error.
#[derive(Clone, Copy, Debug)]
pub struct Mean {
    value: f64,
    std: f64,
}

/// All parameters of several cases together.
#[derive(Clone, Copy, Debug)]
pub struct Pooled {
    /// Share of the intervals that hold the truth, percent.
    pub coverage: Mean,
    /// Mean square of the errors over their bounds.
    pub spread_square: Mean,
    /// Mean square of the mean errors over their standard deviations, freed of what chance puts there, with the error that it
    /// has where each is a tenth.
    pub bias_square: Mean,
}

/// The claims: intervals of 95 % hold the truth in 94 to 96 % ...
const COVERAGE: (f64, f64) = (94.0, 96.0);
/// ... their spread is at most this many times the bound ...
pub const SPREAD: f64 = 1.05;
/// ... and their bias less than this many standard deviations.
pub const BIAS: f64 = 0.1;

impl Pooled {
    /// Of independent cases.
    pub fn from_tallies(tallies: &[Tally]) -> Self {
        let parameters: f64 = tallies.iter().map(|t| t.truth.len() as f64).sum();
        let mean = |sums: fn(&Tally) -> [f64; 2], scale: f64| {
            let (mut value, mut variance) = (0.0, 0.0);
            for tally in tallies {
                let [sum, squares] = sums(tally);
                let mean = sum / tally.count;
                value += mean;
                variance += (squares / tally.count - mean * mean) / tally.count;
            }
            Mean { value: scale * value / parameters, std: scale * variance.sqrt() / parameters }
        };
        let (mut bias, mut variance) = (0.0, 0.0);
        for tally in tallies {
            let n = tally.truth.len();
            bias += tally.shown().iter().map(|s| s.bias_over_std.powi(2) - tally.count.recip()).sum::<f64>();
            let pairs = || (0..n).flat_map(|i| (0..n).map(move |j| tally.correlation(i, j)));
            variance += 2.0 * pairs().map(|c| c * c).sum::<f64>() / tally.count.powi(2)
                + 4.0 * BIAS * BIAS * pairs().map(f64::abs).sum::<f64>() / tally.count;
        }
        Self {
            coverage: mean(|t| t.held, 100.0),
            spread_square: mean(|t| t.size, 1.0),
            bias_square: Mean { value: bias / parameters, std: variance.sqrt() / parameters },
        }
    }

    /// Fails an estimator that just keeps all claims less than once in 1000: three means at 3.5 of their standard errors, and
    /// each parameter by itself at 5.
    pub fn check(tallies: &[Tally]) {
        const REACH: f64 = 3.5;
        const REACH_OF_ONE: f64 = 5.0;
        let pooled = Self::from_tallies(tallies);
        println!("{pooled:?}");
        let Self { coverage, spread_square, bias_square } = pooled;
        assert!(coverage.value > COVERAGE.0 - REACH * coverage.std, "{pooled:?}");
        assert!(coverage.value < COVERAGE.1 + REACH * coverage.std, "{pooled:?}");
        let most = SPREAD * SPREAD * (1.0 + BIAS * BIAS);
        assert!(spread_square.value < most + REACH * spread_square.std, "{pooled:?}");
        assert!(bias_square.value < BIAS * BIAS + REACH * bias_square.std, "{pooled:?}");
        for tally in tallies {
            assert_eq!(tally.failed, 0, "{}", tally.name);
            for shown in tally.shown() {
                let by_chance = 100.0 * REACH_OF_ONE * (0.06 * 0.94 / tally.count).sqrt();
                assert!((shown.coverage - 95.0).abs() < 1.0 + by_chance, "{} {shown:?}", tally.name);
                let most = SPREAD * (1.0 + REACH_OF_ONE / (2.0 * tally.count).sqrt());
                assert!(shown.spread_over_bound < most, "{} {shown:?}", tally.name);
                let most = BIAS + REACH_OF_ONE / tally.count.sqrt();
                assert!(shown.bias_over_std.abs() < most, "{} {shown:?}", tally.name);
            }
        }
    }

    /// Decides each claim for each parameter: for repeats so many that chance is far below a percent.
    pub fn decide(tallies: &[Tally], most_spread: f64, most_bias: f64) {
        let all: Vec<Shown> = tallies.iter().flat_map(Tally::shown).collect();
        let largest = |of: fn(&Shown) -> f64| all.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let (least, most) = (-largest(|s| -s.coverage), largest(|s| s.coverage));
        let (spread, bias) = (largest(|s| s.spread_over_bound), largest(|s| s.bias_over_std.abs()));
        let failed: u64 = tallies.iter().map(|tally| tally.failed).sum();
        println!("coverage {least:.2} to {most:.2} %, spread/bound {spread:.4}, bias/std {bias:.3}, failed {failed}");
        println!("{:?}", Self::from_tallies(tallies));
        // Of few repeats chance takes its share.
        let fewest = tallies.iter().map(|tally| tally.count).fold(f64::INFINITY, f64::min);
        let chance = if fewest < 15_000.0 { 3.5 / fewest.sqrt() } else { 0.0 };
        assert!(least >= COVERAGE.0 - 24.0 * chance && most <= COVERAGE.1 + 24.0 * chance);
        assert!(spread <= most_spread + 0.75 * chance && bias < most_bias + chance && failed == 0);
    }
}

/// Runs `study` on all cases whose name contains the variable `CASE`, on two threads, and prints each.
pub fn study_all<C: Sync + std::fmt::Debug>(cases: &[C], study: impl Fn(&C) -> Tally + Sync) -> Vec<Tally> {
    let only = std::env::var("CASE").unwrap_or_default();
    let cases: Vec<&C> = cases.iter().filter(|case| format!("{case:?}").contains(&only)).collect();
    let (done, next) = (std::sync::Mutex::new(Vec::new()), std::sync::atomic::AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed)) {
                    let tally = study(case);
                    tally.print();
                    done.lock().unwrap().push(tally);
                }
            });
        }
    });
    done.into_inner().unwrap()
}

/// Where the seeds of a case begin: no two cases share any, else what is pooled would be one draw many times.
pub fn first_seed(case: &impl std::fmt::Debug) -> u64 {
    // FNV-1a.
    let hash = format!("{case:?}")
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    hash >> 1
}

/// The variable `REPEATS`, or `otherwise`.
pub fn repeats(otherwise: u64) -> u64 {
    std::env::var("REPEATS").ok().and_then(|repeats| repeats.parse().ok()).unwrap_or(otherwise)
}
