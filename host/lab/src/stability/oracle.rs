//! Theory of a sampled wall: spectral radius of the closed loop, and the closed forms of Colgate and Schenkel.
//!
//! Plant m·ẍ + b·ẋ + k·x = u (k and part of b are the hand's), u held from tick to tick and applied d ticks late; wall u = −K·x − B·v̂ with v̂ the
//! difference quotient of the samples, through a first-order low-pass of time constant τ where that is not 0. The loop is linear, so it is stable
//! exactly if no eigenvalue of its step has a magnitude above 1: the reference that the closed forms bound. Sources: J. E. Colgate and G. G.
//! Schenkel, *Passivity of a class of sampled-data systems*, J. Robotic Systems 14(1), 1997; J. J. Gil et al., *Stability boundary for haptic
//! rendering*, IEEE T-RO 25(6), 2009.

/// Largest delay, ticks.
pub const MAX_DELAY: usize = 4;
/// State of the loop: x, v, last sample, filtered speed, delayed forces.
const STATES: usize = 4 + MAX_DELAY;
/// Number of squarings of the step matrix: the norm's remaining factor in the root is one part in 10⁸.
const SQUARINGS: u32 = 32;

/// A handle and the hand on it, along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// m, kg.
    pub mass_kg: f64,
    /// b, N s/m: the handle's friction and the hand's damping together.
    pub damping: f64,
    /// k, N/m: the hand's.
    pub stiffness: f64,
}

/// A wall as a sampled loop renders it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// K, N/m.
    pub stiffness: f64,
    /// B, N s/m.
    pub damping: f64,
    /// τ, s.
    pub filter_s: f64,
    /// T, s.
    pub period_s: f64,
    /// d, at most [`MAX_DELAY`].
    pub delay_ticks: usize,
}

/// Relation of damping to stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// The textbook's wall: K·x + B·v̂.
    Wall,
    /// The product's coupling, which predicts one period ahead: K·x + (b_T + T·K)·v̂, with B in place of b_T.
    Coupling,
}

impl Law {
    /// `wall` rendered by this law at another stiffness; its damping is the law's B or b_T.
    pub fn at(self, wall: &Wall, stiffness: f64) -> Wall {
        let ahead = match self {
            Self::Wall => 0.0,
            Self::Coupling => wall.period_s * stiffness,
        };
        Wall {
            stiffness,
            damping: wall.damping + ahead,
            ..*wall
        }
    }
}

type Matrix = [[f64; STATES]; STATES];

/// Largest absolute eigenvalue of the closed loop's step; the loop is stable below 1.
pub fn spectral_radius(plant: &Plant, wall: &Wall) -> f64 {
    let held = zero_order_hold(plant, wall.period_s);
    let mut matrix = [[0.0; STATES]; STATES];
    for column in 0..STATES {
        let mut state = [0.0; STATES];
        state[column] = 1.0;
        for (row, value) in step(state, &held, wall).into_iter().enumerate() {
            matrix[row][column] = value;
        }
    }
    // ρ = lim |Aⁿ|^(1/n) (Gelfand), n = 2^SQUARINGS.
    let mut logarithm = 0.0;
    for _ in 0..SQUARINGS {
        let norm = matrix.iter().flatten().fold(0.0f64, |most, x| most.max(x.abs()));
        if norm == 0.0 {
            return 0.0;
        }
        matrix.iter_mut().flatten().for_each(|x| *x /= norm);
        matrix = product(&matrix, &matrix);
        logarithm = 2.0 * (logarithm + norm.ln());
    }
    let norm = matrix.iter().flatten().fold(0.0f64, |most, x| most.max(x.abs()));
    ((logarithm + norm.ln()) / f64::from(2.0f32.powi(SQUARINGS as i32))).exp()
}

/// Largest stable K below `most`, N/m, for a wall that is otherwise `wall`; 0 if there is none.
pub fn stiffness_limit(plant: &Plant, law: Law, wall: &Wall, most: f64) -> f64 {
    // Searches many stiffnesses for the first unstable one, because a wall with too much damping is also unstable when soft.
    limit(1e-3 * most, most, FINE, |stiffness| {
        spectral_radius(plant, &law.at(wall, stiffness)) < 1.0
    })
}

/// Resolution of a search: steps of a constant ratio before bisection, and the ratio at which bisection ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Number of steps.
    pub steps: i32,
    /// Final ratio, above 1.
    pub ratio: f64,
}

/// For references, and for experiments compared with them.
pub const FINE: Search = Search {
    steps: 40,
    ratio: 1.0 + 1e-4,
};

/// For maps.
pub const COARSE: Search = Search {
    steps: 6,
    ratio: 1.01,
};

