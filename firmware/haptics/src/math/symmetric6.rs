//! Symmetric 6×6 matrix with an LDLᵀ solver, and vectors of six numbers.
#![expect(
    clippy::needless_range_loop,
    reason = "two indices at once, as the formulas have them"
)]

/// Lower triangle of a symmetric 6×6 matrix.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Symmetric6 {
    /// Row by row; unused above the diagonal.
    rows: [[f32; 6]; 6],
}

impl Symmetric6 {
    pub const ZERO: Self = Self { rows: [[0.0; 6]; 6] };

    /// Adds `value` at (`row`, `column`), `column ≤ row`.
    #[inline]
    pub fn add(&mut self, row: usize, column: usize, value: f32) {
        self.rows[row][column] += value;
    }

    /// Adds `weight · v vᵀ`.
    #[inline]
    pub fn add_outer(&mut self, weight: f32, v: &[f32; 6]) {
        for i in 0..6 {
            let w = weight * v[i];
            for j in 0..=i {
                self.rows[i][j] += w * v[j];
            }
        }
    }

    /// Sum of `weight · v vᵀ`. Some 55 instructions each on a Cortex-M7, half of [`Self::add_outer`]: the sum stays in registers.
    #[inline(never)]
    pub fn sum_of_outer<'a>(outer: impl Iterator<Item = (f32, &'a [f32; 6])>) -> Self {
        let mut sum = Self::ZERO;
        for (weight, v) in outer {
            sum.add_outer(weight, v);
        }
        sum
    }

    /// Adds another matrix.
    #[inline]
    pub fn add_matrix(&mut self, other: &Self) {
        for i in 0..6 {
            for j in 0..=i {
                self.rows[i][j] += other.rows[i][j];
            }
        }
    }

    /// Adds `weight` times another matrix.
    #[inline]
    pub fn add_scaled(&mut self, weight: f32, other: &Self) {
        for i in 0..6 {
            for j in 0..=i {
                self.rows[i][j] += weight * other.rows[i][j];
            }
        }
    }

    /// `self · x`.
    pub fn times(&self, x: &[f32; 6]) -> [f32; 6] {
        let mut y = [0.0; 6];
        for i in 0..6 {
            for j in 0..6 {
                y[i] += if j <= i { self.rows[i][j] } else { self.rows[j][i] } * x[j];
            }
        }
        y
    }

    /// `x` with `self · x = b`, by LDLᵀ (no square roots). About 90 multiplications and 6 divisions; 150 instructions on a Cortex-M7.
    ///
    /// A matrix that is not positive definite gives a non-finite or meaningless result, never a panic: the caller checks.
    pub fn solve(&self, b: &[f32; 6]) -> [f32; 6] {
        let mut l = self.rows;
        let mut inverse_d = [0.0f32; 6];
        for j in 0..6 {
            // Row j of L·D sits in `l[j][..j]` until it is divided by D below.
            let mut d = l[j][j];
            for k in 0..j {
                let ld = l[j][k];
                let lower = ld * inverse_d[k];
                d -= ld * lower;
                l[j][k] = lower;
            }
            inverse_d[j] = 1.0 / d;
            for i in j + 1..6 {
                let mut sum = l[i][j];
                for k in 0..j {
                    sum -= l[i][k] * l[j][k];
                }
                l[i][j] = sum;
            }
        }
        let mut x = *b;
        for i in 0..6 {
            for k in 0..i {
                x[i] -= l[i][k] * x[k];
            }
        }
        for i in (0..6).rev() {
            x[i] *= inverse_d[i];
            for k in i + 1..6 {
                x[i] -= l[k][i] * x[k];
            }
        }
        x
    }
}

/// Σ aᵢ·bᵢ.
#[inline]
pub(crate) fn dot(a: &[f32; 6], b: &[f32; 6]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}

/// Adds `weight · v`.
#[inline(always)]
pub(crate) fn add_scaled(to: &mut [f32; 6], weight: f32, v: &[f32; 6]) {
    for (t, v) in to.iter_mut().zip(v) {
        *t += weight * v;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_it_multiplied() {
        let mut state = 12345u32;
        let mut random = || {
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        for _ in 0..1000 {
            let mut a = Symmetric6::ZERO;
            for i in 0..6 {
                a.add(i, i, 0.1);
            }
            for _ in 0..8 {
                let v = core::array::from_fn(|_| random());
                a.add_outer(1.0, &v);
            }
            let x: [f32; 6] = core::array::from_fn(|_| random());
            let back = a.solve(&a.times(&x));
            for i in 0..6 {
                // Condition number at most about 4/0.1 = 40, some ten roundings of 6·10⁻⁸ each way.
                assert!((back[i] - x[i]).abs() < 5e-5, "{back:?} {x:?}");
            }
        }
    }
}
