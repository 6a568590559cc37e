//! STEP text written from a file's shapes reads back as the same shapes at the stated placements.

mod support;

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::{LoadOptions, load_step, write};

#[test]
fn written_parts_read_back_where_they_were_put() {
    let path = support::data("pair_d18.75_clear1.00.step");
    let model = load_step(&path).unwrap();
    let mut parts = model.parts.clone();
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    parts[1].placement =
        DAffine3::from_rotation_translation(turn, DVec3::new(12.5, -3.25, 71.0)) * parts[1].placement;
    let text = write::step_text(&path, &LoadOptions::default(), &parts).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.step");
    std::fs::write(&out, text).unwrap();
    let back = load_step(&out).unwrap();
    assert_eq!(back.parts.len(), parts.len());
    for (wanted, found) in parts.iter().zip(&back.parts) {
        assert_eq!(wanted.name, found.name);
        for corner in [
            DVec3::splat(50.0),
            DVec3::splat(-50.0),
            DVec3::new(50.0, -50.0, 0.0),
        ] {
            let apart = wanted
                .placement
                .transform_point3(corner)
                .distance(found.placement.transform_point3(corner));
            assert!(apart < 1e-9, "{}: {apart} mm", wanted.name);
        }
        let [was, is] = [&model.shapes[wanted.shape], &back.shapes[found.shape]];
        assert!((was.volume_mm3 - is.volume_mm3).abs() < 1e-6 * was.volume_mm3);
        assert_eq!(was.faces.len(), is.faces.len());
    }
    assert!(write::step_text(&path, &LoadOptions::default(), &[]).is_ok());
}

#[test]
fn a_part_without_a_shape_in_the_file_is_refused() {
    let path = support::data("pair_d18.75_clear1.00.step");
    let mut parts = load_step(&path).unwrap().parts;
    parts[0].shape = 99;
    assert!(write::step_text(&path, &LoadOptions::default(), &parts).is_err());
}