/// The largest value between `least` and `most` up to which `stable` is true; 0 if it is false at `least`.
pub fn limit(least: f64, most: f64, search: Search, mut stable: impl FnMut(f64) -> bool) -> f64 {
    let at = |i: i32| least * (most / least).powf(f64::from(i) / f64::from(search.steps));
    let Some(first) = (0..=search.steps).find(|&i| !stable(at(i))) else {
        return most;
    };
    if first == 0 {
        return 0.0;
    }
    let (mut low, mut high) = (at(first - 1), at(first));
    while high / low > search.ratio {
        let middle = (low * high).sqrt();
        if stable(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low * high).sqrt()
}

/// Colgate and Schenkel: K below which the wall is passive with any hand, b > K·(T/2 + d·T) + |B| (with delay for B = 0 only), N/m.
pub fn passive_stiffness(damping: f64, wall: &Wall) -> f64 {
    let late = (0.5 + wall.delay_ticks as f64) * wall.period_s;
    ((damping - wall.damping.abs()) / late).max(0.0)
}

/// Position and speed after one period, as functions of position, speed and held force.
fn zero_order_hold(plant: &Plant, period_s: f64) -> [[f64; 3]; 2] {
    // Matrix exponential of the step over a 2⁻¹⁶th of the period, by its series to third order, then squared.
    const HALVINGS: u32 = 16;
    let h = period_s / f64::from(1u32 << HALVINGS);
    let a = [
        [0.0, 1.0, 0.0],
        [
            -plant.stiffness / plant.mass_kg,
            -plant.damping / plant.mass_kg,
            1.0 / plant.mass_kg,
        ],
        [0.0; 3],
    ];
    let times = |p: &[[f64; 3]; 3], q: &[[f64; 3]; 3]| -> [[f64; 3]; 3] {
        core::array::from_fn(|i| core::array::from_fn(|j| (0..3).map(|k| p[i][k] * q[k][j]).sum()))
    };
    let square = times(&a, &a);
    let cube = times(&square, &a);
    let mut e: [[f64; 3]; 3] = core::array::from_fn(|i| {
        core::array::from_fn(|j| {
            f64::from(u8::from(i == j))
                + h * a[i][j]
                + h * h / 2.0 * square[i][j]
                + h * h * h / 6.0 * cube[i][j]
        })
    });
    for _ in 0..HALVINGS {
        e = times(&e, &e);
    }
    [e[0], e[1]]
}

fn step(state: [f64; STATES], held: &[[f64; 3]; 2], wall: &Wall) -> [f64; STATES] {
    let [x, v, before, filtered, ..] = state;
    let gain = wall.period_s / (wall.filter_s + wall.period_s);
    let filtered = filtered + gain * ((x - before) / wall.period_s - filtered);
    let force = -wall.stiffness * x - wall.damping * filtered;
    let mut next = state;
    // Delayed forces move up; the first is applied.
    next.copy_within(5.., 4);
    next[STATES - 1] = 0.0;
    let given = if wall.delay_ticks == 0 {
        force
    } else {
        next[3 + wall.delay_ticks] = force;
        state[4]
    };
    next[2] = x;
    next[3] = filtered;
    for (place, row) in next.iter_mut().zip(held) {
        *place = row[0] * x + row[1] * v + row[2] * given;
    }
    next
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| (0..STATES).map(|k| a[i][k] * b[k][j]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANT: Plant = Plant {
        mass_kg: 0.1,
        damping: 0.5,
        stiffness: 0.0,
    };

    fn wall(damping: f64, delay_ticks: usize) -> Wall {
        Wall {
            stiffness: 0.0,
            damping,
            filter_s: 0.0,
            period_s: 1e-3,
            delay_ticks,
        }
    }

    /// Values computed from eigenvalues in another program.
    #[test]
    fn limits_are_those_of_an_eigenvalue_solver() {
        for (damping, delay, expected) in [
            (0.0, 0, 1000.8),
            (0.0, 1, 333.8),
            (0.4, 0, 1794.0),
            (5.0, 1, 3468.0),
        ] {
            let found = stiffness_limit(&PLANT, Law::Wall, &wall(damping, delay), 1e5);
            assert!(
                (found / expected - 1.0).abs() < 5e-4,
                "{damping} {delay}: {found}"
            );
        }
    }

    /// Without damping in the wall, and with light damping of the plant, the stability boundary is that of passivity.
    #[test]
    fn without_damping_the_closed_form_is_near() {
        for delay in 0..3 {
            let found = stiffness_limit(&PLANT, Law::Wall, &wall(0.0, delay), 1e5);
            let formula = passive_stiffness(0.5, &wall(0.0, delay));
            assert!((found / formula - 1.0).abs() < 5e-3, "{delay}: {found} {formula}");
        }
    }
}
