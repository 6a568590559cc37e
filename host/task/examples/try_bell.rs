fn main() {
    let dir = std::path::Path::new("/work/shared/cad");
    for f in std::env::args().skip(1) {
    let Ok(model) = mortise_brep::load_step(dir.join(&f)) else { continue };
    for s in &model.shapes {
        let v: f64 = s.mesh.triangles.iter().map(|t| { let [a,b,c] = t.map(|i| s.mesh.vertices[i as usize]); a.dot(b.cross(c)) / 6.0 }).sum();
        println!("{f} solid {:.1} mesh {:.1} closed {} ratio {:.4}", s.volume_mm3, v, s.closed, v / s.volume_mm3);
    }
    println!("{:?}", model.warnings);
    }
}
