use std::time::Instant;
use glam::*;
use mortise_task::*;
fn main() {
    let dir = std::path::Path::new("/work/shared/cad");
    for name in std::env::args().skip(1) {
        let t = Instant::now();
        let model = mortise_brep::load_step(dir.join(format!("{name}.step"))).unwrap();
        let load = t.elapsed();
        let t = Instant::now();
        let a = Assembly::new(model).unwrap();
        println!("{name}: load {load:?} prepare {:?} samples {:?}", t.elapsed(), (0..a.count()).map(|p| a.body(p).samples().len()).collect::<Vec<_>>());
        for p in 0..a.count() { for q in 0..p { if a.pressed_mm(p,q) > 1e-6 { println!("  pressed {} {} {}", a.name(p), a.name(q), a.pressed_mm(p,q)*1e3);} } }
        for p in 0..a.count() {
            let t = Instant::now();
            let others: Vec<usize> = (0..a.count()).filter(|&q| q != p).collect();
            let f = mobility::freedoms(&a, &Moved { parts: &[p], by: DAffine3::IDENTITY }, &others, &[]);
            println!(" {} lines {} rays {} {:?}", a.name(p), f.lines, f.rays, t.elapsed());
            for t in &f.translations { println!("    {:.3?} {:?} {:.3?} two {} meets {:?}", t.direction, t.reach, t.range_mm, t.two_sided, t.meets.map(|m| a.name(m))); }
            for t in &f.rotations { println!("    turn {:.2?} {:.3?} {:?} {:.3?}", t.point, t.direction, t.reach, t.range_deg); }
        }
    }
}
