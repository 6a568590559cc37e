//! Gap, depth and contact forces of two parts at given poses, by the force law's own trees and fields.
//!
//! Interface for external comparisons: poses come from a CSV file, the scene from a STEP file or a baked image, and each row states the gap or depth,
//! the contacts, the work of the search, and its time on this computer. The distance is that of [`mortise_haptics::Probe`], unmodified.

use std::fmt;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use glam::{DQuat, DVec3};
use mortise_bake::{BakeOptions, Grabbable, Method, PointshellKind, bake};
use mortise_brep::load_step;
use mortise_haptics::{Pose, Prober, Quat, Settings, Vec3};
use mortise_protocol::image::{MAGIC, NO_FACE, SceneImage};
use serde::Serialize;

use crate::error::ScenarioError;

/// Columns of a pose file, in any order.
pub const COLUMNS: [&str; 8] = ["name", "x", "y", "z", "qw", "qx", "qy", "qz"];
/// Tolerance of a quaternion's length: rounding to four decimals uses half of it.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Largest number of poses in a file: each is some kilobytes of work, and a larger file is a mistake.
const MAX_POSES: usize = 1_000_000;
/// Repetitions of each query: other load on the computer only lengthens it, so the shortest time is used.
const REPEATS: usize = 33;
/// A query that takes longer is made once, ns.
const LONG_NS: u64 = 5_000_000;
/// Largest coordinate of a position, mm: the force law's limit.
const FARTHEST_MM: f64 = 100e3;

/// One line of a pose file.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPose {
    /// Name of the pose.
    pub name: String,
    /// Origin of the moving part in the fixed part's frame, mm.
    pub position_mm: DVec3,
    /// Rotation from moving to fixed part, unit length.
    pub orientation: DQuat,
}

/// Reads a pose file: CSV, a first line with the [`COLUMNS`], numbers in mm, quaternions of unit length. Skips empty lines and lines that begin with
/// `#`.
///
/// # Errors
/// `Unreadable`; `Input` with the line and its error.
pub fn read_poses(path: &Path) -> Result<Vec<NamedPose>, ScenarioError> {
    let text = std::fs::read_to_string(path).map_err(|source| ScenarioError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    parse_poses(&text).map_err(|(line, what)| ScenarioError::Input {
        name: format!("{}:{line}", path.display()),
        what,
    })
}

/// As [`read_poses`], from the text; an error includes its line number.
fn parse_poses(text: &str) -> Result<Vec<NamedPose>, (usize, String)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = (text.lines().enumerate())
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let expected = COLUMNS.join(",");
    let (line, header) = lines
        .next()
        .ok_or_else(|| (1, format!("no poses; begin with the line `{expected}`")))?;
    let header: Vec<&str> = header.split(',').map(cell).collect();
    let mut places = [0; COLUMNS.len()];
    for (place, column) in places.iter_mut().zip(COLUMNS) {
        *place = (header.iter().position(|&h| h == column)).ok_or_else(|| {
            (
                line,
                format!("no column `{column}`; begin with the line `{expected}`"),
            )
        })?;
    }
    let mut poses = Vec::new();
    for (line, text) in lines {
        if poses.len() == MAX_POSES {
            return Err((line, format!("more than {MAX_POSES} poses; split the file")));
        }
        let cells: Vec<&str> = text.split(',').map(cell).collect();
        poses.push(pose(&cells, header.len(), &places).map_err(|what| (line, what))?);
    }
    if poses.is_empty() {
        return Err((line, "no poses below the header; add at least one line".into()));
    }
    Ok(poses)
}

/// A cell without surrounding blanks and quotation marks.
fn cell(text: &str) -> &str {
    text.trim().trim_matches('"')
}

