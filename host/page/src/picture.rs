//! A picture of parts by a depth buffer: parallel projection from above, flat faces with light from the viewer's left, edges, and the way of what moves.
//!
//! It is drawn at twice its size and averaged, so that edges are smooth.

use glam::{DAffine3, DVec2, DVec3};
use mortise_brep::Shape;

/// Direction from the scene to the viewer, before it is made a unit vector; and to the light.
const VIEWER: DVec3 = DVec3::new(0.62, -0.78, 0.55);
const LIGHT: DVec3 = DVec3::new(-0.15, -0.75, 0.65);
/// Share of light that every face has.
const AMBIENT: f64 = 0.5;
/// Samples of a pixel along a side.
const SAMPLES: usize = 2;
/// Share of the picture that is left free around the parts.
const MARGIN: f64 = 0.06;
/// How much nearer than its faces an edge is drawn, as a share of the scene's size.
const EDGE_BIAS: f64 = 2e-3;
/// Colours, sRGB: paper, edges, and the way of what moves.
const PAPER: [f64; 3] = [1.0, 1.0, 1.0];
const INK: [f64; 3] = [0.16, 0.2, 0.25];
const WAY: [f64; 3] = [0.80, 0.27, 0.05];

/// A part to draw.
#[derive(Clone, Copy)]
pub struct Drawn<'a> {
    /// Its shape.
    pub shape: &'a Shape,
    /// Shape frame to scene.
    pub pose: DAffine3,
    /// sRGB, 0 to 1.
    pub color: [f64; 3],
}

/// Pixels, sRGB, in rows from above.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Three bytes a pixel.
    pub rgb: Vec<u8>,
}

impl Picture {
    /// The picture at half its size, each pixel the mean of four. A last row or column of an odd size is left out.
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut rgb = Vec::with_capacity(3 * width * height);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            for c in 0..3 {
                let four = [(0, 0), (0, 1), (1, 0), (1, 1)]
                    .map(|(j, i)| u32::from(self.rgb[3 * ((2 * y + j) * self.width + 2 * x + i) + c]));
                rgb.push(((four.iter().sum::<u32>() + 2) / 4) as u8);
            }
        }
        Self { width, height, rgb }
    }
}

