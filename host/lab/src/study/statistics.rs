//! Statistics of the studies: a logistic model, the effect of each of its terms, and a straight line through points.
//!
//! A trial succeeds with probability p, ln(p/(1 − p)) = β₀ + Σ βᵢ·xᵢ, fitted by maximum likelihood (Newton's method: the log likelihood is concave).
//! A term is tested by the likelihood ratio: without it the deviance −2·ln L grows by χ², distributed with one degree of freedom where the term has
//! no effect (Wilks 1938). That also holds for completely separated trials, whose coefficients grow without bound.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _, FisherSnedecor};

/// Largest number of Newton steps: each doubles the digits; for completely separated trials each divides the deviance by e.
const STEPS: usize = 60;
/// Convergence: the deviance changes by less.
const CONVERGED: f64 = 1e-10;
/// |η| that counts as certain: beyond it the other result has a chance of one in a hundred million. A sample of a hundred trials cannot show that;
/// some term or sum of terms separates the trials completely, and coefficients grow without bound.
const CERTAIN: f64 = 18.4;
/// Ridge on the information matrix, for separated trials: far below the uncertainty of any coefficient.
const RIDGE: f64 = 1e-12;

/// A fitted model.
#[derive(Clone, Debug, PartialEq)]
pub struct Logistic {
    /// β₀, then one for each term.
    pub coefficients: Vec<f64>,
    /// Their standard errors.
    pub errors: Vec<f64>,
    /// −2·ln L.
    pub deviance: f64,
    /// True if terms separate the trials completely: coefficients have no finite optimum, and those above are the last iterate.
    pub separated: bool,
}

/// Effect of a term.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Term {
    /// Its name with its unit.
    pub name: String,
    /// Its coefficient; absent where it has no finite value.
    pub coefficient: Option<f64>,
    /// The coefficient's standard error, likewise.
    pub error: Option<f64>,
    /// Growth of the deviance without the term.
    pub chi_squared: f64,
    /// Probability of a χ² at least as large by chance, with one degree of freedom.
    pub p: f64,
}

/// Probability that χ² with `degrees` degrees of freedom is larger; `None` for degrees that are not positive.
pub fn chi_squared_p(chi_squared: f64, degrees: f64) -> Option<f64> {
    Some(ChiSquared::new(degrees).ok()?.sf(chi_squared.max(0.0)))
}

impl Logistic {
    /// Fits the model to trials: the values of each, one a term, and whether it succeeded. `None` when there are no trials, when they have unequal
    /// numbers of values, or when terms are linearly dependent.
    pub fn fit(values: &[Vec<f64>], went: &[bool]) -> Option<Self> {
        let count = values.first()?.len() + 1;
        if values.len() != went.len() || values.iter().any(|of| of.len() + 1 != count) {
            return None;
        }
        let x = DMatrix::from_fn(values.len(), count, |row, column| {
            if column == 0 { 1.0 } else { values[row][column - 1] }
        });
        let y = DVector::from_iterator(went.len(), went.iter().map(|&went| f64::from(u8::from(went))));
        let mut beta = DVector::zeros(count);
        let mut deviance = deviance(&x, &y, &beta);
        let mut information = DMatrix::zeros(count, count);
        for _ in 0..STEPS {
            let p = (&x * &beta).map(|eta| 1.0 / (1.0 + (-eta).exp()));
            let gradient = x.transpose() * (&y - &p);
            let weighted = DMatrix::from_fn(values.len(), count, |row, column| {
                p[row] * (1.0 - p[row]) * x[(row, column)]
            });
            information = x.transpose() * weighted;
            let ridge = RIDGE * DMatrix::from_diagonal(&(x.transpose() * &x).diagonal());
            let mut step = (&information + ridge).cholesky()?.solve(&gradient);
            // Halve the step until it improves the deviance: far from the optimum a full step may not.
            let (next, best) = (0..30).find_map(|_| {
                let next = &beta + &step;
                let reached = self::deviance(&x, &y, &next);
                step *= 0.5;
                (reached <= deviance).then_some((next, reached))
            })?;
            let gained = deviance - best;
            (beta, deviance) = (next, best);
            if gained < CONVERGED {
                break;
            }
        }
        let separated = (&x * &beta).amax() > CERTAIN;
        let errors = match information.try_inverse() {
            Some(covariance) => covariance.diagonal().map(f64::sqrt).iter().copied().collect(),
            None if separated => vec![f64::INFINITY; count],
            None => return None,
        };
        Some(Self {
            coefficients: beta.iter().copied().collect(),
            errors,
            deviance,
            separated,
        })
    }

