//! The scene image with its parts at other places: only their records change, nothing is baked again.

use bytemuck::{bytes_of, pod_read_unaligned};
use glam::DAffine3;
use mortise_protocol::image::{CRC, Header, PartRecord};

/// Bytes before those that the checksum covers.
const UNCHECKED: usize = 20;

/// The image with its parts, in the image's order, at these poses (rigid, part to world, mm). `None` when it is no image of that many parts, or a pose is
/// not finite.
pub fn with_placements(image: &[u8], placements: &[DAffine3]) -> Option<Vec<u8>> {
    let mut header: Header = pod_read_unaligned(image.get(..size_of::<Header>())?);
    if header.parts.count as usize != placements.len() || !placements.iter().all(|pose| pose.is_finite()) {
        return None;
    }
    let mut out = image.to_vec();
    for (index, pose) in placements.iter().enumerate() {
        let at = header.parts.offset as usize + index * size_of::<PartRecord>();
        let bytes = out.get_mut(at..at + size_of::<PartRecord>())?;
        let (_, rotation, translation) = pose.to_scale_rotation_translation();
        let record = PartRecord {
            position: (translation / 1000.0).as_vec3().to_array(),
            orientation: rotation.normalize().as_quat().to_array(),
            ..pod_read_unaligned(bytes)
        };
        bytes.copy_from_slice(bytes_of(&record));
    }
    header.crc = CRC.checksum(out.get(UNCHECKED..)?);
    out[..size_of::<Header>()].copy_from_slice(bytes_of(&header));
    Some(out)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::sync::LazyLock;

    use glam::{DQuat, DVec3};
    use mortise_bake::{BakeOptions, Method, bake};
    use mortise_brep::CadModel;
    use mortise_protocol::image::SceneImage;
    use proptest::prelude::*;

    use super::*;

    /// The sample, by the quickest method.
    static SAMPLE: LazyLock<(CadModel, Vec<u8>)> = LazyLock::new(|| {
        let file = mortise_scenario::sample::File::write().expect("a folder for temporary files");
        let model = mortise_brep::load_step(file.path()).expect("the sample");
        let options = BakeOptions {
            method: Method::Occupancy,
            ..BakeOptions::default()
        };
        let baked = bake(&model, &options, &|_| ControlFlow::Continue(())).expect("baked");
        (model, baked.image)
    });

    #[test]
    fn parts_where_they_are_leave_the_image_as_it_is() {
        let (model, image) = &*SAMPLE;
        let poses: Vec<_> = model.parts.iter().map(|part| part.placement).collect();
        assert!(with_placements(image, &poses).as_ref() == Some(image));
    }

    #[test]
    fn what_is_no_image_or_no_pose_is_refused() {
        let (model, image) = &*SAMPLE;
        let mut poses: Vec<_> = model.parts.iter().map(|part| part.placement).collect();
        assert_eq!(with_placements(&image[..40], &poses), None);
        assert_eq!(with_placements(image, &poses[..1]), None);
        poses[0].translation.x = f64::NAN;
        assert_eq!(with_placements(image, &poses), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn a_moved_scene_is_sound_and_differs_by_the_places_alone(
            at in prop::array::uniform3(-500.0..500.0f64),
            turn in prop::array::uniform3(-3.0..3.0f64),
        ) {
            let (model, image) = &*SAMPLE;
            let pose = DAffine3::from_rotation_translation(DQuat::from_scaled_axis(DVec3::from(turn)), DVec3::from(at));
            let file: Vec<_> = model.parts.iter().map(|part| part.placement).collect();
            let moved = with_placements(image, &[file[0], pose]).expect("an image");
            let mut words = vec![0u64; moved.len().div_ceil(8)];
            bytemuck::cast_slice_mut(&mut words)[..moved.len()].copy_from_slice(&moved);
            let scene = SceneImage::open(&bytemuck::cast_slice(&words)[..moved.len()]).expect("sound");
            let record = scene.parts()[1];
            let near = DVec3::from(record.position.map(f64::from)) * 1000.0 - DVec3::from(at);
            prop_assert!(near.length() < 1e-3, "{near}");
            prop_assert!(with_placements(&moved, &file).as_ref() == Some(image), "back again");
        }
    }
}