fn pose(cells: &[&str], columns: usize, places: &[usize; COLUMNS.len()]) -> Result<NamedPose, String> {
    if cells.len() != columns {
        return Err(format!(
            "{} cells under {columns} columns; give every column one",
            cells.len()
        ));
    }
    let number = |index: usize| {
        let (column, text) = (COLUMNS[index], cells[places[index]]);
        let value: f64 = text
            .parse()
            .map_err(|_| format!("{column} is `{text}`; give a number"))?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(format!("{column} is {text}; give a finite number"))
        }
    };
    let position_mm = DVec3::new(number(1)?, number(2)?, number(3)?);
    if position_mm.abs().max_element() > FARTHEST_MM {
        return Err(format!(
            "the position is beyond {FARTHEST_MM} mm; give millimetres"
        ));
    }
    let [qw, qx, qy, qz] = [number(4)?, number(5)?, number(6)?, number(7)?];
    let orientation = DQuat::from_xyzw(qx, qy, qz, qw);
    let length = orientation.length();
    if (length - 1.0).abs() > UNIT_TOLERANCE {
        return Err(format!(
            "the quaternion's length is {length:.6}; give qw,qx,qy,qz of length 1"
        ));
    }
    Ok(NamedPose {
        name: cells[places[0]].to_owned(),
        position_mm,
        orientation: orientation.normalize(),
    })
}

/// A scene to probe, from a STEP file or an image.
pub struct ProbeScene {
    /// Name for messages.
    name: String,
    /// The image as words, for alignment.
    image: Vec<u32>,
    /// Names of its parts; an image has no names, and its parts are numbers.
    parts: Vec<String>,
}

/// Options for baking a STEP file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Model {
    /// Cell edge, mm; `None`: as [`BakeOptions`] chooses.
    pub cell_mm: Option<f64>,
    /// Contact method; `None`: as [`BakeOptions`] chooses, or that of the image.
    pub method: Option<Method>,
    /// Kind of the pointshells.
    pub shell: PointshellKind,
}

/// A moving part and a fixed one, by their indices in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The part that is placed.
    pub moving: u16,
    /// The part it is placed against.
    pub fixed: u16,
}

impl ProbeScene {
    /// Reads `path`: a baked image unchanged, a STEP file baked with cells of `cell_mm` (`None`: as [`BakeOptions`] chooses).
    ///
    /// # Errors
    /// `Unreadable`, `Brep`, `Bake`; `Input` for a damaged image, or an image together with a cell size.
    pub fn load(path: &Path, cell_mm: Option<f64>) -> Result<Self, ScenarioError> {
        let model = Model {
            cell_mm,
            ..Model::default()
        };
        Self::load_by(path, &model)
    }

    /// As [`Self::load`], a STEP file baked as `model` specifies.
    ///
    /// # Errors
    /// As [`Self::load`]; `Input` for an image of another method.
    pub fn load_by(path: &Path, model: &Model) -> Result<Self, ScenarioError> {
        let cell_mm = model.cell_mm;
        let name = path.display().to_string();
        let unreadable = |source| ScenarioError::Unreadable {
            path: path.to_owned(),
            source,
        };
        let bytes = std::fs::read(path).map_err(unreadable)?;
        if !bytes.starts_with(&MAGIC) {
            return Self::bake(
                path,
                &BakeOptions {
                    method: model.method.unwrap_or_default(),
                    shell: model.shell,
                    cell_mm,
                    // For an accurate probe: the shell's error is at most the field's on the radii of common parts.
                    epsilon_mm: cell_mm.map(|cell| cell / 100.0),
                    grabbable: Grabbable::All,
                    // A scene to probe need not fit a board.
                    image_limit_bytes: if cell_mm.is_some() {
                        u64::from(u32::MAX)
                    } else {
                        1 << 20
                    },
                    ..BakeOptions::default()
                },
            );
        }
        let bad = |what: String| ScenarioError::Input {
            name: name.clone(),
            what,
        };
        if cell_mm.is_some() {
            return Err(bad(
                "an image has its cells already; leave the cell size out".into()
            ));
        }
        let image = words(&bytes);
        let scene = SceneImage::open(bytemuck::cast_slice(&image))
            .map_err(|error| bad(format!("{error}; bake it again")))?;
        let voxels = (0..scene.shape_count()).any(|shape| scene.shape(shape).field.is_occupancy());
        if model
            .method
            .is_some_and(|method| (method == Method::Occupancy) != voxels)
        {
            return Err(bad(
                "an image has its method already, and it is the other one; bake the STEP file again".into(),
            ));
        }
        let parts = (0..scene.parts().len()).map(|index| index.to_string()).collect();
        Ok(Self { name, image, parts })
    }

