//! The view cube in the view's upper right corner: a click on a face, an edge or a corner turns the view there.
//!
//! The cube is seen from where the parts are, in the orthographic projection. Each face has three by three cells: its own, four of edges, four of
//! corners; cells around one edge or corner are one region. Faces can be reached by the keyboard.

use egui::{Align2, Color32, FontId, Id, Pos2, Rect, Role, Sense, Shape, Stroke, Ui, Vec2, WidgetInfo};
use glam::DVec3;

use super::theme;
use crate::viewport::camera::Camera;
use crate::viewport::gesture::Viewpoint;

/// Half of the cube's edge, points.
const HALF: f32 = 25.0;
/// Distance of the cube's middle from the corner of the view, points.
const ASIDE: f32 = 56.0;
/// Smallest view with a cube, points.
const LEAST: Vec2 = Vec2::new(420.0, 300.0);
/// Where cells meet, in halves of the edge.
const CELL: f64 = 0.58;
/// Cosine below which a face is seen too flat to be clicked.
const FLAT: f64 = 0.08;

/// Height and width that the cube takes in the corner of the view, points: 0 where it is not shown.
pub fn height(rect: Rect) -> f32 {
    if rect.width() < LEAST.x || rect.height() < LEAST.y {
        0.0
    } else {
        2.0 * ASIDE - 8.0
    }
}

/// Draws the cube in `rect`.
pub fn show(ui: &mut Ui, rect: Rect, view: &mut Viewpoint) {
    if height(rect) == 0.0 {
        return;
    }
    let middle = rect.right_top() + Vec2::new(-ASIDE, ASIDE);
    let cube = Cube::of(&view.camera, middle);
    let place = Rect::from_center_size(middle, Vec2::splat(2.0 * HALF * 1.75));
    let under = ui.interact(place, Id::unique("view cube"), Sense::CLICK);
    let pointer = ui
        .input(|i| i.pointer.hover_pos())
        .filter(|_| ui.rect_contains_pointer(place));
    let region = pointer.and_then(|at| cube.region(at));
    cube.draw(ui, region);
    let mut wanted = region.filter(|_| under.clicked());
    for region in cube.regions() {
        let sense = if is_face(region) {
            Sense::click()
        } else {
            Sense::CLICK
        };
        let around = Rect::from_center_size(cube.at(region * reach(region)), Vec2::splat(7.0));
        let id = Id::unique("view cube").with(region.to_array().map(|x| x as i32));
        let response = ui.interact(around, id, sense);
        response.widget_info(|| WidgetInfo::labeled(Role::Button, true, name(region)));
        if response.clicked() {
            wanted = Some(region);
        }
        if response.has_focus() {
            ui.painter().rect_stroke(
                around.expand(3.0),
                2.0,
                Stroke::new(1.5, theme::of(ui).accent),
                egui::StrokeKind::Outside,
            );
        }
        response.on_hover_text(name(region));
    }
    if let Some(region) = region {
        under.on_hover_text(name(region));
    }
    if let Some(from) = wanted {
        view.turn_to(from);
    }
}

/// Whether a region is a face: it has one component.
fn is_face(region: DVec3) -> bool {
    region.abs().element_sum() < 1.5
}

/// Factor from a region's direction to the middle of it on the cube.
fn reach(region: DVec3) -> f64 {
    if is_face(region) { 1.0 } else { 0.5 + 0.5 * CELL }
}

/// "View from top front right".
fn name(region: DVec3) -> String {
    let words = [
        (region.z, ["bottom", "top"]),
        (region.y, ["front", "back"]),
        (region.x, ["left", "right"]),
    ];
    let said = words.iter().filter(|(along, _)| *along != 0.0);
    let said: Vec<&str> = said
        .map(|(along, [low, high])| if *along < 0.0 { *low } else { *high })
        .collect();
    format!("View from {}", said.join(" "))
}

