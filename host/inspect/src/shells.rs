//! Shells of a mesh, and which of them bound a solid.

use std::collections::HashMap;

use mortise_brep::Mesh;

/// For each triangle whether its shell is open: an edge of the shell is not used equally often in both directions. A shell is what shares vertices. An edge
/// at which several sheets meet in pairs is closed.
pub fn open_triangles(mesh: &Mesh) -> Vec<bool> {
    let mut shell: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    let mut net: HashMap<[u32; 2], i32> = HashMap::with_capacity(mesh.triangles.len() * 2);
    for &[a, b, c] in &mesh.triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let (one, other) = (root(&mut shell, from), root(&mut shell, to));
            shell[one.max(other) as usize] = one.min(other);
            if from != to {
                let sign = if from < to { 1 } else { -1 };
                *net.entry([from.min(to), from.max(to)]).or_default() += sign;
            }
        }
    }
    let mut open = vec![false; mesh.vertices.len()];
    for (&[a, _], &uses) in &net {
        if uses != 0 {
            open[root(&mut shell, a) as usize] = true;
        }
    }
    mesh.triangles
        .iter()
        .map(|t| open[root(&mut shell, t[0]) as usize])
        .collect()
}

fn root(shell: &mut [u32], mut v: u32) -> u32 {
    while shell[v as usize] != v {
        shell[v as usize] = shell[shell[v as usize] as usize];
        v = shell[v as usize];
    }
    v
}