    /// Effect of each term: its coefficient, and χ² and p against the model without it.
    pub fn terms(names: &[&str], values: &[Vec<f64>], went: &[bool]) -> Option<Vec<Term>> {
        let full = Self::fit(values, went)?;
        (names.iter().enumerate())
            .map(|(i, name)| {
                let without: Vec<Vec<f64>> = (values.iter())
                    .map(|of| {
                        let mut rest = of.clone();
                        rest.remove(i);
                        rest
                    })
                    .collect();
                let chi_squared = (Self::fit(&without, went)?.deviance - full.deviance).max(0.0);
                Some(Term {
                    name: (*name).to_owned(),
                    coefficient: (!full.separated).then(|| full.coefficients[i + 1]),
                    error: (!full.separated).then(|| full.errors[i + 1]),
                    chi_squared,
                    p: chi_squared_p(chi_squared, 1.0)?,
                })
            })
            .collect()
    }
}

/// −2·ln L = 2·Σ ln(1 + e^(∓η)), in a form that does not overflow.
fn deviance(x: &DMatrix<f64>, y: &DVector<f64>, beta: &DVector<f64>) -> f64 {
    let eta = x * beta;
    let lost = |(eta, y): (&f64, &f64)| {
        let against = if *y > 0.5 { -eta } else { *eta };
        against.max(0.0) + (-against.abs()).exp().ln_1p()
    };
    2.0 * eta.iter().zip(y.iter()).map(lost).sum::<f64>()
}

impl std::fmt::Display for Term {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: χ²(1) = {:.2}, p = {:.2e}",
            self.name, self.chi_squared, self.p
        )?;
        match (self.coefficient, self.error) {
            (Some(b), Some(error)) => write!(f, ", β = {b:.3} ± {error:.3}"),
            _ => write!(f, ", no finite β: together the terms tell trials apart entirely"),
        }
    }
}

/// Least squares with several terms and an intercept, and the effect of each term.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Regression {
    /// β₀, then one for each term.
    pub coefficients: Vec<f64>,
    /// Sum of squares explained by the model.
    pub model: f64,
    /// Residual sum of squares.
    pub error: f64,
    /// Degrees of freedom of model and residual.
    pub freedom: [usize; 2],
    /// For each term: the sum of squares lost without it, its F ratio and p, with one degree of freedom.
    pub effects: Vec<[f64; 3]>,
}

impl Regression {
    /// Fits `y` by the terms of `x`, one row a trial; `None` when there are too few trials or terms are linearly dependent.
    pub fn fit(x: &[Vec<f64>], y: &[f64]) -> Option<Self> {
        let (coefficients, error) = residual(x, y)?;
        let terms = coefficients.len() - 1;
        let left = y.len().checked_sub(terms + 1).filter(|&left| left > 0)?;
        let mean = y.iter().sum::<f64>() / y.len() as f64;
        let model = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() - error;
        let distribution = FisherSnedecor::new(1.0, left as f64).ok()?;
        let effects = (0..terms).map(|term| {
            let without: Vec<Vec<f64>> = (x.iter())
                .map(|row| {
                    let mut row = row.clone();
                    row.remove(term);
                    row
                })
                .collect();
            let lost = residual(&without, y)?.1 - error;
            let f = lost / (error / left as f64);
            Some([lost, f, distribution.sf(f.max(0.0))])
        });
        let effects = effects.collect::<Option<_>>()?;
        Some(Self {
            coefficients,
            model,
            error,
            freedom: [terms, left],
            effects,
        })
    }

    /// F ratio of the whole model.
    pub fn f_ratio(&self) -> f64 {
        let [model, error] = self.freedom.map(|n| n as f64);
        self.model / model / (self.error / error)
    }

