//! Fits of a part with others, as the operator looks through them: found on request, shown as a ghost, and nothing moves before one is accepted. Pure.

use std::time::Instant;

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::CadModel;
use mortise_fit::{Fit, Path};

use super::document::Document;
use super::threads::Cancel;
use super::travel::{pose_at, screw};
use crate::display::extent::Extent;

/// Most parts that are searched when none is named.
pub const MOST_PARTNERS: usize = 8;
/// Points of a screw's way, for a turn.
const POINTS_A_TURN: f64 = 24.0;
/// Share of the best score with which a fit is as good, and the difference of cosines that is none.
const AS_GOOD: f64 = 0.99;
const ALIKE: f64 = 1e-3;
/// Largest cosine of the angle between the ways of a part and of the same part turned over.
const TURNED_OVER: f64 = -0.9;

/// The fits of a part.
#[derive(Clone, Debug)]
pub struct Fitting {
    /// The part that is put in.
    pub moving: usize,
    /// Parts with which fits are searched.
    pub parts: usize,
    /// Fits found so far, the best first.
    pub offers: Vec<Offer>,
    /// Number of the one that is shown.
    pub chosen: usize,
    /// The search under way.
    pub search: Option<Search>,
    /// Why parts could not be searched, one line each.
    pub failures: Vec<String>,
    /// Whether the operator has looked through the fits: until then the best one is shown.
    browsed: bool,
    /// Which one was shown before the part was turned over.
    turned_from: Option<usize>,
    /// Id of the search.
    pub(super) id: u64,
}

/// A search under way.
#[derive(Clone, Debug)]
pub struct Search {
    /// Parts that are not searched yet.
    pub left: usize,
    /// Its beginning.
    pub since: Instant,
    pub(super) cancel: Cancel,
}

/// A fit that is offered.
#[derive(Clone, Debug)]
pub struct Offer {
    /// The other part.
    pub against: usize,
    /// The fit, with the other part where the file has it.
    pub fit: Fit,
}

/// Result of the search of one part.
pub struct FitsFound {
    /// Id of the search.
    pub id: u64,
    /// The other part.
    pub against: usize,
    /// Its fits, or one line with the reason why none was searched.
    pub result: Result<Vec<Fit>, String>,
    /// Parts that are not searched yet.
    pub left: usize,
}

impl Fitting {
    /// A search that begins.
    pub(super) fn new(id: u64, moving: usize, parts: usize, cancel: Cancel) -> Self {
        Self {
            moving,
            parts,
            offers: Vec::new(),
            chosen: 0,
            search: Some(Search {
                left: parts,
                since: Instant::now(),
                cancel,
            }),
            failures: Vec::new(),
            browsed: false,
            turned_from: None,
            id,
        }
    }

    /// The fit that is shown.
    pub fn offer(&self) -> Option<&Offer> {
        self.offers.get(self.chosen)
    }

    /// The middle of the part where it is now, mm.
    pub fn middle(&self, document: &Document) -> Option<DVec3> {
        let pose = document.poses.get(self.moving)?;
        Some(pose.transform_point3(document.own_extent(self.moving).center))
    }

    /// A sphere around the part and its place in the fit that is shown, mm.
    pub fn extent(&self, document: &Document) -> Option<Extent> {
        let Extent { center, radius } = document.own_extent(self.moving);
        let ends = [*document.poses.get(self.moving)?, self.offer()?.pose(document)?];
        let [here, there] = ends.map(|pose| pose.transform_point3(center));
        Some(Extent {
            center: 0.5 * (here + there),
            radius: 0.5 * here.distance(there) + radius,
        })
    }

    /// Adds the fits with another part. The one that the operator looks at stays shown.
    pub(super) fn add(&mut self, against: usize, fits: Vec<Fit>) {
        let shown = self.browsed.then_some(self.chosen);
        let known = self.offers.drain(..).enumerate();
        let mut all: Vec<(Option<usize>, Offer)> =
            known.map(|(number, offer)| (Some(number), offer)).collect();
        all.extend(fits.into_iter().map(|fit| (None, Offer { against, fit })));
        all.sort_by(|(_, a), (_, b)| b.fit.score.total_cmp(&a.fit.score));
        let place = |number: usize| all.iter().position(|(before, _)| *before == Some(number));
        self.chosen = shown.and_then(place).unwrap_or(0);
        self.turned_from = self.turned_from.and_then(place);
        self.offers = all.into_iter().map(|(_, offer)| offer).collect();
    }