    /// The scene of an image that the baker wrote, with the names of its parts; `name` is used in messages.
    pub fn of_image(name: String, image: &[u8], parts: Vec<String>) -> Self {
        Self {
            name,
            image: words(image),
            parts,
        }
    }

    /// Reads the STEP file at `path` and bakes it with `options`.
    ///
    /// # Errors
    /// `Unreadable`, `Brep`, `Bake`.
    pub fn bake(path: &Path, options: &BakeOptions) -> Result<Self, ScenarioError> {
        let name = path.display().to_string();
        let model = load_step(path)?;
        let baked =
            bake(&model, options, &|_| ControlFlow::Continue(())).map_err(|source| ScenarioError::Bake {
                step: name.clone(),
                source,
            })?;
        let parts = baked.report.parts.into_iter().map(|part| part.name).collect();
        Ok(Self::of_image(name, &baked.image, parts))
    }

    /// Size of the image in bytes, rounded up to a multiple of four.
    pub fn image_bytes(&self) -> usize {
        size_of_val(self.image.as_slice())
    }

    /// The parts of these names; `fixed` may be omitted in a scene of two parts.
    ///
    /// # Errors
    /// `NoSuchPart`; `Input` when `fixed` is omitted and ambiguous, or both names are one part.
    pub fn pair(&self, moving: &str, fixed: Option<&str>) -> Result<Pair, ScenarioError> {
        let moving = self.part(moving)?;
        let bad = |what: String| ScenarioError::Input {
            name: self.name.clone(),
            what,
        };
        let fixed = match fixed {
            Some(name) => self.part(name)?,
            None if self.parts.len() == 2 => 1 - moving,
            None => {
                return Err(bad(format!(
                    "{} parts; say with --against which one is fixed: {}",
                    self.parts.len(),
                    self.parts.join(", ")
                )));
            }
        };
        if moving == fixed {
            return Err(bad("a part has no distance to itself; choose two parts".into()));
        }
        Ok(Pair { moving, fixed })
    }

    fn part(&self, name: &str) -> Result<u16, ScenarioError> {
        (self.parts.iter().position(|part| part == name))
            .and_then(|index| u16::try_from(index).ok())
            .ok_or_else(|| ScenarioError::NoSuchPart {
                step: self.name.clone(),
                part: name.to_owned(),
                known: self.parts.join(", "),
            })
    }

    /// Probes one pose, repeatedly to find the shortest time.
    ///
    /// # Errors
    /// `Input` when the force law refuses the pose.
    pub fn probe(&self, pair: Pair, named: &NamedPose) -> Result<ProbeRow, ScenarioError> {
        self.answer(&self.scene()?, &mut Box::new(Prober::new()), pair, named, REPEATS)
    }

    /// Probes many poses, each once.
    ///
    /// # Errors
    /// As [`Self::probe`].
    pub fn probe_all(&self, pair: Pair, poses: &[NamedPose]) -> Result<Vec<ProbeRow>, ScenarioError> {
        let (scene, mut prober) = (self.scene()?, Box::new(Prober::new()));
        (poses.iter())
            .map(|named| self.answer(&scene, &mut prober, pair, named, 1))
            .collect()
    }

    /// Refusal of a pose.
    pub(crate) fn refused(&self, named: &NamedPose, why: &str) -> ScenarioError {
        ScenarioError::Input {
            name: format!("{}, pose `{}`", self.name, named.name),
            what: why.to_owned(),
        }
    }

