//! Charts of error over time: gaps and depths of scene P, and the largest gap error over all free-form pairs.

use super::entry::Entry;
use super::method::Kind;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::scene_p::median;

/// What a chart of scene P shows.
struct What {
    title: &'static str,
    note: &'static str,
    y: &'static str,
    error: fn(&Entry) -> Option<f64>,
}

/// Scene P: largest error of gaps over the median query.
pub fn gaps(entries: &[Entry]) -> Chart {
    let what = What {
        title: "Scene P: error of a gap over the time of a query",
        note: "Peg ø20 in a bore ø20.2; a hull has no bore. Labels: largest deviation of a mesh from the surfaces. Down and left is better.",
        y: "largest gap error, µm",
        error: |entry| entry.gap_error_um,
    };
    thesis(entries, &what)
}

/// Scene P: largest error of depths over the median query.
pub fn depths(entries: &[Entry]) -> Chart {
    let what = What {
        title: "Scene P: error of a depth over the time of a query",
        note: "coal reports that triangles overlap, but not how deep. Labels: largest deviation of a mesh from the surfaces. Down and left is better.",
        y: "largest depth error, µm",
        error: |entry| entry.depth_error_um,
    };
    thesis(entries, &what)
}

fn thesis(entries: &[Entry], what: &What) -> Chart {
    let here: Vec<&Entry> = entries.iter().filter(|entry| entry.scene == "scene P").collect();
    let points = here.iter().enumerate().filter_map(|(index, entry)| {
        let (x, y) = entry.median_us.zip((what.error)(entry))?;
        // The hulls of two meshes lie at nearly the same place, so the first names both.
        let named = here[..index].iter().any(|other| other.method == entry.method);
        let label = match (entry.kind?, entry.mesh_um) {
            (Kind::Hulls, _) if named => String::new(),
            (Kind::Hulls, _) | (_, None) => entry.method.replace("mortise, ", "").replace(", hulls", ""),
            (_, Some(mesh)) => format!("{}, {mesh} µm", entry.peer),
        };
        Some((entry.kind?, x, y, label))
    });
    Chart {
        title: what.title.into(),
        note: what.note.into(),
        x: Axis::new("median query, µs"),
        y: Axis::new(what.y),
        series: series(points),
    }
}

/// Largest gap error over all pairs but scene P, over the median of the pairs' medians; `None` where the shared pairs were not measured. Only
/// methods that answered every pair are drawn.
pub fn free_form(entries: &[Entry]) -> Option<Chart> {
    let others: Vec<&Entry> = entries.iter().filter(|entry| entry.scene != "scene P").collect();
    let scenes = names(
        others
            .iter()
            .filter(|entry| entry.median_us.is_some())
            .map(|entry| &entry.scene),
    );
    let methods = names(others.iter().map(|entry| &entry.method));
    let points = methods.iter().filter_map(|&method| {
        let own = others.iter().filter(|entry| entry.method == *method);
        let own: Vec<&&Entry> = own.filter(|entry| entry.median_us.is_some()).collect();
        if own.len() < scenes.len() {
            return None;
        }
        let errors = own.iter().filter_map(|entry| entry.gap_error_um);
        let error = errors.max_by(f64::total_cmp)?;
        let time = median(own.iter().filter_map(|entry| entry.median_us));
        Some((own[0].kind?, time, error, method.clone()))
    });
    let series = series(points);
    (scenes.len() > 1 && !series.is_empty()).then(|| Chart {
        title: format!("{} pairs of free-form and planar parts: error of a gap over time", scenes.len()),
        note: "Median over the pairs of the median query; the largest error of any free pose. Meshes within 10 µm of the surfaces. Down and left is \
               better."
            .into(),
        x: Axis::new("median query, µs"),
        y: Axis::new("largest gap error, µm"),
        series,
    })
}

/// Each name once, in the order of its first occurrence.
fn names<'e>(all: impl Iterator<Item = &'e String>) -> Vec<&'e String> {
    let mut names = Vec::new();
    for name in all {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// One series a kind, so that four looks serve any number of methods, which are named by labels.
fn series(points: impl Iterator<Item = (Kind, f64, f64, String)>) -> Vec<Series> {
    let points: Vec<_> = points.collect();
    let of = |(index, (kind, name)): (usize, (Kind, &str))| Series {
        name: name.to_owned(),
        look: Look::nth(index),
        line: Line::None,
        points: (points.iter())
            .filter(|(own, ..)| *own == kind)
            .map(|(_, x, y, label)| Point {
                x: *x,
                y: *y,
                label: label.clone(),
                at_least: false,
            })
            .collect(),
    };
    let all = Kind::ALL.into_iter().enumerate().map(of);
    all.filter(|series| !series.points.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(scene: &str, method: &str, kind: Kind, median_us: Option<f64>) -> Entry {
        Entry {
            scene: scene.into(),
            method: method.into(),
            kind: Some(kind),
            median_us,
            gap_error_um: median_us.map(|us| 2.0 * us),
            ..Entry::default()
        }
    }

    #[test]
    fn a_skipped_method_is_not_drawn_and_one_without_depth_only_among_gaps() {
        let all = [
            entry("scene P", "a", Kind::Ours, Some(3.0)),
            entry("scene P", "b", Kind::Hulls, None),
        ];
        let (gaps, depths) = (gaps(&all), depths(&all));
        assert_eq!(gaps.series.len(), 1);
        assert_eq!(
            (gaps.series[0].points[0].x, gaps.series[0].points[0].y),
            (3.0, 6.0)
        );
        assert!(depths.series.is_empty());
    }

    #[test]
    fn only_a_method_that_answered_every_pair_stands_for_all_pairs() {
        let mut all = Vec::new();
        for scene in ["p", "q", "r"] {
            all.push(entry(scene, "a", Kind::Ours, Some(3.0)));
            all.push(entry(scene, "b", Kind::Hulls, (scene == "p").then_some(1.0)));
        }
        let chart = free_form(&all).expect("three pairs");
        assert_eq!(chart.series.len(), 1);
        assert_eq!(chart.series[0].points.len(), 1);
        assert!(free_form(&all[..1]).is_none(), "one pair is not all");
    }
}