    /// Shows, of the fits that are as good as the best one, that in which the part goes in as it lies, until the operator has looked through them: a plug whose ends
    /// are alike fits either way round.
    pub(super) fn show_as_it_lies(&mut self, document: &Document) {
        let (Some(best), false) = (self.offers.first(), self.browsed) else {
            return;
        };
        let good = AS_GOOD * best.fit.score;
        let mut most = f64::NEG_INFINITY;
        for (number, offer) in self.offers.iter().enumerate() {
            let likeness = offer.likeness(document, self.moving).unwrap_or(-1.0);
            if offer.fit.score >= good && likeness > most + ALIKE {
                (self.chosen, most) = (number, likeness);
            }
        }
    }

    /// Shows the fit of this number.
    pub(super) fn choose(&mut self, number: usize) {
        if number < self.offers.len() {
            self.chosen = number;
            self.browsed = true;
            self.turned_from = None;
        }
    }

    /// Shows the next fit, after the last one the first.
    pub(super) fn choose_next(&mut self) {
        if !self.offers.is_empty() {
            self.choose((self.chosen + 1) % self.offers.len());
        }
    }

    /// The fit in which the part goes in the other way round, nearest to the one shown; turned over again, the one shown before.
    pub fn turned_over(&self, document: &Document) -> Option<usize> {
        let shown = self.offer()?;
        let middle = document.own_extent(self.moving).center;
        let seat = |offer: &Offer| offer.fit.placement.transform_point3(middle);
        let is_over = |offer: &Offer| {
            let turn = offer.fit.placement.matrix3 * shown.fit.placement.matrix3.transpose();
            match &shown.fit.path {
                Some(path) => (turn * path.direction).dot(path.direction) < TURNED_OVER,
                None => DQuat::from_mat3(&turn).to_axis_angle().1.cos() < TURNED_OVER,
            }
        };
        let fits = self.offers.iter().enumerate();
        let over: Vec<(usize, f64)> = fits
            .filter(|(_, offer)| offer.against == shown.against && is_over(offer))
            .map(|(number, offer)| (number, seat(offer).distance_squared(seat(shown))))
            .collect();
        let before = over.iter().find(|(number, _)| Some(*number) == self.turned_from);
        let nearest = || over.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        before.or_else(nearest).map(|(number, _)| *number)
    }

    /// Shows the fit in which the part goes in the other way round.
    pub(super) fn turn_over(&mut self, document: &Document) {
        if let Some(number) = self.turned_over(document) {
            let from = self.chosen;
            self.choose(number);
            self.turned_from = Some(from);
        }
    }
}

impl Offer {
    /// From the assembly as in its file to the assembly as it is: where the other part is now.
    fn moved(&self, document: &Document) -> Option<DAffine3> {
        let file = document.grouped.model.parts.get(self.against)?.placement;
        Some(*document.poses.get(self.against)? * file.inverse())
    }

    /// Pose of the part in this fit, with the other part where it is now, mm.
    pub fn pose(&self, document: &Document) -> Option<DAffine3> {
        let pose = self.moved(document)? * self.fit.placement;
        // Products of poses are rigid but for rounding, which must not add up.
        let (_, rotation, translation) = pose.to_scale_rotation_translation();
        pose.is_finite()
            .then(|| DAffine3::from_rotation_translation(rotation.normalize(), translation))
    }

    /// Cosine of the angle between the way in and the way in turned along with the part from its orientation in the fit to that of now: a turn about the way does not
    /// count. Without a way, cosine of the angle between both orientations.
    fn likeness(&self, document: &Document, moving: usize) -> Option<f64> {
        let (here, there) = (document.poses.get(moving)?, self.pose(document)?);
        let turn = here.matrix3 * there.matrix3.transpose();
        Some(match &self.fit.path {
            Some(path) => {
                let way = self.moved(document)?.transform_vector3(path.direction);
                way.dot(turn * way)
            }
            None => DQuat::from_mat3(&turn).to_axis_angle().1.cos(),
        })
    }

    /// The way of the middle of part `moving` to its place, from outside, mm; empty where no way in is known.
    pub fn way(&self, document: &Document, moving: usize) -> Vec<DVec3> {
        let (Some(path), Some(moved)) = (&self.fit.path, self.moved(document)) else {
            return Vec::new();
        };
        let seat = self
            .fit
            .placement
            .transform_point3(document.own_extent(moving).center);
        let way = points(path, seat).into_iter();
        way.map(|point| moved.transform_point3(point)).collect()
    }
}

/// The way of a point to `seat`, from outside.
fn points(path: &Path, seat: DVec3) -> Vec<DVec3> {
    let Some((_, pitch)) = screw(path) else {
        return path.corners_mm.iter().map(|&corner| seat + corner).collect();
    };
    let count = ((path.length_mm / pitch).abs() * POINTS_A_TURN)
        .ceil()
        .clamp(2.0, 2_000.0) as usize;
    let at = |step: usize| {
        let back = 1.0 - step as f64 / count as f64;
        pose_at(path, &DAffine3::from_translation(seat), back * path.length_mm).translation
    };
    (0..=count).map(at).collect()
}

