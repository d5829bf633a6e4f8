//! The rows of a log as they are compared: means of rows that say the same.
//!
//! A search goes over its rows ten thousand times. Of a level that has settled many rows say one thing, and so do rows that follow
//! each other much faster than the motor moves. Each block of them is its mean at its mean time, which a smooth response passes
//! through but for the second order; how many rows it stands for, and how they scatter about it, keeps sums over all rows exact:
//!
//! ```text
//! sum over a block of (y - model)^2 = rows (mean y - model)^2 + scatter
//! ```

use rotorlead_numerics::sample::mean;

/// Blocks of rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks {
    /// The rows of each, counted from the first that is compared.
    rows: Vec<Vec<usize>>,
}

impl Blocks {
    /// Adds rows in blocks of so many, and gives the places of the blocks.
    pub fn add(&mut self, rows: &[usize], width: usize) -> std::ops::Range<usize> {
        let from = self.rows.len();
        self.rows.extend(rows.chunks(width.max(1)).map(<[usize]>::to_vec));
        from..self.rows.len()
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// The means of a column of all rows.
    pub fn means(&self, values: &[f64]) -> Vec<f64> {
        let of_block = |rows: &Vec<usize>| match rows[..] {
            [row] => values[row],
            _ => rows.iter().map(|&row| values[row]).sum::<f64>() / rows.len() as f64,
        };
        self.rows.iter().map(of_block).collect()
    }

    /// How many rows each stands for, and the sum of squares of these about their mean.
    pub fn scatter(&self, values: &[f64]) -> Vec<(f64, f64)> {
        let of_block = |rows: &Vec<usize>| {
            let values: Vec<f64> = rows.iter().map(|&row| values[row]).collect();
            let mean = mean(&values);
            (values.len() as f64, values.iter().map(|value| (value - mean).powi(2)).sum())
        };
        self.rows.iter().map(of_block).collect()
    }
}
