//! Normal equations of a weighted least squares problem with many more rows than unknowns.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Rows added at once: so many fit a core's cache.
const AT_ONCE: usize = 8;
/// Columns of a task.
const COLUMNS: usize = 32;

/// AᵀA and Aᵀb.
pub(crate) struct Normal {
    /// The lower triangle alone.
    square: DMatrix<f64>,
    right: DVector<f64>,
}

impl Normal {
    pub(crate) fn new(unknowns: usize) -> Self {
        Self {
            square: DMatrix::zeros(unknowns, unknowns),
            right: DVector::zeros(unknowns),
        }
    }

    /// Adds rows, each with its value. Cost: half the square of the unknowns for each, on all cores; the sums do not depend on their number.
    pub(crate) fn add<'a>(&mut self, rows: impl Iterator<Item = (&'a [f64], f64)>) {
        let rows: Vec<(&[f64], f64)> = rows.collect();
        let count = self.right.len();
        for (row, value) in &rows {
            for (sum, term) in self.right.iter_mut().zip(*row) {
                *sum += term * value;
            }
        }
        (self
            .square
            .as_mut_slice()
            .par_chunks_mut((COLUMNS * count).max(1))
            .enumerate())
        .for_each(|(task, columns)| {
            for some in rows.chunks(AT_ONCE) {
                for (number, column) in columns.chunks_exact_mut(count).enumerate() {
                    let first = task * COLUMNS + number;
                    add_to(&mut column[first..], some, first);
                }
            }
        });
    }

    /// Sum of the squares of all terms.
    pub(crate) fn trace(&self) -> f64 {
        self.square.trace()
    }

    /// Adds to the weight of every unknown's own size.
    pub(crate) fn add_ridge(&mut self, weight: f64) {
        for i in 0..self.right.len() {
            self.square[(i, i)] += weight;
        }
    }

    /// The unknowns; `None` where the rows do not decide them.
    pub(crate) fn solve(&self) -> Option<DVector<f64>> {
        Some(self.square.clone().cholesky()?.solve(&self.right))
    }
}

/// The part of some rows in a column from its diagonal on.
fn add_to(column: &mut [f64], rows: &[(&[f64], f64)], first: usize) {
    if let Ok(rows) = <&[(&[f64], f64); AT_ONCE]>::try_from(rows) {
        let rows = rows.map(|(row, _)| &row[first..]);
        let own = rows.map(|row| row[0]);
        let rows = rows.map(|row| &row[..column.len()]);
        for (i, sum) in column.iter_mut().enumerate() {
            let mut more = 0.0;
            for k in 0..AT_ONCE {
                more += own[k] * rows[k][i];
            }
            *sum += more;
        }
        return;
    }
    for (row, _) in rows {
        let own = row[first];
        for (sum, term) in column.iter_mut().zip(&row[first..]) {
            *sum += own * term;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the product of the whole matrix, for numbers of rows and unknowns that no block divides.
    #[test]
    fn sums_are_those_of_the_matrix() {
        let mut random = fastrand::Rng::with_seed(3);
        for (count, unknowns) in [(50, 37), (1, 1), (203, 70)] {
            let rows: Vec<Vec<f64>> = (0..count)
                .map(|_| (0..unknowns).map(|_| random.f64() - 0.5).collect())
                .collect();
            let values: Vec<f64> = (0..count).map(|_| random.f64()).collect();
            let mut normal = Normal::new(unknowns);
            let (first, rest) = rows.split_at(count / 3);
            normal.add(first.iter().map(Vec::as_slice).zip(values.iter().copied()));
            let later = values[count / 3..].iter().copied();
            normal.add(rest.iter().map(Vec::as_slice).zip(later));
            normal.add_ridge(0.25);
            let matrix = DMatrix::from_fn(count, unknowns, |i, j| rows[i][j]);
            let mut square = matrix.tr_mul(&matrix);
            for i in 0..unknowns {
                square[(i, i)] += 0.25;
            }
            let right = matrix.tr_mul(&DVector::from_vec(values));
            let solved = normal.solve().expect("with a ridge it is definite");
            let left = &square * &solved - &right;
            assert!(left.amax() < 1e-10, "{count} rows: {}", left.amax());
        }
    }
}
