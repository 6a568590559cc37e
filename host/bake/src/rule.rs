//! Rule by which the surfaces near a cell give its distance, found from tests.
//!
//! Distances to surfaces are 1-Lipschitz, and so are largest and smallest of them: a rule of the right sign everywhere is a lower bound of the
//! distance's magnitude. Of the faces that nowhere exceed the distance all may enter a largest (a convex edge, corner or thin wall); mirrored, the
//! same for a smallest. Otherwise the rule is a largest of clauses: for each test, the faces whose distance there is large enough, reduced as long as
//! their smallest nowhere exceeds the distance; then as few clauses as needed.

use mortise_protocol::image::{Group, Nearby};

/// Tolerance of exact distances, mm: rounding, and vertices a tenth of a micrometre off their curves.
pub(crate) const SAME_MM: f64 = 2e-4;

/// Distances below this may have either sign, mm: grid positions are rounded to single precision.
const NOISE_MM: f64 = 1e-5;

/// A point at which a rule is tested.
pub(crate) struct Test {
    /// Exact distance there, mm, outside positive.
    pub distance: f64,
    /// Distance to each candidate's surface, NaN where it has none; of a side that by which it counts.
    pub faces: Vec<f64>,
    /// Largest error of a rule there, mm.
    pub tolerance: f64,
    /// Whether a reader interpolates where a surface of the rule has no distance, which is accurate enough this far from the surface.
    pub may_interpolate: bool,
}

impl Test {
    /// Whether candidate `i` leaves the answer here to interpolation.
    fn is_left_out(&self, i: usize) -> bool {
        self.may_interpolate && self.faces[i].is_nan()
    }
}

/// The rule that holds at all tests, if one is found. Groups begin with `nearest` if they contain it. The first `faces` of the candidates are faces,
/// the others sides of edges, which serve in clauses with faces: they are used only where faces alone do not do.
pub(crate) fn find_rule(tests: &[Test], candidates: &[u16], faces: usize, nearest: u16) -> Option<Nearby> {
    let hold = |rule: &Nearby| tests.iter().all(|test| holds(*rule, test, candidates));
    let single = Nearby::Face(nearest);
    if hold(&single) {
        return Some(single);
    }
    let of = |sign: f64, clauses: &[Vec<usize>]| {
        let mut clauses: Vec<Vec<u16>> = (clauses.iter())
            .map(|clause| clause.iter().map(|&i| candidates[i]).collect())
            .collect();
        for clause in &mut clauses {
            clause.sort_unstable_by_key(|&face| (face != nearest, face));
        }
        clauses.sort_unstable_by_key(|clause| (clause[0] != nearest, clause.clone()));
        let slices: Vec<&[u16]> = clauses.iter().map(Vec::as_slice).collect();
        let group = Group::new(&slices)?;
        Some(if sign > 0.0 {
            Nearby::Convex(group)
        } else {
            Nearby::Reentrant(group)
        })
    };
    let plain = [1.0, -1.0].into_iter().filter_map(|sign| {
        let kept = largest(tests, faces, sign);
        of(sign, &kept.into_iter().map(|i| vec![i]).collect::<Vec<_>>())
    });
    if let Some(rule) = plain.into_iter().find(hold) {
        return Some(rule);
    }
    let of_clauses = |count: usize| {
        let found = [1.0, -1.0]
            .into_iter()
            .filter_map(|sign| of(sign, &clauses(tests, count, sign)?));
        found.filter(hold).min_by_key(|rule| match rule {
            Nearby::Convex(group) | Nearby::Reentrant(group) => group.words().len(),
            _ => 0,
        })
    };
    of_clauses(faces).or_else(|| {
        let has_sides = faces < candidates.len();
        has_sides.then(|| of_clauses(candidates.len())).flatten()
    })
}

/// Distance by `rule` where its surfaces have these distances; `None` where one has none, so that a reader interpolates.
pub(crate) fn value(rule: Nearby, distance: impl Fn(u16) -> f64) -> Option<f64> {
    let (group, sign) = match rule {
        Nearby::Face(one) => return Some(distance(one)).filter(|d| !d.is_nan()),
        Nearby::Convex(group) => (group, 1.0),
        Nearby::Reentrant(group) => (group, -1.0),
        Nearby::Roughly(_) | Nearby::Unknown => return None,
    };
    let (mut found, mut clause) = (f64::NEG_INFINITY, f64::INFINITY);
    for (one, joined) in group.faces() {
        let own = sign * distance(one);
        if own.is_nan() {
            return None;
        }
        clause = clause.min(own);
        if !joined {
            found = found.max(clause);
            clause = f64::INFINITY;
        }
    }
    Some(sign * found)
}

/// Whether `rule` is right at `test`: of the right sign and no larger magnitude than the distance, and equal to it where the rule is exact.
pub(crate) fn holds(rule: Nearby, test: &Test, candidates: &[u16]) -> bool {
    let place = |face: u16| candidates.iter().position(|&c| c == face);
    let (group, sign) = match rule {
        Nearby::Convex(group) => (group, 1.0),
        Nearby::Reentrant(group) => (group, -1.0),
        Nearby::Face(one) => {
            return place(one).is_some_and(|i| {
                test.is_left_out(i) || (test.faces[i] - test.distance).abs() <= test.tolerance
            });
        }
        Nearby::Roughly(_) | Nearby::Unknown => return false,
    };
    let Some(found) = value(rule, |face| place(face).map_or(f64::NAN, |i| test.faces[i])) else {
        return test.may_interpolate;
    };
    let found = sign * found;
    let distance = sign * test.distance;
    if distance.abs() <= test.tolerance || (distance < 0.0 && group.is_plain()) {
        (found - distance).abs() <= test.tolerance
    } else {
        // A bound of zero clear of the surface would be felt.
        found * distance.signum() >= NOISE_MM && found.abs() <= distance.abs() + test.tolerance
    }
}

