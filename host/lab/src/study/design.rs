//! Designs of experiments over factors with levels: the combinations to try.
//!
//! *Space-filling*: a Latin hypercube with each level of a factor as often as any other (within one), its columns exchanged until the smallest
//! distance between two trials is large (maximin, Morris & Mitchell 1995). *D-optimal*: coordinate exchange maximises the determinant of XᵀX of the
//! model with an intercept and one linear term a factor (Meyer & Nachtsheim 1995); the best of several starts.

use nalgebra::DMatrix;

/// Kind of design.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Design {
    /// Latin hypercube, maximin.
    SpaceFilling,
    /// Coordinate exchange.
    DOptimal,
}

/// Number of exchanges that a space-filling design tries.
const EXCHANGES: usize = 4000;
/// Number of random starts of coordinate exchange, and largest number of rounds through all coordinates.
const STARTS: usize = 5;
const ROUNDS: usize = 20;

impl Design {
    /// `runs` trials, each with a level (from 0) of every factor; `levels` is the number of levels of each factor.
    pub fn drawn(self, levels: &[usize], runs: usize, seed: u64) -> Vec<Vec<usize>> {
        let mut random = fastrand::Rng::with_seed(seed);
        match self {
            Self::SpaceFilling => space_filling(levels, runs, &mut random),
            Self::DOptimal => {
                let designs = (0..STARTS).map(|_| exchanged(levels, runs, &mut random));
                designs
                    .max_by(|a, b| information(levels, a).total_cmp(&information(levels, b)))
                    .unwrap_or_default()
            }
        }
    }
}

/// A level mapped to −1 to 1.
fn coded(level: usize, levels: usize) -> f64 {
    2.0 * level as f64 / (levels.max(2) - 1) as f64 - 1.0
}

fn space_filling(levels: &[usize], runs: usize, random: &mut fastrand::Rng) -> Vec<Vec<usize>> {
    let mut rows = vec![vec![0; levels.len()]; runs];
    for (factor, &count) in levels.iter().enumerate() {
        let mut column: Vec<usize> = (0..runs).map(|run| run * count / runs).collect();
        random.shuffle(&mut column);
        rows.iter_mut()
            .zip(column)
            .for_each(|(row, level)| row[factor] = level);
    }
    // Near pairs dominate: Σ d^(−2p), p = 8, which the smallest distance governs.
    let crowding = |rows: &[Vec<usize>], i: usize| -> f64 {
        (0..rows.len())
            .filter(|&j| j != i)
            .map(|j| {
                let squared: f64 = (levels.iter().enumerate())
                    .map(|(f, &n)| (coded(rows[i][f], n) - coded(rows[j][f], n)).powi(2))
                    .sum();
                squared.max(1e-6).powi(-8)
            })
            .sum()
    };
    for _ in 0..EXCHANGES {
        let (a, b) = (random.usize(0..runs), random.usize(0..runs));
        let factor = random.usize(0..levels.len());
        if rows[a][factor] == rows[b][factor] {
            continue;
        }
        let swap = |rows: &mut [Vec<usize>]| {
            let level = rows[a][factor];
            rows[a][factor] = rows[b][factor];
            rows[b][factor] = level;
        };
        let before = crowding(&rows, a) + crowding(&rows, b);
        swap(&mut rows);
        if crowding(&rows, a) + crowding(&rows, b) > before {
            swap(&mut rows);
        }
    }
    rows
}

/// ln det XᵀX of the linear model.
fn information(levels: &[usize], rows: &[Vec<usize>]) -> f64 {
    let x = DMatrix::from_fn(rows.len(), levels.len() + 1, |row, column| match column {
        0 => 1.0,
        factor => coded(rows[row][factor - 1], levels[factor - 1]),
    });
    (x.transpose() * x).determinant().max(f64::MIN_POSITIVE).ln()
}

fn exchanged(levels: &[usize], runs: usize, random: &mut fastrand::Rng) -> Vec<Vec<usize>> {
    let mut rows: Vec<Vec<usize>> = (0..runs)
        .map(|_| levels.iter().map(|&count| random.usize(0..count)).collect())
        .collect();
    let mut best = information(levels, &rows);
    for _ in 0..ROUNDS {
        let before = best;
        for run in 0..runs {
            for (factor, &count) in levels.iter().enumerate() {
                for level in 0..count {
                    let old = std::mem::replace(&mut rows[run][factor], level);
                    let found = information(levels, &rows);
                    if found > best + 1e-12 {
                        best = found;
                    } else {
                        rows[run][factor] = old;
                    }
                }
            }
        }
        if best <= before + 1e-9 {
            break;
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVELS: [usize; 4] = [10, 10, 3, 11];

    /// Each level of a factor as often as any other, within one; the same seed gives the same design.
    #[test]
    fn a_space_filling_design_is_balanced() {
        for seed in 0..20 {
            let rows = Design::SpaceFilling.drawn(&LEVELS, 27, seed);
            for (factor, &count) in LEVELS.iter().enumerate() {
                let of = |level| rows.iter().filter(|row| row[factor] == level).count();
                let counts: Vec<usize> = (0..count).map(of).collect();
                let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
                assert!(most - least <= 1, "{counts:?}");
            }
            assert_eq!(rows, Design::SpaceFilling.drawn(&LEVELS, 27, seed));
        }
    }

    /// The D-optimal design of a linear model lies at the ends of all factors (Kiefer): det XᵀX is that of a regular two-level design, except for the
    /// loss that 27 runs, not a power of two, cannot avoid.
    #[test]
    fn a_d_optimal_design_lies_at_the_ends() {
        let rows = Design::DOptimal.drawn(&LEVELS, 27, 3);
        for (factor, &count) in LEVELS.iter().enumerate() {
            assert!(
                rows.iter()
                    .all(|row| row[factor] == 0 || row[factor] == count - 1)
            );
        }
        let ideal = 5.0 * 27f64.ln();
        assert!(
            information(&LEVELS, &rows) > ideal - 0.05,
            "{} of {ideal}",
            information(&LEVELS, &rows)
        );
    }
}