    /// Share of the variance explained.
    pub fn r_squared(&self) -> f64 {
        self.model / (self.model + self.error)
    }
}

/// Coefficients and residual sum of squares.
fn residual(x: &[Vec<f64>], y: &[f64]) -> Option<(Vec<f64>, f64)> {
    let count = x.first()?.len() + 1;
    let design = DMatrix::from_fn(
        x.len(),
        count,
        |row, column| {
            if column == 0 { 1.0 } else { x[row][column - 1] }
        },
    );
    let y = DVector::from_column_slice(y);
    let beta = (design.transpose() * &design)
        .cholesky()?
        .solve(&(design.transpose() * &y));
    let error = (&y - &design * &beta).norm_squared();
    Some((beta.iter().copied().collect(), error))
}

/// Least-squares line through points (x, y).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeastSquares {
    /// Slope.
    pub slope: f64,
    /// Value at x = 0.
    pub intercept: f64,
    /// Share of the variance explained.
    pub r_squared: f64,
}

impl LeastSquares {
    /// The line through at least two points of different x; `None` otherwise.
    pub fn through(points: &[(f64, f64)]) -> Option<Self> {
        let count = points.len() as f64;
        let (x, y) = points
            .iter()
            .fold((0.0, 0.0), |(x, y), at| (x + at.0 / count, y + at.1 / count));
        let sum = |of: fn(f64, f64) -> f64| points.iter().map(|at| of(at.0 - x, at.1 - y)).sum::<f64>();
        let (xx, xy, yy) = (sum(|x, _| x * x), sum(|x, y| x * y), sum(|_, y| y * y));
        (xx > 0.0).then(|| Self {
            slope: xy / xx,
            intercept: y - xy / xx * x,
            r_squared: if yy > 0.0 { xy * xy / (xx * yy) } else { 1.0 },
        })
    }

    /// The line's value at x.
    pub fn at(&self, x: f64) -> f64 {
        self.slope * x + self.intercept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, within: f64) {
        assert!((a - b).abs() <= within, "{a} instead of {b}");
    }

    /// Hours of study against passing, the example of the English Wikipedia's "Logistic regression": β = −4.0777 and 1.5046, standard errors 1.7610
    /// and 0.6287, log likelihood −8.02988, p = 0.0006 against the model without hours.
    #[test]
    fn hours_of_study() {
        let failed = [0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5];
        let passed = [1.75, 2.25, 2.75, 3.25, 4.0, 4.25, 4.5, 4.75, 5.0, 5.5];
        let hours: Vec<Vec<f64>> = failed.iter().chain(&passed).map(|&hours| vec![hours]).collect();
        let went: Vec<bool> = (0..20).map(|i| i >= 10).collect();
        let model = Logistic::fit(&hours, &went).expect("fits");
        for (found, published) in model.coefficients.iter().zip([-4.0777, 1.5046]) {
            close(*found, published, 5e-5);
        }
        for (found, published) in model.errors.iter().zip([1.7610, 0.6287]) {
            close(*found, published, 5e-5);
        }
        close(model.deviance, 2.0 * 8.02988, 2e-5);
        let term = &Logistic::terms(&["hours"], &hours, &went).expect("fits")[0];
        close(term.chi_squared, 2.0 * (20.0 * 2f64.ln() - 8.02988), 2e-5);
        close(term.p, 0.0006, 5e-5);
    }