/// Draws parts and a line along `way`. All of them fit into the picture.
///
/// Cost: each triangle's pixels; some milliseconds for 10,000 triangles.
pub fn picture(parts: &[Drawn<'_>], way: &[DVec3], [width, height]: [usize; 2]) -> Picture {
    let mut canvas = Canvas::new([width * SAMPLES, height * SAMPLES], parts, way);
    for part in parts {
        canvas.faces(part);
    }
    for part in parts {
        canvas.edges(part);
    }
    for pair in way.windows(2) {
        canvas.line(pair[0], pair[1], WAY, f64::INFINITY, 1);
    }
    canvas.averaged()
}

/// Depth buffer and its view.
struct Canvas {
    size: [usize; 2],
    /// To the right, up, and to the viewer.
    right: DVec3,
    up: DVec3,
    viewer: DVec3,
    middle: DVec2,
    pixels_a_mm: f64,
    /// Depth that an edge is moved by, mm.
    bias: f64,
    color: Vec<[f64; 3]>,
    depth: Vec<f64>,
}

impl Canvas {
    fn new(size: [usize; 2], parts: &[Drawn<'_>], way: &[DVec3]) -> Self {
        let viewer = VIEWER.normalize();
        let right = DVec3::Z.cross(viewer).normalize();
        let up = viewer.cross(right);
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let points = parts.iter().flat_map(|part| {
            (part.shape.mesh.vertices.iter()).map(|&vertex| part.pose.transform_point3(vertex))
        });
        for point in points.chain(way.iter().copied()) {
            let at = DVec2::new(point.dot(right), point.dot(up));
            (low, high) = (low.min(at), high.max(at));
        }
        if !low.is_finite() || !high.is_finite() {
            (low, high) = (DVec2::ZERO, DVec2::ONE);
        }
        let room = DVec2::new(size[0] as f64, size[1] as f64) * (1.0 - 2.0 * MARGIN);
        let extent = (high - low).max(DVec2::splat(1e-9));
        Self {
            size,
            right,
            up,
            viewer,
            middle: (low + high) / 2.0,
            pixels_a_mm: (room / extent).min_element(),
            bias: EDGE_BIAS * extent.length(),
            color: vec![PAPER; size[0] * size[1]],
            depth: vec![f64::NEG_INFINITY; size[0] * size[1]],
        }
    }

    /// Place of a point in samples from above left, and its depth, nearer is more, mm.
    fn place(&self, p: DVec3) -> DVec3 {
        let at = DVec2::new(p.dot(self.right), p.dot(self.up)) - self.middle;
        let [width, height] = self.size.map(|n| n as f64);
        DVec3::new(
            width / 2.0 + at.x * self.pixels_a_mm,
            height / 2.0 - at.y * self.pixels_a_mm,
            p.dot(self.viewer),
        )
    }

    fn set(&mut self, x: i64, y: i64, depth: f64, color: [f64; 3]) {
        let [width, height] = self.size.map(|n| n as i64);
        if x < 0 || y < 0 || x >= width || y >= height {
            return;
        }
        let at = (y * width + x) as usize;
        if depth > self.depth[at] {
            (self.depth[at], self.color[at]) = (depth, color);
        }
    }

    fn faces(&mut self, part: &Drawn<'_>) {
        let mesh = &part.shape.mesh;
        let light = LIGHT.normalize();
        for triangle in &mesh.triangles {
            let corners = triangle.map(|v| part.pose.transform_point3(mesh.vertices[v as usize]));
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let Some(normal) = normal.try_normalize() else {
                continue;
            };
            // An open shape shows the inside of its faces, too.
            let normal = normal * normal.dot(self.viewer).signum();
            let bright = AMBIENT + (1.0 - AMBIENT) * (0.5 + 0.5 * normal.dot(light));
            self.triangle(corners.map(|p| self.place(p)), part.color.map(|c| c * bright));
        }
    }

    fn triangle(&mut self, [a, b, c]: [DVec3; 3], color: [f64; 3]) {
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let [width, height] = self.size.map(|n| n as f64 - 1.0);
        let range = |low: f64, high: f64, most: f64| {
            low.floor().clamp(0.0, most) as i64..=high.ceil().clamp(0.0, most) as i64
        };
        for y in range(low.y, high.y, height) {
            for x in range(low.x, high.x, width) {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let weight =
                    |u: DVec3, v: DVec3| (v.truncate() - u.truncate()).perp_dot(p - u.truncate()) / area;
                let (of_c, of_a, of_b) = (weight(a, b), weight(b, c), weight(c, a));
                if of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0 {
                    self.set(x, y, of_a * a.z + of_b * b.z + of_c * c.z, color);
                }
            }
        }
    }

    fn edges(&mut self, part: &Drawn<'_>) {
        for edge in &part.shape.edges {
            // A seam is no edge of the solid.
            if edge.faces.len() == 2 && edge.faces[0] == edge.faces[1] {
                continue;
            }
            for pair in edge.polyline.windows(2) {
                let [p, q] = [pair[0], pair[1]].map(|p| part.pose.transform_point3(p));
                self.line(p, q, INK, self.bias, 0);
            }
        }
    }

    /// A line drawn `bias` nearer than it is, `reach` samples wide to either side.
    fn line(&mut self, from: DVec3, to: DVec3, color: [f64; 3], bias: f64, reach: i64) {
        let (a, b) = (self.place(from), self.place(to));
        let steps = (b - a).truncate().abs().max_element().ceil().clamp(1.0, 1e4);
        for i in 0..=steps as i64 {
            let p = a.lerp(b, i as f64 / steps);
            for (dx, dy) in (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| (x, y))) {
                self.set(p.x as i64 + dx, p.y as i64 + dy, p.z + bias, color);
            }
        }
    }

    fn averaged(&self) -> Picture {
        let [width, height] = self.size.map(|n| n / SAMPLES);
        let mut rgb = Vec::with_capacity(3 * width * height);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let mut sum = [0.0; 3];
            for (j, i) in (0..SAMPLES).flat_map(|j| (0..SAMPLES).map(move |i| (j, i))) {
                let sample = self.color[(y * SAMPLES + j) * self.size[0] + x * SAMPLES + i];
                sum = [0, 1, 2].map(|c| sum[c] + sample[c]);
            }
            let mean = sum.map(|c| c / (SAMPLES * SAMPLES) as f64);
            rgb.extend(mean.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8));
        }
        Picture { width, height, rgb }
    }
}

