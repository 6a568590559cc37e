//! A measurement in words and numbers. Lengths in mm to a tenth of a micrometre, angles in degrees to a ten-thousandth.

use mortise_brep::Surface;
use mortise_inspect::measure::{About, Angle, Comparison, Radial};

/// A name and a value.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// What is measured.
    pub name: &'static str,
    /// Its value with its unit.
    pub value: String,
}

fn line(name: &'static str, value: String) -> Line {
    Line { name, value }
}

/// A number with at most four decimals, without zeros at its end.
fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

/// A length, mm.
pub fn mm(value: f64) -> String {
    format!("{} mm", number(value))
}

/// An angle, rad.
fn degrees(value: f64) -> String {
    format!("{}°", number(value.to_degrees()))
}

fn place(at: glam::DVec3) -> String {
    format!("{}, {}, {} mm", number(at.x), number(at.y), number(at.z))
}

/// What a feature is, in one or two words.
pub fn kind(about: &About) -> &'static str {
    match about {
        About::Point { .. } => "Point",
        About::Line { .. } => "Straight edge",
        About::Circle { closed: true, .. } => "Circle",
        About::Circle { .. } => "Arc",
        About::Curve { .. } => "Curved edge",
        About::Axis { .. } => "Axis",
        About::Face { surface, hollow, .. } => match (surface, hollow) {
            (Surface::Plane { .. }, _) => "Flat face",
            (Surface::Cylinder { .. }, true) => "Cylindrical hole",
            (Surface::Cylinder { .. }, false) => "Cylinder",
            (Surface::Cone { .. }, true) => "Conical hole",
            (Surface::Cone { .. }, false) => "Cone",
            (Surface::Sphere { .. }, true) => "Spherical hollow",
            (Surface::Sphere { .. }, false) => "Sphere",
            (Surface::Torus { .. }, _) => "Torus",
            (Surface::Spline, _) => "Free-form face",
        },
    }
}

/// What is known of one feature, the main value first.
pub fn one(about: &About) -> Vec<Line> {
    let round = |radius: f64| [line("Diameter", mm(2.0 * radius)), line("Radius", mm(radius))];
    let mut lines = Vec::new();
    match about {
        About::Point { at } => lines.push(line("Position", place(*at))),
        About::Line { length_mm } | About::Curve { length_mm } => lines.push(line("Length", mm(*length_mm))),
        About::Circle {
            radius_mm,
            length_mm,
            center,
            ..
        } => {
            lines.extend(round(*radius_mm));
            lines.push(line("Length", mm(*length_mm)));
            lines.push(line("Centre", place(*center)));
        }
        About::Axis {
            line: axis,
            radius_mm,
        } => {
            lines.extend(radius_mm.map(round).into_iter().flatten());
            lines.push(line("Through", place(axis.origin)));
        }
        About::Face {
            area_mm2, surface, ..
        } => {
            match surface {
                Surface::Cylinder { radius, .. } | Surface::Sphere { radius, .. } => {
                    lines.extend(round(*radius));
                }
                Surface::Cone { half_angle, .. } => {
                    lines.push(line("Full angle", degrees(2.0 * half_angle.abs())));
                }
                Surface::Torus { major, minor, .. } => {
                    lines.push(line("Tube diameter", mm(2.0 * minor)));
                    lines.push(line("Ring diameter", mm(2.0 * major)));
                }
                Surface::Plane { .. } | Surface::Spline => {}
            }
            lines.push(line("Area", format!("{} mm²", number(*area_mm2))));
        }
    }
    lines
}

/// How two features lie to each other, the distance first.
pub fn two(found: &Comparison) -> Vec<Line> {
    let [from, to] = found.least.ends;
    let by = to - from;
    let sure = if found.error_mm > 0.0 {
        format!(" ± {}", mm(found.error_mm.max(1e-4)))
    } else {
        String::new()
    };
    let mut lines = vec![line("Distance", mm(found.least.distance_mm) + &sure)];
    if let Some(Radial { clearance_mm, fit }) = found.radial {
        let name = match (fit, clearance_mm < 0.0) {
            (true, false) => "Radial clearance",
            (true, true) => "Radial interference",
            (false, _) => "Difference of radii",
        };
        lines.push(line(name, mm(clearance_mm.abs())));
    }
    lines.extend(found.planes_mm.map(|value| line("Between the planes", mm(value))));
    lines.extend(found.axes_mm.map(|value| line("Between the axes", mm(value))));
    lines.extend(found.angle.map(|angle| match angle {
        Angle::Lines(value) => line("Angle", degrees(value)),
        Angle::Planes(value) => line("Angle of the planes", degrees(value)),
        Angle::LinePlane(value) => line("Angle to the plane", degrees(value)),
    }));
    lines.extend([
        line("Along x", mm(by.x)),
        line("Along y", mm(by.y)),
        line("Along z", mm(by.z)),
    ]);
    lines
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use mortise_inspect::measure::Least;

    use super::*;

    #[test]
    fn numbers_have_no_zeros_at_their_end() {
        for (value, text) in [
            (12.5, "12.5 mm"),
            (-0.00001, "0 mm"),
            (100.0, "100 mm"),
            (0.12344, "0.1234 mm"),
            (-3.25, "-3.25 mm"),
        ] {
            assert_eq!(mm(value), text);
        }
        assert_eq!(degrees(std::f64::consts::FRAC_PI_4), "45°");
    }

    #[test]
    fn a_comparison_is_said_with_its_bound_and_its_sign() {
        let found = Comparison {
            least: Least {
                distance_mm: 5.0,
                ends: [DVec3::ZERO, DVec3::new(3.0, 0.0, -4.0)],
            },
            error_mm: 2.5e-4,
            angle: Some(Angle::LinePlane(0.0)),
            axes_mm: None,
            planes_mm: None,
            radial: Some(Radial {
                clearance_mm: -0.01,
                fit: true,
            }),
        };
        let words: Vec<String> = (two(&found).iter())
            .map(|line| format!("{}: {}", line.name, line.value))
            .collect();
        assert_eq!(
            words,
            [
                "Distance: 5 mm ± 0.0003 mm",
                "Radial interference: 0.01 mm",
                "Angle to the plane: 0°",
                "Along x: 3 mm",
                "Along y: 0 mm",
                "Along z: -4 mm",
            ]
        );
    }
}
