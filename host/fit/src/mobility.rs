//! Mobility of a solid whose faces lie against another's: directions in which it can leave.

use glam::DVec3;

use crate::gaps::Gap;
use crate::solid::directions;

/// Normals kept, and the angle within which they are one, rad.
const MOST_NORMALS: usize = 400;
const SAME_RAD: f64 = 0.02;
/// Directions by which the share of the sphere is measured.
const LATTICE: usize = 4000;
/// Approach of a face along a direction that still counts as along it.
const ALONG: f64 = 2e-3;
/// Approach of a face along a suggested direction beyond which it is not tried: play lets a part pass a lip.
const RESISTS: f64 = 0.3;

/// The cone of translations that no mating face resists: d with n·d ≥ 0 for every direction n in which a face pushes the moving solid.
pub(crate) struct Cone {
    normals: Vec<DVec3>,
}

impl Cone {
    /// The cone of these gaps.
    pub fn new(gaps: &[Gap]) -> Self {
        let mut normals: Vec<DVec3> = Vec::new();
        for gap in gaps {
            if normals.len() == MOST_NORMALS {
                break;
            }
            if normals.iter().all(|n| n.distance(gap.away) > SAME_RAD) {
                normals.push(gap.away);
            }
        }
        Self { normals }
    }

    /// Smallest rate at which a mating face opens along `d`; negative where one resists.
    pub fn opening(&self, d: DVec3) -> f64 {
        self.normals.iter().map(|n| n.dot(d)).fold(1.0, f64::min)
    }

    /// Whether no face resists a translation along `d`.
    pub fn holds(&self, d: DVec3) -> bool {
        self.opening(d) > -ALONG
    }

    /// Share of all directions that are free: ½ for a plane on a plane, ¼ at an edge, ⅛ in a corner, 0 for a shaft in a bore.
    pub fn share(&self) -> f64 {
        directions(LATTICE).filter(|&d| self.opening(d) > 0.0).count() as f64 / LATTICE as f64
    }

    /// Directions worth a try: first those of `more` that little resists, either way round, then the normals themselves, the middle of the cone and its
    /// edges (n × m), each the widest opening first.
    pub fn candidates(&self, more: &[DVec3]) -> Vec<DVec3> {
        let mut out: Vec<(f64, DVec3)> = Vec::new();
        let mut add = |d: DVec3| {
            let opening = self.opening(d);
            if opening > -ALONG && out.iter().all(|(_, known)| known.distance(d) > 0.02) {
                out.push((opening, d));
            }
        };
        for &d in &self.normals {
            add(d);
        }
        if let Some(widest) = directions(LATTICE).max_by(|a, b| self.opening(*a).total_cmp(&self.opening(*b)))
        {
            add(widest);
        }
        let few = &self.normals[..self.normals.len().min(40)];
        for (i, a) in few.iter().enumerate() {
            for b in &few[i + 1..] {
                if let Some(d) = a.cross(*b).try_normalize() {
                    add(d);
                    add(-d);
                }
            }
        }
        out.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut first: Vec<(f64, DVec3)> = (more.iter().flat_map(|&d| [d, -d]))
            .map(|d| (self.opening(d), d))
            .filter(|(opening, _)| *opening > -RESISTS)
            .collect();
        first.sort_by(|a, b| b.0.total_cmp(&a.0));
        let others = (out.into_iter()).filter(|(_, d)| first.iter().all(|(_, e)| e.distance(*d) > 0.02));
        (first.iter().copied().chain(others)).map(|(_, d)| d).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gap(away: DVec3) -> Gap {
        Gap {
            at: DVec3::ZERO,
            away,
            gap: 0.0,
            area: 1.0,
            faces: [0, 0],
            of_moving: true,
        }
    }

    #[test]
    fn planes_edges_and_corners_leave_their_share_of_the_sphere() {
        for (normals, share) in [
            (vec![DVec3::Z], 0.5),
            (vec![DVec3::Z, DVec3::X], 0.25),
            (vec![DVec3::Z, DVec3::X, DVec3::Y], 0.125),
            (vec![DVec3::X, -DVec3::X], 0.0),
        ] {
            let gaps: Vec<Gap> = normals.into_iter().map(gap).collect();
            let measured = Cone::new(&gaps).share();
            assert!((measured - share).abs() < 0.01, "{measured} for {share}");
        }
    }

    #[test]
    fn a_bore_is_left_along_its_axis() {
        let gaps: Vec<Gap> = (0..36)
            .map(|k| {
                gap(DVec3::new(
                    (f64::from(k) / 5.7).cos(),
                    (f64::from(k) / 5.7).sin(),
                    0.0,
                ))
            })
            .collect();
        let found = Cone::new(&gaps).candidates(&[DVec3::Z]);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found.iter().all(|d| d.z.abs() > 0.999), "{found:?}");
    }
}
