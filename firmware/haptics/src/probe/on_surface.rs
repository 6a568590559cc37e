//! Where a point lies against a shape by its field: inside, outside or on the surface, only as far as that is proven.

use glam::DVec3;
use mortise_protocol::image::{EDGE_ERROR_CELLS, Place, SHAPE_LEAKY, Shape};

use crate::collision::exact_surface::{closed_form, exact};
use crate::probe::face_distance::wide;

/// A point is on a surface within this distance and rounding, m.
pub(crate) const ON_SURFACE_M: f64 = 1e-7;
/// Share of a shape's size that the field's single precision rounds off.
const ROUNDING: f64 = 3e-7;

/// Answer of a field at a point.
#[derive(Clone, Copy)]
pub(crate) struct Located {
    /// Signed distance of no larger magnitude than the true one, m; zero where the sign is not known.
    pub least: f64,
    /// Whether it comes from exact surfaces.
    pub sure: bool,
}

/// Whether a point of a face's unbounded surface belongs to a shape.
#[derive(Clone, Copy)]
pub(crate) struct Foot {
    /// Lower bound of its distance from the shape's surface, m.
    pub off: f64,
    /// Whether it is proven to lie on the surface.
    pub on: bool,
    /// Whether the field is exact there.
    pub sure: bool,
}

/// `p` on a face of outward normal `n`: on the shape's surface where the shape is inside behind it and outside before it, closer than `tolerance`. Exactly
/// on a border of cells a bound of zero would prove nothing.
pub(crate) fn foot(shape: &Shape<'_>, p: DVec3, n: DVec3, tolerance: f64) -> Foot {
    let here = locate(shape, p);
    let off = here.least.abs();
    if off > tolerance {
        return Foot {
            off,
            on: false,
            sure: here.sure,
        };
    }
    let [behind, before] = [-tolerance, tolerance].map(|by| locate(shape, p + n * by));
    let sure = behind.sure && before.sure;
    Foot {
        off,
        on: sure && behind.least < 0.0 && before.least > 0.0,
        sure,
    }
}

/// Answer of the field of `shape` at `p` (m, shape frame).
pub(crate) fn locate(shape: &Shape<'_>, p: DVec3) -> Located {
    let p = p.as_vec3();
    match shape.field.place(p.to_array()) {
        Place::Far { inside, bound } => Located {
            least: f64::from(if inside { -bound } else { bound }),
            sure: false,
        },
        Place::Cell(cell) => match exact(shape.surfaces(), shape.field.nearby(&cell), p) {
            Some((distance, _)) => Located {
                least: f64::from(distance),
                sure: true,
            },
            None => {
                let record = shape.field.record();
                let found = shape.field.distance(&cell);
                let least = found.abs().min(record.band) - EDGE_ERROR_CELLS * record.cell;
                let least = f64::from(least.max(0.0));
                Located {
                    least: if found < 0.0 { -least } else { least },
                    sure: false,
                }
            }
        },
    }
}

/// Whether the search covers all of a shape: analytic faces that close.
pub(crate) fn covered(shape: &Shape<'_>) -> bool {
    closed_form(shape) && shape.record.flags & SHAPE_LEAKY == 0
}

/// Whether `p` is proven to lie inside the shape.
pub(crate) fn is_inside(shape: &Shape<'_>, p: DVec3) -> bool {
    let found = locate(shape, p);
    found.least < -on_surface(shape)
}

/// Distance within which a point is on a shape's surface, m.
pub(crate) fn on_surface(shape: &Shape<'_>) -> f64 {
    let size = f64::from(shape.record.radius) + wide(shape.record.center).length();
    ON_SURFACE_M + ROUNDING * size
}
