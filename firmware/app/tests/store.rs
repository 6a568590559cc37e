//! The scene store loses no data when power fails at any write.

use crate::support::flash::{SECTOR, SLOT, TestFlash};
use crate::support::image::{parts, seal, two_parts};
use mortise_firmware::board::{Flash, SLOTS, WRITE_SIZE};
use mortise_firmware::store::{IMAGE_OFFSET, Store, commit_record};
use mortise_protocol::image::{CRC, ImageError, LAYOUT_VERSION};
use mortise_protocol::message::Refusal;

fn store_whole(store: &mut Store<'static, TestFlash>, image: &[u8], chunk: usize) -> Result<(), Refusal> {
    store.begin(image.len() as u32, CRC.checksum(image), LAYOUT_VERSION)?;
    for (i, piece) in image.chunks(chunk).enumerate() {
        store.chunk((i * chunk) as u32, piece)?;
    }
    store.commit()?;
    store.taken_over();
    Ok(())
}

fn current(store: &Store<'static, TestFlash>) -> Option<u32> {
    store.current().map(|s| s.crc)
}

#[test]
fn scenes_are_found_again_whatever_the_chunks() {
    for chunk in [1, 7, 31, 32, 33, 64, 511, 512] {
        let flash = TestFlash::leaked();
        let mut store = Store::open(flash.clone());
        assert_eq!(current(&store), None);
        for tag in 1..6 {
            let image = two_parts(tag);
            store_whole(&mut store, &image, chunk).unwrap();
            assert_eq!(current(&store), Some(CRC.checksum(&image)));
            let again = Store::open(flash.clone());
            assert_eq!(current(&again), Some(CRC.checksum(&image)));
            assert_eq!(
                again.current().unwrap().image.parts()[1].position[2],
                f32::from(tag) * 1e-3
            );
        }
    }
}

#[test]
fn power_lost_at_any_operation_leaves_the_old_scene_or_the_whole_new_one() {
    // Third upload: both slots have held a scene before.
    let (older, old, new) = (two_parts(1), two_parts(2), two_parts(3));
    let prepared = || {
        let flash = TestFlash::leaked();
        let mut store = Store::open(flash.clone());
        store_whole(&mut store, &older, 512).unwrap();
        store_whole(&mut store, &old, 512).unwrap();
        flash
    };
    let flash = prepared();
    let before = flash.operations.get();
    store_whole(&mut Store::open(flash.clone()), &new, 512).unwrap();
    let operations = flash.operations.get() - before;
    assert!(operations > 30, "{operations} operations cover nothing");
    let mut kept = 0;
    for cut in 1..=operations {
        let flash = prepared();
        flash.fuse.set(Some(cut));
        let mut store = Store::open(flash.clone());
        let result = store_whole(&mut store, &new, 512);
        // The last operation is the record: half a record is invalid.
        assert_eq!(result, Err(Refusal::Flash), "cut {cut}");
        assert_eq!(
            current(&store),
            Some(CRC.checksum(&old)),
            "cut {cut}, before the restart"
        );
        flash.fuse.set(None);
        let mut store = Store::open(flash);
        assert_eq!(
            current(&store),
            Some(CRC.checksum(&old)),
            "cut {cut}, after the restart"
        );
        kept += 1;
        // And the next upload works.
        store_whole(&mut store, &new, 512).unwrap();
        assert_eq!(current(&store), Some(CRC.checksum(&new)));
    }
    println!("old scene kept at each of {kept} cuts");
}

#[test]
fn a_break_between_chunks_keeps_the_old_scene() {
    let (old, new) = (two_parts(1), two_parts(2));
    let chunks = new.len().div_ceil(64);
    for sent in 0..=chunks {
        let flash = TestFlash::leaked();
        store_whole(&mut Store::open(flash.clone()), &old, 512).unwrap();
        let mut store = Store::open(flash.clone());
        store
            .begin(new.len() as u32, CRC.checksum(&new), LAYOUT_VERSION)
            .unwrap();
        for (i, piece) in new.chunks(64).take(sent).enumerate() {
            store.chunk((i * 64) as u32, piece).unwrap();
        }
        assert_eq!(
            current(&Store::open(flash)),
            Some(CRC.checksum(&old)),
            "after {sent} chunks"
        );
    }
}