/// Name on a face.
fn title(normal: DVec3) -> String {
    let name = name(normal);
    let word = name.rsplit(' ').next().unwrap_or_default();
    let mut letters = word.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// The cube as it is seen.
struct Cube {
    middle: Pos2,
    right: DVec3,
    up: DVec3,
    backward: DVec3,
}

/// A face's normal and the directions of its sides.
type Side = [DVec3; 3];

impl Cube {
    fn of(camera: &Camera, middle: Pos2) -> Self {
        Self {
            middle,
            right: camera.right(),
            up: camera.up(),
            backward: camera.backward(),
        }
    }

    /// Place of a point of the cube whose half edge is 1.
    fn at(&self, point: DVec3) -> Pos2 {
        self.middle + HALF * Vec2::new(point.dot(self.right) as f32, -point.dot(self.up) as f32)
    }

    /// Faces that are seen, the flattest first.
    fn sides(&self) -> Vec<Side> {
        let mut sides: Vec<Side> = (0..6)
            .map(|i| {
                let axis = i % 3;
                let sign = if i < 3 { 1.0 } else { -1.0 };
                [
                    sign * DVec3::AXES[axis],
                    DVec3::AXES[(axis + 1) % 3],
                    DVec3::AXES[(axis + 2) % 3],
                ]
            })
            .filter(|side| side[0].dot(self.backward) > FLAT)
            .collect();
        sides.sort_by(|a, b| a[0].dot(self.backward).total_cmp(&b[0].dot(self.backward)));
        sides
    }

    /// The region at a place.
    fn region(&self, at: Pos2) -> Option<DVec3> {
        self.sides().into_iter().find_map(|[normal, u, v]| {
            let from = at - self.at(normal);
            let [u2, v2] = [u, v].map(|axis| self.at(axis) - self.middle);
            let area = u2.x * v2.y - u2.y * v2.x;
            let s = f64::from((from.x * v2.y - from.y * v2.x) / area);
            let t = f64::from((u2.x * from.y - u2.y * from.x) / area);
            (s.abs() <= 1.0 && t.abs() <= 1.0).then(|| normal + cell(s) * u + cell(t) * v)
        })
    }

    /// All regions that are seen.
    fn regions(&self) -> Vec<DVec3> {
        let mut found: Vec<DVec3> = Vec::new();
        for [normal, u, v] in self.sides() {
            for (s, t) in CELLS {
                let region = normal + s * u + t * v;
                if !found.contains(&region) {
                    found.push(region);
                }
            }
        }
        found
    }

    fn draw(&self, ui: &Ui, hovered: Option<DVec3>) {
        let ink = theme::of(ui);
        let painter = ui.painter();
        for side in self.sides() {
            let [normal, u, v] = side;
            let lit = 0.55 + 0.45 * normal.dot(self.backward) as f32;
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let place = |(s, t): (f64, f64)| self.at(normal + s * u + t * v);
            painter.add(Shape::convex_polygon(
                corners.map(place).to_vec(),
                blend(ink.ground, ink.control, lit),
                Stroke::new(1.0, ink.text_weak),
            ));
            for (s, t) in CELLS {
                if Some(normal + s * u + t * v) == hovered {
                    let ([s0, s1], [t0, t1]) = (span(s), span(t));
                    let cell = [(s0, t0), (s1, t0), (s1, t1), (s0, t1)];
                    let fill = ink.accent_dim;
                    painter.add(Shape::convex_polygon(
                        cell.map(place).to_vec(),
                        fill,
                        Stroke::NONE,
                    ));
                }
            }
            if normal.dot(self.backward) > 0.4 {
                painter.text(
                    self.at(normal),
                    Align2::CENTER_CENTER,
                    title(normal),
                    FontId::proportional(11.5),
                    ink.text_strong,
                );
            }
        }
    }
}

const CELLS: [(f64, f64); 9] = [
    (0.0, 0.0),
    (-1.0, 0.0),
    (1.0, 0.0),
    (0.0, -1.0),
    (0.0, 1.0),
    (-1.0, -1.0),
    (-1.0, 1.0),
    (1.0, -1.0),
    (1.0, 1.0),
];

/// Cell of a coordinate on a face: −1, 0 or 1.
fn cell(along: f64) -> f64 {
    if along.abs() <= CELL { 0.0 } else { along.signum() }
}

/// Coordinates that a cell covers.
fn span(cell: f64) -> [f64; 2] {
    match cell {
        c if c < 0.0 => [-1.0, -CELL],
        c if c > 0.0 => [CELL, 1.0],
        _ => [-CELL, CELL],
    }
}

fn blend(from: Color32, to: Color32, share: f32) -> Color32 {
    let mix = |i: usize| {
        let (a, b) = (f32::from(from.to_array()[i]), f32::from(to.to_array()[i]));
        (a + share * (b - a)).round() as u8
    };
    Color32::from_rgb(mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_region_that_is_seen_is_found_where_it_is() {
        for (yaw, pitch) in [(-0.9, 0.42), (0.3, -0.6), (2.5, 1.1), (-1.57, 0.0)] {
            let camera = Camera {
                yaw,
                pitch,
                ..Camera::default()
            };
            let cube = Cube::of(&camera, Pos2::new(200.0, 100.0));
            let regions = cube.regions();
            assert!(regions.len() == 19 || regions.len() == 9, "{}", regions.len());
            for region in regions {
                // A place within the region, on a face that is seen.
                let sides = cube.sides();
                let side = sides
                    .iter()
                    .find(|side| side[0].dot(region) > 0.5)
                    .expect("on a face");
                let on = |axis: DVec3| axis * (0.8 * axis.dot(region));
                let found = cube.region(cube.at(side[0] + on(side[1]) + on(side[2])));
                assert_eq!(found, Some(region), "at {yaw} {pitch}");
            }
            assert_eq!(cube.region(Pos2::new(0.0, 0.0)), None);
        }
    }

    #[test]
    fn regions_are_named_by_where_one_looks_from() {
        assert_eq!(name(-DVec3::Y), "View from front");
        assert_eq!(name(DVec3::new(1.0, -1.0, 1.0)), "View from top front right");
        assert_eq!(name(DVec3::new(-1.0, 0.0, -1.0)), "View from bottom left");
        assert_eq!(title(DVec3::Z), "Top");
    }
}
