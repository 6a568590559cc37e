use std::time::Instant;
use glam::*;
use mortise_task::*;
fn main() {
    let dir = std::path::Path::new("/work/shared/cad/10_extraction");
    for name in std::env::args().skip(1) {
        let t = Instant::now();
        let model = mortise_brep::load_step(dir.join(format!("{name}.step"))).unwrap();
        let load = t.elapsed();
        let t = Instant::now();
        let a = Assembly::new(model).unwrap();
        print!("{name}: load {load:?} prepare {:?} samples {:?}", t.elapsed(), (0..a.count()).map(|p| a.body(p).samples().len()).collect::<Vec<_>>());
        let t = Instant::now();
        let all = [1usize];
        let c = a.clearance(&Moved { parts: &all, by: DAffine3::IDENTITY }, &[0], 1e9, true);
        println!(" gap {:?} {:?}", c.map(|c| (c.gap.distance_mm*1e3, c.gap.point, c.gap.away)), t.elapsed());
        for d in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z] {
            let t = Instant::now();
            let m = Motion::slide(d * 100.0);
            let (s, p) = a.free_share(&Moved { parts: &all, by: DAffine3::IDENTITY }, &[0], &m, 0.2);
            print!("   {d} {:.4} {:?} {:?}", s * 100.0, p.is_some(), t.elapsed());
            let t = Instant::now();
            let l = a.least_over(&Moved { parts: &all, by: DAffine3::IDENTITY }, &[0], &m.until(s), 0.05, 1e9);
            println!("   least {:?} {:?}", l.map(|l| (l.0, l.1.gap.distance_mm*1e3)), t.elapsed());
        }
    }
}