    pub(crate) fn scene(&self) -> Result<SceneImage<'_>, ScenarioError> {
        // The image was opened before, so this fails only by a bug, which is then reported.
        SceneImage::open(bytemuck::cast_slice(&self.image)).map_err(|error| ScenarioError::Input {
            name: self.name.clone(),
            what: error.to_string(),
        })
    }

    fn answer(
        &self,
        scene: &SceneImage<'_>,
        prober: &mut Prober,
        pair: Pair,
        named: &NamedPose,
        repeats: usize,
    ) -> Result<ProbeRow, ScenarioError> {
        let [x, y, z, w] = named.orientation.as_quat().to_array();
        let pose = Pose::new(
            Vec3::from_array((1e-3 * named.position_mm).as_vec3().to_array()),
            Quat::from_xyzw(x, y, z, w),
        );
        let settings = Settings::default().contact;
        let (mut least_ns, mut result) = (u64::MAX, None);
        for _ in 0..repeats {
            let start = Instant::now();
            let found = prober.probe(scene, pair.moving, pair.fixed, black_box(&pose), &settings);
            let taken = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
            result = Some(black_box(found).map_err(|error| self.refused(named, &error.to_string()))?);
            least_ns = least_ns.min(taken);
            if taken > LONG_NS {
                break;
            }
        }
        let found = result.ok_or_else(|| self.refused(named, "nothing was asked"))?;
        let com = scene
            .shape_of_part(usize::from(pair.moving))
            .record
            .center_of_mass;
        let center = pose.transform_point(Vec3::from_array(com));
        let mm = |arm: Vec3| (center + arm).to_array().map(|x| 1e3 * f64::from(x));
        let face = |face: u16| (face != NO_FACE).then_some(face);
        let nearest = found.nearest;
        let voxels = scene.shape_of_part(usize::from(pair.fixed)).field.is_occupancy();
        Ok(ProbeRow {
            name: named.name.clone(),
            distance_mm: 1e3 * f64::from(nearest.distance_m),
            field_distance_mm: (nearest.field_distance_m.is_finite())
                .then(|| 1e3 * f64::from(nearest.field_distance_m)),
            resolution: match (nearest.exact, nearest.in_band) {
                (true, _) => Resolution::Exact,
                (false, true) if voxels => Resolution::TangentPlane,
                (false, true) => Resolution::Field,
                (false, false) => Resolution::Bound,
            },
            error_um: (nearest.error_m.is_finite()).then(|| 1e6 * f64::from(nearest.error_m)),
            measure: match nearest.measure {
                _ if nearest.distance_m >= 0.0 => Measure::Gap,
                mortise_haptics::Measure::DeepestPoint => Measure::DeepestPoint,
                mortise_haptics::Measure::Translation => Measure::Translation,
            },
            nearest_mm: mm(nearest.arm),
            moving_face: face(nearest.moving_face),
            fixed_face: face(nearest.fixed_face),
            contacts: found.contacts,
            contact_points: (prober.contacts())
                .map(|c| ContactRow {
                    point_mm: mm(c.arm),
                    normal: c.normal.to_array(),
                    depth_mm: 1e3 * f64::from(c.depth_m),
                    moving_face: face(c.moving_face),
                    fixed_face: face(c.fixed_face),
                })
                .collect(),
            force_n: found.wrench.force.to_array(),
            torque_nm: found.wrench.torque.to_array(),
            nodes: found.work.nodes,
            points: found.work.points,
            least_ns,
            flags: found.work.flags.rows().map(|row| row.words).collect(),
        })
    }
}

/// Words in the computer's byte order, the last one padded with zeros.
fn words(bytes: &[u8]) -> Vec<u32> {
    let mut words = vec![0; bytes.len().div_ceil(size_of::<u32>())];
    bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..bytes.len()].copy_from_slice(bytes);
    words
}

/// Source and accuracy of a distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Resolution {
    /// Proven to be that of the exact surfaces, within a micrometre.
    Exact,
    /// Of the exact surfaces within the stated error; without one, that of samples in the field.
    Field,
    /// To the tangent plane through a voxel's centre: the accuracy of a voxmap.
    TangentPlane,
    /// A lower bound on gap or depth: the field ends nearer than that.
    Bound,
}

/// What a distance measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// Smallest distance of two parts that are apart.
    Gap,
    /// Smallest translation that separates two convex parts.
    Translation,
    /// Depth of the deepest point of one part in the other.
    DeepestPoint,
}