#[cfg(test)]
mod tests {
    use mortise_brep::Mesh;

    use super::*;

    /// A square plate of this size in the plane z = 0, of two triangles.
    fn plate(size: f64) -> Shape {
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0) * size;
        Shape {
            mesh: Mesh {
                vertices: vec![
                    corner(-0.5, -0.5),
                    corner(0.5, -0.5),
                    corner(0.5, 0.5),
                    corner(-0.5, 0.5),
                ],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                triangle_face: vec![0, 0],
            },
            ..Shape::default()
        }
    }

    fn count(picture: &Picture, is: impl Fn(&[u8]) -> bool) -> usize {
        picture.rgb.chunks(3).filter(|pixel| is(pixel)).count()
    }

    const RED: [f64; 3] = [0.9, 0.1, 0.1];
    const BLUE: [f64; 3] = [0.1, 0.1, 0.9];

    fn is_red(pixel: &[u8]) -> bool {
        pixel[0] / 2 > pixel[2]
    }

    fn is_blue(pixel: &[u8]) -> bool {
        pixel[2] / 2 > pixel[0]
    }

    /// The area that a plate covers is that of its parallelogram in the picture.
    #[test]
    fn a_plate_covers_its_projected_area() {
        let shape = plate(10.0);
        let part = Drawn {
            shape: &shape,
            pose: DAffine3::IDENTITY,
            color: RED,
        };
        let size = [300, 220];
        let drawn = picture(&[part], &[], size);
        assert_eq!(drawn.rgb.len(), 3 * size[0] * size[1]);
        let canvas = Canvas::new(size, &[part], &[]);
        let area = 100.0 * VIEWER.normalize().z * canvas.pixels_a_mm.powi(2);
        let found = count(&drawn, is_red) as f64;
        assert!((found - area).abs() < 0.02 * area, "{found} of {area}");
    }

    /// What is nearer to the viewer hides what is behind it, in either order of drawing.
    #[test]
    fn the_nearer_part_hides_the_other() {
        let (small, large) = (plate(4.0), plate(20.0));
        let below = Drawn {
            shape: &large,
            pose: DAffine3::IDENTITY,
            color: BLUE,
        };
        let at = |z: f64| Drawn {
            shape: &small,
            pose: DAffine3::from_translation(DVec3::new(0.0, 0.0, z)),
            color: RED,
        };
        for parts in [[below, at(1.0)], [at(1.0), below]] {
            let drawn = picture(&parts, &[], [200, 150]);
            assert!(count(&drawn, is_red) > 100 && count(&drawn, is_blue) > 1000);
        }
        let hidden = picture(&[below, at(-1.0)], &[], [200, 150]);
        assert_eq!(count(&hidden, is_red), 0);
    }

    /// Half of it has the same mean, also of an odd size, and nothing stays of a single pixel.
    #[test]
    fn half_of_a_picture_has_its_mean() {
        let shape = plate(10.0);
        let part = Drawn {
            shape: &shape,
            pose: DAffine3::IDENTITY,
            color: RED,
        };
        let mean = |p: &Picture| p.rgb.iter().map(|v| f64::from(*v)).sum::<f64>() / p.rgb.len() as f64;
        let whole = picture(&[part], &[], [120, 90]);
        let half = whole.halved();
        assert_eq!([half.width, half.height], [60, 45]);
        assert_eq!(half.rgb.len(), 3 * 60 * 45);
        assert!((mean(&half) - mean(&whole)).abs() < 0.5, "rounding of a byte");
        let odd = half.halved();
        assert_eq!([odd.width, odd.height, odd.rgb.len()], [30, 22, 3 * 30 * 22]);
        assert!(picture(&[part], &[], [1, 1]).halved().rgb.is_empty());
    }

    /// Nothing, points at one place and values that are no numbers are drawn without a fault.
    #[test]
    fn degenerate_scenes_are_drawn() {
        assert_eq!(count(&picture(&[], &[], [8, 6]), |p| p != [255; 3]), 0);
        let point = plate(0.0);
        let endless = DAffine3::from_translation(DVec3::splat(f64::NAN));
        for pose in [DAffine3::IDENTITY, endless] {
            let part = Drawn {
                shape: &point,
                pose,
                color: RED,
            };
            picture(&[part], &[DVec3::ZERO, DVec3::X], [8, 6]);
        }
    }
}
