//! The response of a motor in flight by the parameters of its lag.

use super::series::Series;

/// Knots of the table of decays over the range of levels. Chosen: a time constant bends by 1e-5 of itself between two of them.
const KNOTS: usize = 256;
/// Levels of the table. A supply above its mean brings a level over one.
const LEVELS: (f64, f64) = (0.01, 1.5);

/// Parameters of the lag: how many there are.
pub(super) const LAG_PARAMETERS: usize = 4;
/// Steps by which the derivatives are taken, of the parameters in their order. Chosen: a thousandth of what each may be, far above rounding.
pub(super) const DIFFERENCES: [f64; LAG_PARAMETERS] = [1e-3, 1e-2, 1e-2, 2e-2];

/// The lag in units of the command: `tau(w) dw/dt = v(t - delay) - w`, with `ln tau = level + slope x + curve x^2` and
/// `x = ln(w / center)`.
///
/// Any motor `dy/dt = a v - h(y)` is of this kind, with `w = h(y) / a` and `tau = 1 / h'(y)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LagShape {
    /// Logarithm of the time constant in seconds at the center.
    pub(super) level: f64,
    /// Its change with the logarithm of the command.
    pub(super) slope: f64,
    /// The bend of that.
    pub(super) curve: f64,
    /// Dead time, ms.
    pub(super) delay_ms: f64,
}

impl LagShape {
    pub(super) fn from_slice(values: &[f64]) -> Self {
        Self { level: values[0], slope: values[1], curve: values[2], delay_ms: values[3] }
    }

    pub(super) fn to_array(self) -> [f64; LAG_PARAMETERS] {
        [self.level, self.slope, self.curve, self.delay_ms]
    }

    /// Time constant at a level, s.
    pub(super) fn time_constant_s(&self, level: f64, center: f64) -> f64 {
        let x = (level / center).ln();
        (self.level + x * (self.slope + x * self.curve)).exp()
    }
}

/// Levels `w` of the rows for an `input` of them.
pub(super) fn levels(series: &Series, input: &[f64], shape: &LagShape) -> Vec<f64> {
    let spacing = (LEVELS.1 - LEVELS.0) / (KNOTS - 1) as f64;
    // Shares by which the level nears the input in a usual interval.
    let shares: Vec<f64> = (0..KNOTS)
        .map(|knot| {
            let level = LEVELS.0 + spacing * knot as f64;
            -(-series.step_s / shape.time_constant_s(level, series.center)).exp_m1()
        })
        .collect();
    let share = |level: f64| {
        let place = ((level - LEVELS.0) / spacing).clamp(0.0, (KNOTS - 2) as f64);
        let knot = place as usize;
        shares[knot] + (place - knot as f64) * (shares[knot + 1] - shares[knot])
    };
    let mut means = Vec::with_capacity(input.len());
    series.delayed_means(input, 1e-3 * shape.delay_ms, &mut means);
    let mut starts = series.starts.iter().peekable();
    let mut level = input[0];
    let usual = 0.02 * series.step_s;
    means
        .iter()
        .enumerate()
        .map(|(row, mean)| {
            if starts.next_if(|start| **start == row).is_some() {
                level = input[row];
                return level;
            }
            let interval_s = series.time_s[row] - series.time_s[row - 1];
            let part = match (interval_s - series.step_s).abs() <= usual {
                true => share(level),
                false => 1.0 - (1.0 - share(level)).powf(interval_s / series.step_s),
            };
            level += (mean - level) * part;
            level
        })
        .collect()
}

/// Functions whose sum is the speed, of each sample: powers of the level's distance from the center, that distance times the time, for a
/// gain that drifts, and the terms of the vehicle.
pub(super) fn basis(series: &Series, input: &[f64], shape: &LagShape) -> Vec<Vec<f64>> {
    let (spread, degree) = (series.spread(), series.degree());
    let levels = levels(series, input, shape);
    let (first_s, lasts_s) = (series.time_s[0], series.time_s[series.time_s.len() - 1] - series.time_s[0]);
    let mut basis = vec![Vec::with_capacity(series.samples.len()); degree + 2];
    for sample in &series.samples {
        let count = sample.rows.len() as f64;
        let mut sums = [0.0; 4];
        for level in &levels[sample.rows.clone()] {
            let z = (level - series.center) / spread;
            let mut power = 1.0;
            for sum in sums.iter_mut().take(degree + 1) {
                *sum += power / count;
                power *= z;
            }
        }
        for (values, sum) in basis.iter_mut().zip(sums).take(degree + 1) {
            values.push(sum);
        }
        let part = (series.time_s[sample.rows.start] - first_s) / lasts_s - 0.5;
        basis[degree + 1].push(sums[1] * part);
    }
    basis.extend(series.vehicle.iter().cloned());
    basis
}

/// The change of the speed with the level at a level, by the coefficients of [`basis`].
pub(super) fn gain(series: &Series, coefficients: &[f64], level: f64) -> f64 {
    let spread = series.spread();
    let z = (level - series.center) / spread;
    let degree = series.degree();
    (1..=degree).map(|power| coefficients[power] * power as f64 * z.powi(power as i32 - 1)).sum::<f64>() / spread
}
