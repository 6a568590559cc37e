//! Scalar functions, written out where a platform could round or choose differently.

/// The smaller of two numbers; unlike `f32::min` it does not depend on the platform's choice between zeros.
#[inline]
pub(crate) fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// The larger of two numbers.
#[inline]
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

/// 1/√x for normal positive x: first guess from the bits (within 3.5 %), three Newton steps (1.9·10⁻³, 5·10⁻⁶, below rounding).
#[inline]
pub(crate) fn inverse_sqrt(x: f32) -> f32 {
    let mut y = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    for _ in 0..3 {
        y *= 1.5 - 0.5 * x * y * y;
    }
    y
}

/// Sine and cosine of an angle of at most a right angle, to 1.5·10⁻⁷: by their series about 0 up to 45°, with the coefficients of the Cephes library, and
/// beyond by those of what is left to a right angle. About 30 instructions; that of libm computes with 64 bits, in software on these processors.
#[inline]
pub(crate) fn sin_cos(angle: f32) -> (f32, f32) {
    /// π/2, and what it lacks.
    const RIGHT: [f32; 2] = [core::f32::consts::FRAC_PI_2, -4.371_139e-8];
    let size = angle.abs();
    let left = (RIGHT[0] - size) + RIGHT[1];
    let x = smaller(size, left);
    let z = x * x;
    let sin = x + x * z * (-1.666_665_5e-1 + z * (8.332_161e-3 - z * 1.951_529_6e-4));
    let cos = 1.0 - 0.5 * z + z * z * (4.166_664_6e-2 + z * (-1.388_731_6e-3 + z * 2.443_315_7e-5));
    let (sin, cos) = if left < size { (cos, sin) } else { (sin, cos) };
    (if angle < 0.0 { -sin } else { sin }, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine() {
        let right = f64::from(core::f32::consts::FRAC_PI_2);
        for i in -10_000..=10_000 {
            let angle = (right * f64::from(i) / 10_000.0) as f32;
            let (sin, cos) = sin_cos(angle);
            let (exact_sin, exact_cos) = libm::sincos(f64::from(angle));
            let off = (f64::from(sin) - exact_sin)
                .abs()
                .max((f64::from(cos) - exact_cos).abs());
            assert!(off < 1.5e-7, "{angle}: {off:e}");
        }
    }

    #[test]
    fn inverse_square_root() {
        for i in 0..10_000 {
            let x = 0.01 + 3.99 * i as f32 / 10_000.0;
            let y = inverse_sqrt(x);
            assert!(
                (f64::from(y) * f64::from(y) * f64::from(x) - 1.0).abs() < 6e-7,
                "{x}"
            );
        }
    }
}