    /// One binary term has a closed form: β₁ is the logarithm of the odds ratio, its variance 1/a + 1/b + 1/c + 1/d, and the likelihood ratio is G =
    /// 2·Σ O·ln(O/E).
    #[test]
    fn a_table_of_four_has_its_closed_form() {
        let counts: [[f64; 2]; 2] = [[12.0, 5.0], [4.0, 19.0]];
        let (mut values, mut went) = (Vec::new(), Vec::new());
        for (term, row) in counts.iter().enumerate() {
            for (outcome, &count) in row.iter().enumerate() {
                for _ in 0..count as usize {
                    values.push(vec![term as f64]);
                    went.push(outcome == 1);
                }
            }
        }
        let model = Logistic::fit(&values, &went).expect("fits");
        let [[a, b], [c, d]] = counts;
        close(model.coefficients[0], (b / a).ln(), 1e-6);
        close(model.coefficients[1], (d * a / (b * c)).ln(), 1e-6);
        close(
            model.errors[1],
            (1.0 / a + 1.0 / b + 1.0 / c + 1.0 / d).sqrt(),
            1e-5,
        );
        let all = a + b + c + d;
        let g = [
            (a, a + b, a + c),
            (b, a + b, b + d),
            (c, c + d, a + c),
            (d, c + d, b + d),
        ]
        .map(|(seen, row, column)| 2.0 * seen * (seen * all / (row * column)).ln());
        let term = &Logistic::terms(&["term"], &values, &went).expect("fits")[0];
        close(term.chi_squared, g.iter().sum(), 1e-8);
    }

    /// For completely separated trials the model's deviance is 0; the model without the term has that of a constant probability.
    #[test]
    fn what_is_distinguished_says_so_and_is_tested_still() {
        let values: Vec<Vec<f64>> = (0..10).map(|i| vec![f64::from(i)]).collect();
        let went: Vec<bool> = (0..10).map(|i| i >= 5).collect();
        let model = Logistic::fit(&values, &went).expect("fits");
        assert!(model.separated);
        let term = &Logistic::terms(&["x"], &values, &went).expect("fits")[0];
        assert_eq!(term.coefficient, None);
        close(term.chi_squared, 20.0 * 2f64.ln(), 1e-5);
    }

    /// With two degrees of freedom the tail is e^(−χ²/2); with one, 3.8415 leaves 5 %.
    #[test]
    fn tails_of_chi_squared() {
        for x in [0.1, 1.0, 5.0, 20.0] {
            close(
                chi_squared_p(x, 2.0).expect("two degrees"),
                (-0.5 * x).exp(),
                1e-12,
            );
        }
        close(
            chi_squared_p(3.841_458_820_694_124, 1.0).expect("one degree"),
            0.05,
            1e-10,
        );
        assert_eq!(chi_squared_p(1.0, 0.0), None);
    }

    /// Anscombe's first data set as a regression of one term: R² = 0.6665, F = 17.99 and p = 0.00217 with 9 degrees of freedom.
    #[test]
    fn a_regression_of_one_term_is_anscombes() {
        let x = [10.0, 8.0, 13.0, 9.0, 11.0, 14.0, 6.0, 4.0, 12.0, 7.0, 5.0];
        let y = [8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68];
        let rows: Vec<Vec<f64>> = x.iter().map(|&x| vec![x]).collect();
        let found = Regression::fit(&rows, &y).expect("fits");
        close(found.r_squared(), 0.6665, 5e-5);
        close(found.f_ratio(), 17.99, 5e-3);
        close(found.effects[0][1], found.f_ratio(), 1e-9);
        close(found.effects[0][2], 0.00217, 5e-6);
        assert_eq!(found.freedom, [1, 9]);
    }

    #[test]
    fn a_line_through_its_own_points_is_itself() {
        let points: Vec<(f64, f64)> = (0..5)
            .map(|i| (f64::from(i), 0.027 * f64::from(i) - 0.001))
            .collect();
        let line = LeastSquares::through(&points).expect("points");
        close(line.slope, 0.027, 1e-12);
        close(line.intercept, -0.001, 1e-12);
        close(line.r_squared, 1.0, 1e-12);
        // Anscombe's first data set: y = 3.00 + 0.500·x, R² = 0.67.
        let x = [10.0, 8.0, 13.0, 9.0, 11.0, 14.0, 6.0, 4.0, 12.0, 7.0, 5.0];
        let y = [8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68];
        let anscombe: Vec<(f64, f64)> = x.into_iter().zip(y).collect();
        let line = LeastSquares::through(&anscombe).expect("points");
        close(line.intercept, 3.0001, 5e-5);
        close(line.slope, 0.5001, 5e-5);
        close(line.r_squared, 0.6665, 5e-5);
        assert_eq!(LeastSquares::through(&[(1.0, 2.0), (1.0, 3.0)]), None);
    }
}