/// Result at one pose. Positions and directions in the fixed part's frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProbeRow {
    /// Name of the pose.
    pub name: String,
    /// Distance, mm: gap positive, penetration as `measure` says negative.
    pub distance_mm: f64,
    /// Distance interpolated in the field, or from the voxmap's tangent planes, mm, on which the force law acts; absent beyond their range.
    pub field_distance_mm: Option<f64>,
    /// Source and accuracy of `distance_mm`.
    pub resolution: Resolution,
    /// Proven bound of the error of `distance_mm`, µm; absent where it is that of samples, whose error is not known.
    pub error_um: Option<f64>,
    /// What a negative distance is: the smallest translation that separates two convex parts, or the depth of the deepest point.
    pub measure: Measure,
    /// Position of the nearest point, mm.
    pub nearest_mm: [f64; 3],
    /// Face of the moving part there, if known.
    pub moving_face: Option<u16>,
    /// Face of the fixed part there, if known.
    pub fixed_face: Option<u16>,
    /// Number of points in contact.
    pub contacts: u16,
    /// The points in contact.
    pub contact_points: Vec<ContactRow>,
    /// Force on the moving part, N.
    pub force_n: [f32; 3],
    /// Torque on the moving part about its centre of mass, N m.
    pub torque_nm: [f32; 3],
    /// Tree nodes visited.
    pub nodes: u32,
    /// Points queried.
    pub points: u32,
    /// Shortest time of a query on this computer, ns.
    pub least_ns: u64,
    /// Flags raised by the query.
    pub flags: Vec<&'static str>,
}

/// A point in contact.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContactRow {
    /// Position, mm.
    pub point_mm: [f64; 3],
    /// Direction of the force on the moving part.
    pub normal: [f32; 3],
    /// Depth, mm, positive.
    pub depth_mm: f64,
    /// Face of the moving part.
    pub moving_face: Option<u16>,
    /// Face of the fixed part.
    pub fixed_face: Option<u16>,
}

impl fmt::Display for ProbeRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let worth = match self.resolution {
            Resolution::Exact => "exact",
            _ if self.error_um.is_some() => "within",
            Resolution::Field => "by the field",
            Resolution::TangentPlane => "to a tangent plane",
            Resolution::Bound => "at least",
        };
        let bound = self.error_um.map_or(String::new(), |um| format!(" ± {um:.2} µm"));
        let kind = match self.measure {
            Measure::Gap => "",
            Measure::Translation => ", smallest translation",
            Measure::DeepestPoint => ", deepest point",
        };
        let [x, y, z] = self.force_n;
        write!(
            f,
            "{}: {:+.4} mm ({worth}{bound}{kind}), {} contacts, force {x:.3} {y:.3} {z:.3} N, {} points, {} ns",
            self.name, self.distance_mm, self.contacts, self.points, self.least_ns
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_in_any_order() {
        let text = "# from a model\nqw,qx,qy,qz,z,y,x,name\n\n1,0,0,0,3,2,1,\"in\"\r\n";
        let poses = parse_poses(text).expect("well formed");
        assert_eq!(
            poses,
            [NamedPose {
                name: "in".into(),
                position_mm: DVec3::new(1.0, 2.0, 3.0),
                orientation: DQuat::IDENTITY,
            }]
        );
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        let header = "name,x,y,z,qw,qx,qy,qz";
        let cases = [
            (String::new(), 1, "no poses"),
            (header.to_owned(), 1, "add at least one"),
            (
                "name,x,y,z,qw,qx,qy\na,0,0,0,1,0,0".to_owned(),
                1,
                "no column `qz`",
            ),
            (format!("{header}\na,0,0,0,1,0,0"), 2, "7 cells under 8 columns"),
            (format!("{header}\n\na,0,NaN,0,1,0,0,0"), 3, "y is NaN"),
            (format!("{header}\na,0,0,inf,1,0,0,0"), 2, "z is inf"),
            (format!("{header}\na,0,zero,0,1,0,0,0"), 2, "y is `zero`"),
            (format!("{header}\na,0,0,0,1,1,0,0"), 2, "length is 1.414214"),
            (format!("{header}\na,1e9,0,0,1,0,0,0"), 2, "give millimetres"),
        ];
        for (text, line, part) in cases {
            let (at, what) = parse_poses(&text).expect_err(part);
            assert_eq!(at, line, "{what}");
            assert!(what.contains(part), "{what}");
        }
    }
}
