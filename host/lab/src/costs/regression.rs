//! Ordinary least squares with standard errors.

use nalgebra::{DMatrix, DVector};

/// A fitted coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Its value.
    pub value: f64,
    /// Its standard error.
    pub error: f64,
}

/// A fit of `y` by the columns of `x`.
#[derive(Clone, Debug)]
pub struct Regression {
    /// One for each column; `None` for a column that is zero in every row or a combination of others.
    pub coefficients: Vec<Option<Coefficient>>,
    /// Standard deviation of what the columns do not explain, in the unit of `y`.
    pub residual: f64,
}

/// Smallest singular value of the scaled columns, relative to the largest, at which they are still independent.
const INDEPENDENT: f64 = 1e-6;

/// Fits `observed[i]` by `Σ coefficient[j]·counts[i][j]`. A column that does not differ from a combination of the columns before it is left out. `None`
/// with fewer rows than columns.
pub fn fit(counts: &[Vec<f64>], observed: &[f64]) -> Option<Regression> {
    let columns = counts.first()?.len();
    let mut used: Vec<usize> = Vec::new();
    for column in 0..columns {
        used.push(column);
        if !independent(&scaled(counts, &used).0) {
            used.pop();
        }
    }
    if counts.len() != observed.len() || counts.len() <= used.len() {
        return None;
    }
    let (x, scales) = scaled(counts, &used);
    let y = DVector::from_column_slice(observed);
    let inverse = (x.transpose() * &x).try_inverse()?;
    let found = &inverse * (x.transpose() * &y);
    let left = &y - &x * &found;
    let variance = left.norm_squared() / (counts.len() - used.len()) as f64;
    let mut coefficients = vec![None; columns];
    for (at, (&column, scale)) in used.iter().zip(&scales).enumerate() {
        coefficients[column] = Some(Coefficient {
            value: found[at] / scale,
            error: (variance * inverse[(at, at)]).sqrt() / scale,
        });
    }
    Some(Regression {
        coefficients,
        residual: variance.sqrt(),
    })
}

/// The used columns, each divided by its length, and the lengths (1 for a column of zeros).
fn scaled(counts: &[Vec<f64>], used: &[usize]) -> (DMatrix<f64>, Vec<f64>) {
    let mut x = DMatrix::from_fn(counts.len(), used.len(), |row, at| counts[row][used[at]]);
    let scales = (x.column_iter_mut())
        .map(|mut column| {
            let length = column.norm();
            let scale = if length > 0.0 { length } else { 1.0 };
            column /= scale;
            scale
        })
        .collect();
    (x, scales)
}

fn independent(x: &DMatrix<f64>) -> bool {
    let values = x.clone().svd(false, false).singular_values;
    values.min() > INDEPENDENT * values.max()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Exact observations give the coefficients back, whatever the columns' sizes.
        #[test]
        fn exact_observations_give_their_coefficients(
            true_values in prop::collection::vec(-1e3f64..1e3, 4),
            rows in prop::collection::vec(prop::collection::vec(0.0f64..100.0, 3), 30..60),
        ) {
            let counts: Vec<Vec<f64>> = rows.iter().map(|row| vec![1.0, row[0], 1e3 * row[1], 1e-2 * row[2]]).collect();
            let observed: Vec<f64> = counts.iter().map(|row| row.iter().zip(&true_values).map(|(x, c)| x * c).sum()).collect();
            let found = fit(&counts, &observed).unwrap();
            for (coefficient, value) in found.coefficients.iter().zip(&true_values) {
                let off = (coefficient.unwrap().value - value).abs();
                prop_assert!(off < 1e-6 * (1.0 + value.abs()), "{found:?} {true_values:?}");
            }
        }
    }

    #[test]
    fn columns_that_say_nothing_new_have_no_coefficient() {
        let counts: Vec<Vec<f64>> = (0..20)
            .map(f64::from)
            .map(|row| vec![1.0, row, 0.0, 2.0 * row + 3.0, row * row])
            .collect();
        let observed: Vec<f64> = counts.iter().map(|row| 5.0 + 2.0 * row[1] + row[4]).collect();
        let found = fit(&counts, &observed).unwrap().coefficients;
        assert!((found[1].unwrap().value - 2.0).abs() < 1e-6);
        assert!((found[4].unwrap().value - 1.0).abs() < 1e-6);
        assert_eq!((found[2], found[3]), (None, None));
    }

    /// A standard error contains the truth about as often as it should, and no observation fewer than columns is fitted.
    #[test]
    fn errors_are_of_the_size_of_the_noise() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut within = 0;
        for _ in 0..200 {
            let counts: Vec<Vec<f64>> = (0..50).map(|_| vec![1.0, random.f64() * 10.0]).collect();
            let observed: Vec<f64> = counts
                .iter()
                .map(|row| 3.0 + 2.0 * row[1] + (random.f64() - 0.5))
                .collect();
            let found = fit(&counts, &observed).unwrap();
            // A uniform width of 1 has a deviation of 0.289.
            assert!((0.2..0.4).contains(&found.residual));
            let slope = found.coefficients[1].unwrap();
            within += u32::from((slope.value - 2.0).abs() < 2.0 * slope.error);
        }
        assert!((180..=198).contains(&within), "{within}");
        assert!(fit(&[vec![1.0, 2.0]], &[1.0]).is_none());
    }
}
