//! Where names are written beside dots: to the right, left, above or below, where they cover neither dots nor other names. Pure.

use egui::{Pos2, Rect, Vec2};

/// Space between a dot and its name, points.
const BESIDE: f32 = 3.0;

/// A name to be written.
#[derive(Clone, Copy, Debug)]
pub struct Label {
    /// Its dot.
    pub dot: Pos2,
    /// Its size.
    pub size: Vec2,
    /// Those of a lower rank take their places first.
    pub rank: usize,
}

/// Places of names within a rectangle; `None` for those without room.
pub fn place(labels: &[Label], radius: f32, within: Rect) -> Vec<Option<Rect>> {
    let mut order: Vec<usize> = (0..labels.len()).collect();
    order.sort_by_key(|&number| labels[number].rank);
    let dots = |own: usize| {
        let others = labels
            .iter()
            .enumerate()
            .filter(move |(number, _)| *number != own);
        others.map(|(_, label)| Rect::from_center_size(label.dot, Vec2::splat(2.0 * radius)))
    };
    let mut placed: Vec<Option<Rect>> = vec![None; labels.len()];
    for number in order {
        let is_free = |rect: &Rect| {
            let taken = placed.iter().flatten().any(|other| overlap(other, rect));
            within.contains_rect(*rect) && !taken && !dots(number).any(|dot| overlap(&dot, rect))
        };
        let found = sides(&labels[number], radius).into_iter().find(is_free);
        placed[number] = found;
    }
    placed
}

/// The places beside a dot, the best first.
fn sides(label: &Label, radius: f32) -> [Rect; 8] {
    let (half, away) = (0.5 * label.size, radius + BESIDE);
    let aslant = 0.7 * away;
    [
        Vec2::new(away + half.x, 0.0),
        Vec2::new(-away - half.x, 0.0),
        Vec2::new(0.0, away + half.y - 1.0),
        Vec2::new(0.0, -away - half.y + 1.0),
        Vec2::new(aslant + half.x, aslant + half.y - 2.0),
        Vec2::new(aslant + half.x, -aslant - half.y + 2.0),
        Vec2::new(-aslant - half.x, aslant + half.y - 2.0),
        Vec2::new(-aslant - half.x, -aslant - half.y + 2.0),
    ]
    .map(|shift| Rect::from_center_size(label.dot + shift, label.size))
}

fn overlap(a: &Rect, b: &Rect) -> bool {
    a.intersect(*b).is_positive()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const WITHIN: Rect = Rect {
        min: Pos2::ZERO,
        max: Pos2::new(240.0, 200.0),
    };
    const RADIUS: f32 = 5.0;

    prop_compose! {
        fn label()(x in 0.0f32..240.0, y in 0.0f32..200.0, width in 5.0f32..90.0, rank in 0usize..4) -> Label {
            Label { dot: Pos2::new(x, y), size: Vec2::new(width, 14.0), rank }
        }
    }

    proptest! {
        #[test]
        fn names_cover_neither_dots_nor_names(labels in prop::collection::vec(label(), 1..40)) {
            let placed = place(&labels, RADIUS, WITHIN);
            for (number, rect) in placed.iter().enumerate().filter_map(|(n, rect)| Some((n, (*rect)?))) {
                prop_assert!(WITHIN.contains_rect(rect));
                prop_assert!((rect.size() - labels[number].size).length() < 1e-3);
                for (other, label) in labels.iter().enumerate().filter(|(other, _)| *other != number) {
                    let dot = Rect::from_center_size(label.dot, Vec2::splat(2.0 * RADIUS));
                    prop_assert!(!overlap(&dot, &rect), "dot {other}");
                    prop_assert!(!placed[other].is_some_and(|beside| overlap(&beside, &rect)), "name {other}");
                }
            }
        }

        /// A name that has room by itself is left out only for names of no higher rank, or dots.
        #[test]
        fn a_name_alone_has_its_place(label in label()) {
            let fits = WITHIN.shrink2(Vec2::new(0.0, 8.0)).contains(label.dot);
            let placed = place(&[label], RADIUS, WITHIN);
            prop_assert!(!fits || placed[0].is_some());
        }
    }
}
