//! The rows of a log as they are compared: means of rows that say the same.
//!
//! A search goes over its rows ten thousand times. Of a level that has settled many rows say one thing, and so do rows that follow
//! each other much faster than the motor moves. Each block of them is its mean at its mean time, which a smooth response passes
//! through but for the second order; how many rows it stands for, and how they scatter about it, keeps sums over all rows exact to
//! that order:
//!
//! ```text
//! sum over a block of (y - model)^2 = rows (mean y - model)^2 + scatter
//! ```
//!
//! Where the response moves, it does so within a block too: its rows scatter about a line as steep as the way between the
//! neighboring blocks.

use std::ops::Range;

/// Blocks of rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks {
    /// The rows of each, counted from the first that is compared.
    rows: Vec<Vec<usize>>,
    /// Ranges of blocks over which the response moves without a corner.
    moving: Vec<Range<usize>>,
}

impl Blocks {
    /// Adds rows in blocks of so many, and gives the places of the blocks.
    pub fn add(&mut self, rows: &[usize], width: usize) -> Range<usize> {
        let from = self.rows.len();
        self.rows.extend(rows.chunks(width.max(1)).map(<[usize]>::to_vec));
        from..self.rows.len()
    }

    /// The same of rows over which the response moves.
    pub fn add_moving(&mut self, rows: &[usize], width: usize) -> Range<usize> {
        let blocks = self.add(rows, width);
        self.moving.push(blocks.clone());
        blocks
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

    /// How many rows each stands for, and the sum of squares of these about their mean, or about their line where they move.
    pub fn scatter(&self, values: &[f64], time_s: &[f64]) -> Vec<(f64, f64)> {
        let (means, times) = (self.means(values), self.means(time_s));
        let mut slopes = vec![0.0; self.len()];
        for moving in &self.moving {
            for block in moving.clone() {
                let (from, to) = (block.saturating_sub(1).max(moving.start), (block + 1).min(moving.end - 1));
                if from < to {
                    slopes[block] = (means[to] - means[from]) / (times[to] - times[from]);
                }
            }
        }
        let of_block = |(block, rows): (usize, &Vec<usize>)| {
            let off = |row: &usize| values[*row] - means[block] - slopes[block] * (time_s[*row] - times[block]);
            (rows.len() as f64, rows.iter().map(|row| off(row).powi(2)).sum())
        };
        self.rows.iter().enumerate().map(of_block).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_response_that_moves_along_a_line_does_not_scatter_and_noise_about_it_does() {
        let time_s: Vec<f64> = (0..12).map(f64::from).collect();
        let noise = |row: usize| if row.is_multiple_of(2) { 0.5 } else { -0.5 };
        let values: Vec<f64> = (0..12).map(|row| 3.0 * row as f64 + noise(row)).collect();
        let rows: Vec<usize> = (0..12).collect();
        let mut blocks = Blocks::default();
        assert_eq!(blocks.add_moving(&rows[..8], 4), 0..2);
        assert_eq!(blocks.add(&rows[8..], 4), 2..3);
        let scatter = blocks.scatter(&values, &time_s);
        assert!(scatter[..2].iter().all(|(rows, sum)| *rows == 4.0 && (sum - 1.0).abs() < 1e-9), "{scatter:?}");
        // Those of a level do so about their mean: 4, 2, -2 and -4 off it.
        assert!((scatter[2].1 - 40.0).abs() < 1e-9, "{scatter:?}");
    }
}
