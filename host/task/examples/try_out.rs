use std::time::{Duration, Instant};
use mortise_task::*;
fn main() {
    let dir = std::path::Path::new("/work/shared/cad");
    for name in std::env::args().skip(1) {
        let model = mortise_brep::load_step(dir.join(format!("{name}.step"))).unwrap();
        let a = Assembly::new(model).unwrap();
        let t = Instant::now();
        let r = removal::remove(&a, &[1], &[0], &[], &removal::Budget::lasting(Duration::from_secs(60)));
        match r {
            removal::Removal::Out(p) => { println!("{name}: out {:?}", t.elapsed()); for l in p.legs { println!("    {:.3} turn {:.3}deg about {:.2} {:.2}", l.slide, l.angle.to_degrees(), l.point, l.axis); } }
            other => println!("{name}: {other:?} {:?}", t.elapsed()),
        }
    }
}
