use glam::*;
use mortise_task::*;
fn main() {
    let dir = std::path::Path::new("/work/shared/cad/10_extraction");
    let model = mortise_brep::load_step(dir.join("lock_maze.step")).unwrap();
    let a = Assembly::new(model).unwrap();
    for deg in [0., 10., 20., 30., 40., 50., 60., 65., 70., 72., 73., 74., 74.5, 75., 76.] {
        let by = DAffine3::from_translation(DVec3::new(0., 0., 1.151)) * Motion::turn(DVec3::ZERO, DVec3::Z, f64::to_radians(deg)).at(1.0);
        println!("{deg} {:?}", a.excess(&Moved { parts: &[1], by }, &[0], 3.0));
    }
}
