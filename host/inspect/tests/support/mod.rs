//! Common code of the tests: hand-made shapes, volumes below a plane, files.
#![allow(dead_code)]

#[path = "../../../bake/tests/common/mod.rs"]
pub mod shapes;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use mortise_brep::{CadModel, Mesh};
use mortise_inspect::{CutPlane, Section};

/// Volume of the solid that `mesh` bounds below `plane`: ∫ (z − h) dA_z over the surface below height h, by the divergence theorem; the part in the plane
/// contributes nothing.
pub fn volume_below(mesh: &Mesh, plane: &CutPlane) -> f64 {
    let mut volume = 0.0;
    for t in &mesh.triangles {
        let corners = t.map(|v| mesh.vertices[v as usize]);
        let mut below: Vec<DVec3> = Vec::new();
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            let (ha, hb) = (plane.height(a), plane.height(b));
            if ha < 0.0 {
                below.push(a);
            }
            if (ha < 0.0) != (hb < 0.0) {
                below.push(a + (b - a) * (ha / (ha - hb)));
            }
        }
        for i in 2..below.len() {
            let (a, b, c) = (below[0], below[i - 1], below[i]);
            let across = (b - a).cross(c - a).dot(plane.normal) / 2.0;
            volume += across * (plane.height(a) + plane.height(b) + plane.height(c)) / 3.0;
        }
    }
    volume
}

/// Asserts that the cap's border is the loops: each side of a loop is a side of exactly one triangle, in its direction, and no other side is.
pub fn assert_no_leak(section: &Section, plane: &CutPlane) {
    let key = |x: f64, y: f64| [(x + 0.0).to_bits(), (y + 0.0).to_bits()];
    let corner = |i: u32| {
        let p = section.cap.points[i as usize];
        key(p.x, p.y)
    };
    let mut sides: HashMap<_, i32> = HashMap::new();
    for t in &section.cap.triangles {
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            *sides.entry((corner(t[a]), corner(t[b]))).or_default() += 1;
        }
    }
    // Inner sides are used once in each direction.
    let border: HashMap<_, i32> = sides
        .iter()
        .filter(|&(&(a, b), _)| !sides.contains_key(&(b, a)))
        .map(|(&k, &n)| (k, n))
        .collect();
    let mut outline: HashMap<_, i32> = HashMap::new();
    for l in &section.loops {
        for (i, &p) in l.points.iter().enumerate() {
            let [p, q] = [p, l.points[(i + 1) % l.points.len()]].map(|p| plane.to_plane(p));
            if p != q {
                *outline.entry((key(p.x, p.y), key(q.x, q.y))).or_default() += 1;
            }
        }
    }
    let cancelled: Vec<_> = outline
        .keys()
        .filter(|&&(a, b)| outline.contains_key(&(b, a)))
        .copied()
        .collect();
    for k in cancelled {
        outline.remove(&k);
    }
    assert_eq!(border, outline);
    assert!(sides.values().all(|&n| n == 1));
}

/// Folder of the shared parts; `None`, with a line that says so, where they are absent.
pub fn shared(test: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("MORTISE_SHARED")
        .map_or(beside, PathBuf::from)
        .join("cad");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("{test}: skipped, the shared parts are absent");
    None
}

/// A file of the repository, below `host`.
pub fn own(path: &str) -> CadModel {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    mortise_brep::load_step(file).unwrap()
}

/// All STEP files below a folder, in order.
pub fn step_files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let end = path
                .extension()
                .and_then(|e| e.to_str())
                .unwrap_or_default()
                .to_lowercase();
            if path.is_dir() {
                folders.push(path);
            } else if end == "step" || end == "stp" {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}