/// Candidates whose distance times `sign` nowhere exceeds the true one, without those that another one covers at every test.
fn largest(tests: &[Test], candidates: usize, sign: f64) -> Vec<usize> {
    let below = |i: usize| {
        tests
            .iter()
            .all(|test| test.is_left_out(i) || sign * test.faces[i] <= sign * test.distance + test.tolerance)
    };
    let mut kept: Vec<usize> = (0..candidates).filter(|&i| below(i)).collect();
    let mut at = 0;
    while at < kept.len() {
        let own = kept[at];
        let covers = |other: usize| {
            tests.iter().all(|test| {
                test.is_left_out(own) || sign * test.faces[own] <= sign * test.faces[other] + 1e-9
            })
        };
        if kept.iter().any(|&other| other != own && covers(other)) {
            kept.remove(at);
        } else {
            at += 1;
        }
    }
    kept
}

/// A largest of smallest distances (times `sign`) of the right sign at all tests. Where all clauses are single faces, the first one is
/// doubled: a rule that is exact at the faces only must not look plain.
fn clauses(tests: &[Test], candidates: usize, sign: f64) -> Option<Vec<Vec<usize>>> {
    let below = |clause: &[usize]| {
        tests.iter().all(|test| {
            if clause.iter().any(|&i| test.is_left_out(i)) {
                return true;
            }
            let least = (clause.iter().map(|&i| sign * test.faces[i])).fold(f64::INFINITY, f64::min);
            let distance = sign * test.distance;
            if distance < -test.tolerance {
                least <= -NOISE_MM
            } else {
                least <= distance.max(0.0) + test.tolerance
            }
        })
    };
    // A clause serves a test if it is positive outside, and elsewhere no deeper than the surface.
    let least = |test: &Test| {
        let distance = sign * test.distance;
        if distance > test.tolerance {
            NOISE_MM
        } else {
            distance - test.tolerance
        }
    };
    let serves = |clause: &[usize], test: &Test| {
        clause
            .iter()
            .all(|&i| test.is_left_out(i) || sign * test.faces[i] >= least(test))
    };
    let mut found: Vec<Vec<usize>> = Vec::new();
    for test in tests {
        let mut clause: Vec<usize> = (0..candidates).filter(|&i| serves(&[i], test)).collect();
        if clause.is_empty() || !below(&clause) {
            return None;
        }
        // The farthest first: the nearest ones decide.
        let mut order = clause.clone();
        order.sort_by(|&a, &b| test.faces[b].abs().total_cmp(&test.faces[a].abs()));
        for i in order {
            let less: Vec<usize> = clause.iter().copied().filter(|&j| j != i).collect();
            if !less.is_empty() && below(&less) {
                clause = less;
            }
        }
        if !found.contains(&clause) {
            found.push(clause);
        }
    }
    let mut open: Vec<&Test> = tests.iter().collect();
    let mut chosen: Vec<Vec<usize>> = Vec::new();
    while !open.is_empty() {
        let served = |clause: &Vec<usize>| open.iter().filter(|test| serves(clause, test)).count();
        let best = found.iter().max_by_key(|clause| served(clause))?.clone();
        if served(&best) == 0 {
            return None;
        }
        open.retain(|test| !serves(&best, test));
        chosen.push(best);
    }
    if chosen.iter().all(|clause| clause.len() == 1) {
        let first = chosen.first_mut()?;
        first.push(first[0]);
    }
    Some(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests on a lattice of half steps over [-1, 1]³ for a solid whose distance is `value` of x, y and z.
    fn lattice(value: impl Fn([f64; 3]) -> f64) -> Vec<Test> {
        let at = |i: usize| i as f64 - 1.0;
        (0..27)
            .map(|i| {
                let faces = [at(i % 3), at(i / 3 % 3), at(i / 9)];
                Test {
                    distance: value(faces),
                    faces: faces.to_vec(),
                    tolerance: SAME_MM,
                    may_interpolate: false,
                }
            })
            .collect()
    }

    fn group(clauses: &[&[u16]]) -> Group {
        Group::new(clauses).expect("few faces")
    }

    #[test]
    fn corners_of_every_kind() {
        let faces = [4, 5, 6];
        let found = |value: fn([f64; 3]) -> f64, nearest| find_rule(&lattice(value), &faces, 3, nearest);
        assert_eq!(found(|[x, ..]| x, 4), Some(Nearby::Face(4)));
        assert_eq!(
            found(|[x, y, z]| x.max(y).max(z), 5),
            Some(Nearby::Convex(group(&[&[5], &[4], &[6]])))
        );
        assert_eq!(
            found(|[x, y, z]| x.min(y).min(z), 4),
            Some(Nearby::Reentrant(group(&[&[4], &[5], &[6]])))
        );
        // Two faces at a re-entrant edge end at a third, and the reverse.
        assert_eq!(
            found(|[x, y, z]| x.min(y).max(z), 6),
            Some(Nearby::Convex(group(&[&[6], &[4, 5]])))
        );
        assert_eq!(
            found(|[x, y, z]| x.max(y).min(z), 6),
            Some(Nearby::Reentrant(group(&[&[6], &[4, 5]])))
        );
        assert_eq!(found(|[x, y, z]| x * y * z, 6), None);
    }
}
