use std::time::{Duration, Instant};
use mortise_task::*;
fn main() {
    let dir = std::path::Path::new("/work/shared/cad");
    for name in std::env::args().skip(1) {
        let model = mortise_brep::load_step(dir.join(&name)).unwrap();
        let t = Instant::now();
        let a = Assembly::new(model).unwrap();
        println!("{name}: {} parts, prepared in {:?}", a.count(), t.elapsed());
        let all: Vec<usize> = (0..a.count()).collect();
        println!("directions {:.2?}", sequence::directions(&a, &all));
        let s = sequence::disassemble(&a, &all, Duration::from_secs(60));
        for step in &s.steps {
            let n = |g: &[usize]| g.iter().map(|&p| a.name(p)).collect::<Vec<_>>().join(",");
            println!("  {} from {} legs {} first {:.2} least {:?} um {}", n(&step.group), n(&step.onto), step.path.legs.len(), step.path.legs[0].slide, step.least.map(|l| (l.gap.distance_mm * 1e3, a.name(l.pair[0]), a.name(l.pair[1]))), step.measured);
        }
        println!("  stuck {:?} timed out {} {:?}", s.stuck.iter().map(|(g, b)| (g.iter().map(|&p| a.name(p)).collect::<Vec<_>>(), b)).collect::<Vec<_>>(), s.timed_out, s.time);
    }
}