#[test]
fn what_cannot_be_a_scene_is_refused_with_the_reason() {
    let flash = TestFlash::leaked();
    let mut store = Store::open(flash.clone());
    let image = two_parts(1);
    let (length, crc) = (image.len() as u32, CRC.checksum(&image));
    let capacity = (SLOT - IMAGE_OFFSET) as u32;

    assert_eq!(store.chunk(0, &[0; 4]), Err(Refusal::NoUpload));
    assert_eq!(store.commit().map(drop), Err(Refusal::NoUpload));
    assert_eq!(
        store.begin(length, crc, LAYOUT_VERSION + 1),
        Err(Refusal::SceneImage(ImageError::Layout {
            expected: LAYOUT_VERSION,
            found: LAYOUT_VERSION + 1
        }))
    );
    assert_eq!(
        store.begin(capacity + 1, crc, LAYOUT_VERSION),
        Err(Refusal::SceneTooLarge { capacity })
    );
    assert!(matches!(
        store.begin(10, crc, LAYOUT_VERSION),
        Err(Refusal::SceneImage(ImageError::TooShort { got: 10, .. }))
    ));

    store.begin(length, crc, LAYOUT_VERSION).unwrap();
    store.chunk(0, &image[..512]).unwrap();
    assert_eq!(
        store.chunk(0, &image[..512]),
        Ok(()),
        "the last chunk again is acknowledged again"
    );
    assert_eq!(
        store.chunk(100, &image[100..200]),
        Err(Refusal::ChunkOrder { expected: 512 })
    );
    assert_eq!(
        store.commit().map(drop),
        Err(Refusal::SceneIncomplete { received: 512 })
    );
    store.chunk(512, &image[512..1024]).unwrap();
    assert_eq!(
        store.chunk(1024, &[0; 512]),
        Err(Refusal::SceneTooLarge { capacity: length }),
        "more than was announced"
    );

    // Damaged in transit, but announced correctly.
    let mut damaged = image.clone();
    damaged[700] ^= 1;
    store.begin(length, crc, LAYOUT_VERSION).unwrap();
    for (i, piece) in damaged.chunks(512).enumerate() {
        store.chunk((i * 512) as u32, piece).unwrap();
    }
    assert_eq!(
        store.commit().map(drop),
        Err(Refusal::SceneCrc {
            expected: crc,
            found: CRC.checksum(&damaged)
        })
    );
    assert_eq!(
        store_whole(&mut store, &damaged, 512),
        Err(Refusal::SceneImage(ImageError::Crc {
            expected: u32::from_le_bytes([image[16], image[17], image[18], image[19]]),
            found: CRC.checksum(&damaged[20..]),
        }))
    );
    let mut other = image.clone();
    other[0] = b'X';
    seal(&mut other);
    assert_eq!(
        store_whole(&mut store, &other, 512),
        Err(Refusal::SceneImage(ImageError::BadMagic))
    );
    assert_eq!(current(&store), None);
    assert_eq!(
        current(&Store::open(flash)),
        None,
        "nothing of that was committed"
    );
}

#[test]
fn a_slot_filled_by_a_tool_is_a_scene() {
    let image = two_parts(7);
    let mut flash = TestFlash::leaked();
    let mut bytes = commit_record(3, &image).to_vec();
    bytes.extend_from_slice(&image);
    bytes.resize(bytes.len().next_multiple_of(WRITE_SIZE), 0xff);
    for (i, word) in bytes.chunks_exact(WRITE_SIZE).enumerate() {
        flash.write(1, i * WRITE_SIZE, word.try_into().unwrap()).unwrap();
    }
    assert_eq!(current(&Store::open(flash)), Some(CRC.checksum(&image)));
}

#[test]
fn more_parts_than_the_board_holds_are_refused() {
    // So many parts need more flash than the tests' flash has, so this check uses a flash in RAM.
    use mortise_firmware::board::ERASED;
    use mortise_protocol::limits::MAX_PARTS;
    use mortise_simulation::ram_flash::{ERASE_SIZE, RamFlash};
    // A sector for each scene, and one for each of the rig's descriptions.
    let memory = vec![ERASED; 2 * SLOTS * ERASE_SIZE / 32].leak();
    let mut store = Store::open(RamFlash::new(memory));
    let image = parts(MAX_PARTS + 1, 1);
    store
        .begin(image.len() as u32, CRC.checksum(&image), LAYOUT_VERSION)
        .unwrap();
    for (i, piece) in image.chunks(512).enumerate() {
        store.chunk((i * 512) as u32, piece).unwrap();
    }
    assert_eq!(
        store.commit().map(drop),
        Err(Refusal::TooManyParts {
            capacity: MAX_PARTS as u16
        })
    );
}

#[test]
fn a_slot_that_went_bad_is_passed_over() {
    let flash = TestFlash::leaked();
    let (old, new) = (two_parts(1), two_parts(2));
    let mut store = Store::open(flash.clone());
    store_whole(&mut store, &old, 512).unwrap();
    store_whole(&mut store, &new, 512).unwrap();
    assert!(store.is_sound());
    // First upload goes to slot 0, second to slot 1.
    flash.damage_in_use(1, IMAGE_OFFSET + 300);
    assert!(!store.is_sound());
    assert_eq!(current(&Store::open(flash.clone())), Some(CRC.checksum(&old)));
    flash.damage(0, 3);
    assert_eq!(current(&Store::open(flash)), None);
}

#[test]
fn an_upload_never_touches_the_slot_in_use_until_the_control_plane_has_let_go() {
    let flash = TestFlash::leaked();
    let mut store = Store::open(flash.clone());
    let (old, new) = (two_parts(1), two_parts(2));
    store_whole(&mut store, &old, 512).unwrap();
    store
        .begin(new.len() as u32, CRC.checksum(&new), LAYOUT_VERSION)
        .unwrap();
    for (i, piece) in new.chunks(512).enumerate() {
        store.chunk((i * 512) as u32, piece).unwrap();
    }
    store.commit().unwrap();
    assert_eq!(current(&store), Some(CRC.checksum(&old)));
    assert_eq!(
        store.begin(new.len() as u32, CRC.checksum(&new), LAYOUT_VERSION),
        Err(Refusal::Busy)
    );
    // The control plane refuses: the old scene stays, now and after a restart.
    store.not_taken_over().unwrap();
    assert_eq!(current(&store), Some(CRC.checksum(&old)));
    assert_eq!(current(&Store::open(flash)), Some(CRC.checksum(&old)));
    assert!(new.len() > SECTOR, "spans sectors");
}