/// The parts with a closed surface that are nearest to a part, the nearest first; of equal parts only the nearest.
pub fn nearest(document: &Document, moving: usize) -> Vec<usize> {
    let own = document.own_extent(moving);
    let Some(pose) = document.poses.get(moving) else {
        return Vec::new();
    };
    let middle = pose.transform_point3(own.center);
    let mut others: Vec<(f64, usize)> = (document.poses.iter().enumerate())
        .filter(|&(part, _)| part != moving && is_closed(&document.grouped.model, part))
        .map(|(part, pose)| {
            let other = document.own_extent(part);
            let apart = pose.transform_point3(other.center).distance(middle);
            (apart - other.radius - own.radius, part)
        })
        .collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut shapes: Vec<usize> = Vec::new();
    let mut nearest = Vec::new();
    for (_, part) in others {
        let shape = document.grouped.model.parts[part].shape;
        if nearest.len() < MOST_PARTNERS && !shapes.contains(&shape) {
            shapes.push(shape);
            nearest.push(part);
        }
    }
    nearest
}

/// Whether a part has a closed surface, without which no fit is searched.
pub fn is_closed(model: &CadModel, part: usize) -> bool {
    let shape = model
        .parts
        .get(part)
        .and_then(|part| model.shapes.get(part.shape));
    shape.is_some_and(|shape| shape.closed)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use mortise_fit::{Clearance, PathKind};

    use super::*;

    fn fit(score: f64, placement: DAffine3, direction: DVec3) -> Fit {
        Fit {
            placement,
            score,
            area_mm2: 10.0,
            clearance: Clearance {
                min_mm: 0.0,
                median_mm: 0.0,
                max_mm: 0.0,
            },
            residual_mm: 0.0,
            freedom: 1,
            faces: vec![[0, 0]],
            path: Some(Path {
                kind: PathKind::Line,
                direction,
                length_mm: 30.0,
                smallest_clearance_mm: 0.0,
                corners_mm: vec![-30.0 * direction, DVec3::ZERO],
                screw: None,
                spin: None,
                ends: true,
                sliding: Vec::new(),
            }),
        }
    }

    fn sample() -> Document {
        Document::sample(0, &|_| ControlFlow::Continue(())).expect("the sample")
    }

    fn turned(axis: DVec3, angle: f64, z: f64) -> DAffine3 {
        DAffine3::from_rotation_translation(DQuat::from_axis_angle(axis, angle), z * DVec3::Z)
    }

    fn of(fits: Vec<Fit>) -> Fitting {
        let mut fitting = Fitting::new(1, 1, 1, Cancel::default());
        fitting.add(0, fits);
        fitting
    }

    #[test]
    fn the_best_is_shown_until_the_operator_chooses_another_which_stays() {
        let at = |z: f64| turned(DVec3::Z, 0.0, z);
        let mut fitting = of(vec![fit(0.5, at(1.0), DVec3::Z), fit(0.4, at(2.0), DVec3::Z)]);
        fitting.add(2, vec![fit(0.8, at(3.0), DVec3::Z)]);
        assert_eq!((fitting.chosen, fitting.offers[0].against), (0, 2));
        fitting.choose_next();
        let shown = fitting.offer().expect("one").fit.placement;
        fitting.add(3, vec![fit(0.9, at(4.0), DVec3::Z), fit(0.1, at(5.0), DVec3::Z)]);
        assert_eq!(fitting.offer().expect("one").fit.placement, shown);
        let scores: Vec<f64> = fitting.offers.iter().map(|offer| offer.fit.score).collect();
        assert_eq!(scores, [0.9, 0.8, 0.5, 0.4, 0.1]);
        for _ in 0..5 {
            fitting.choose_next();
        }
        assert_eq!(
            fitting.offer().expect("one").fit.placement,
            shown,
            "all the way round"
        );
        fitting.choose(17);
        assert_eq!(fitting.offer().expect("one").fit.placement, shown, "no such fit");
    }

    #[test]
    fn of_fits_as_good_as_the_best_the_one_as_the_part_lies_is_shown() {
        let document = sample();
        let half = std::f64::consts::PI;
        let here = document.poses[1];
        let at = |axis: DVec3, angle: f64| DAffine3::from_quat(DQuat::from_axis_angle(axis, angle)) * here;
        let over = |score: f64| fit(score, at(DVec3::X, half), -DVec3::Z);
        let spun = |score: f64| fit(score, at(DVec3::Z, 3.0), -DVec3::Z);
        for (fits, shown) in [
            (vec![over(0.9), spun(0.899)], 1),
            (vec![spun(0.9), over(0.899)], 0),
            // A worse fit is not shown for that.
            (vec![over(0.9), spun(0.8)], 0),
        ] {
            let mut fitting = of(fits);
            fitting.show_as_it_lies(&document);
            assert_eq!(fitting.chosen, shown);
        }
        let mut fitting = of(vec![over(0.9), spun(0.9)]);
        fitting.choose(0);
        fitting.show_as_it_lies(&document);
        assert_eq!(fitting.chosen, 0, "the operator chose it");
    }

    #[test]
    fn turning_over_takes_the_nearest_reversed_fit_and_comes_back() {
        let document = sample();
        let middle = document.own_extent(1).center;
        // The middle of the part is at this height, whichever way round it is.
        let at = |axis: DVec3, angle: f64, z: f64| {
            let turn = DQuat::from_axis_angle(axis, angle);
            DAffine3::from_rotation_translation(turn, z * DVec3::Z - turn * middle)
        };
        let half = std::f64::consts::PI;
        let mut fitting = of(vec![
            fit(0.9, at(DVec3::Z, 0.0, 0.0), DVec3::Z),
            // Half a turn about the way is not the other way round.
            fit(0.8, at(DVec3::Z, half, 0.0), DVec3::Z),
            fit(0.7, at(DVec3::X, half, 50.0), DVec3::Z),
            fit(0.6, at(DVec3::Y, half, 1.0), DVec3::Z),
        ]);
        fitting.turn_over(&document);
        assert_eq!(fitting.chosen, 3);
        fitting.turn_over(&document);
        assert_eq!(fitting.chosen, 0);
        fitting.choose(1);
        fitting.turn_over(&document);
        assert_eq!(fitting.chosen, 3);
        fitting.turn_over(&document);
        assert_eq!(fitting.chosen, 1, "not the first of those equally near");
        let only = of(vec![fit(0.9, at(DVec3::Z, 0.0, 0.0), DVec3::Z)]);
        assert_eq!(only.turned_over(&document), None);
    }

    #[test]
    fn a_fit_goes_with_the_other_part() {
        let mut document = sample();
        let fitting = of(vec![fit(0.9, turned(DVec3::X, 0.3, 5.0), DVec3::Z)]);
        let offer = fitting.offer().expect("one");
        assert!(
            offer
                .pose(&document)
                .expect("rigid")
                .abs_diff_eq(offer.fit.placement, 1e-12)
        );
        let by = DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.7), DVec3::new(3.0, 4.0, -5.0));
        document.poses[0] = by * document.poses[0];
        let pose = offer.pose(&document).expect("rigid");
        assert!(pose.abs_diff_eq(by * offer.fit.placement, 1e-12));
        let around = fitting.extent(&document).expect("one");
        for pose in [pose, document.poses[1]] {
            let Extent { center, radius } = document.own_extent(1);
            let reach = pose.transform_point3(center).distance(around.center) + radius;
            assert!(reach < around.radius + 1e-9);
        }
        let way = offer.way(&document, 1);
        let middle = document.own_extent(1).center;
        assert!(way[1].abs_diff_eq(pose.transform_point3(middle), 1e-9));
        assert!((way[1] - way[0]).abs_diff_eq(by.transform_vector3(30.0 * DVec3::Z), 1e-9));
    }

    #[test]
    fn a_screw_turns_to_its_right_on_the_way_in() {
        let path = Path {
            kind: PathKind::Screw,
            direction: -DVec3::Z,
            length_mm: 6.0,
            smallest_clearance_mm: 0.0,
            corners_mm: Vec::new(),
            screw: Some((DVec3::new(1.0, 0.0, 0.0), 3.0)),
            spin: None,
            ends: true,
            sliding: Vec::new(),
        };
        let seat = DVec3::new(2.0, 0.0, 0.0);
        let way = points(&path, seat);
        assert_eq!(way.len(), 49);
        assert!(way[48].abs_diff_eq(seat, 1e-12));
        assert!(way[0].abs_diff_eq(seat + 6.0 * DVec3::Z, 1e-9), "two turns");
        // Forward along -z a right-hand thread turns about -z: from +x to -y.
        let quarter = way[48 - 6];
        assert!(quarter.abs_diff_eq(DVec3::new(1.0, 1.0, 0.75), 1e-9), "{quarter}");
    }

    #[test]
    fn the_nearest_parts_are_those_with_a_closed_surface() {
        let document = sample();
        assert_eq!(nearest(&document, 1), [0]);
        let mut model = (*document.model).clone();
        model.shapes[0].closed = false;
        let document = Document::of(model, None, document.title, 0);
        assert_eq!(nearest(&document, 1), Vec::<usize>::new());
    }
}
