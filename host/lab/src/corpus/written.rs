//! Expected results of shared files that their own list does not cover: the number of parts, or why they must be refused.
//!
//! Counts of real files are those of `real/manifest.csv`, which counts the two bodies of `chrono_assembly.stp` twice, as definitions and as mapped,
//! and does not count the open one of `brl_ap214_nonmanifold_four_use_edge.stp`. Counts of files of `09_free_form` and `10_extraction` come from
//! their generator.

use self::Written::{Parts, Refused};

/// Expected result of reading a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Written {
    /// This many parts.
    Parts(usize),
    /// A refusal that contains this text.
    Refused(&'static str),
}

/// Paths below the folder, in order.
pub(crate) const WRITTEN: &[(&str, Written)] = &[
    ("08_hard/broken_cyclic_ref.step", Refused("refer to each other")),
    ("08_hard/broken_empty.step", Refused("the file is empty")),
    (
        "08_hard/broken_huge_number.step",
        Refused("1.E400, which is not a finite value"),
    ),
    (
        "08_hard/broken_missing_ref.step",
        Refused("refers to #999999, which does not exist"),
    ),
    (
        "08_hard/broken_negative_radius.step",
        Refused("has the radius -5."),
    ),
    ("08_hard/broken_not_step.step", Refused("not a STEP file")),
    (
        "08_hard/broken_truncated_half.step",
        Refused("cut off at line 4947"),
    ),
    (
        "08_hard/broken_truncated_tail.step",
        Refused("cut off at line 10030"),
    ),
    ("09_free_form/bars_s02.step", Parts(2)),
    ("09_free_form/bars_s05.step", Parts(2)),
    ("09_free_form/bars_s12.step", Parts(2)),
    ("09_free_form/dovetail.step", Parts(2)),
    ("09_free_form/ellipsoid_socket.step", Parts(2)),
    ("09_free_form/keyed_shaft.step", Parts(2)),
    ("09_free_form/loft_peg_c0.02.step", Parts(2)),
    ("09_free_form/loft_peg_c0.10.step", Parts(2)),
    ("09_free_form/plate0.2_ball.step", Parts(2)),
    ("09_free_form/plate0.5_ball.step", Parts(2)),
    ("09_free_form/spline_gear9.step", Parts(2)),
    ("09_free_form/square_taper.step", Parts(2)),
    ("09_free_form/thread_m10.step", Parts(2)),
    ("09_free_form/torus_ring.step", Parts(2)),
    ("09_free_form/tslot_nut.step", Parts(2)),
    ("09_free_form/wedges.step", Parts(2)),
    ("10_extraction/bent_tube.step", Parts(2)),
    ("10_extraction/box_with_board.step", Parts(7)),
    ("10_extraction/cross_pin.step", Parts(2)),
    ("10_extraction/flange_l_passage.step", Parts(2)),
    ("10_extraction/gear_housing.step", Parts(2)),
    ("10_extraction/gearbox.step", Parts(16)),
    ("10_extraction/hinge.step", Parts(9)),
    ("10_extraction/keyhole_locked_30um.step", Parts(2)),
    ("10_extraction/keyhole_loose_30um.step", Parts(2)),
    ("10_extraction/linked_rings.step", Parts(2)),
    ("10_extraction/lock_maze.step", Parts(2)),
    ("10_extraction/ring_hook.step", Parts(2)),
    ("10_extraction/ring_on_dumbbell.step", Parts(2)),
    ("10_extraction/tbolt_slot.step", Parts(2)),
    ("10_extraction/ubolt_plate.step", Parts(2)),
    ("real/NIST_MBE_PMI_1.stp", Parts(1)),
    ("real/NIST_MBE_PMI_5.stp", Parts(1)),
    ("real/ahand_L-Palm_Shell.step", Parts(1)),
    ("real/as1-oc-214.stp", Parts(18)),
    (
        "real/brl_ap203_malformed_representation.stp",
        Refused("holds no solid or surface"),
    ),
    (
        "real/brl_ap203_mapped_assembly.stp",
        Refused("lost 1 of 1 solids"),
    ),
    ("real/brl_ap214_brep_with_voids.stp", Parts(2)),
    ("real/brl_ap214_nonmanifold_four_use_edge.stp", Parts(1)),
    ("real/chrono_assembly.stp", Parts(2)),
    ("real/dn_flex_assembly.step", Parts(11)),
    ("real/moonbit_kicadoutput01.step", Parts(3)),
    ("real/o2ac_fixture_diagonal.step", Parts(15)),
    ("real/odri_motor_4004_custom_shaft.STEP", Parts(1)),
    ("real/soarm_STS3215_03a.step", Parts(1)),
    ("real/stepnode_hole_model.stp", Parts(1)),
    ("real/wrs_02-PANEL.step", Parts(1)),
];

/// Expected result of a file.
pub(crate) fn of(file: &str) -> Option<Written> {
    let file = file.replace('\\', "/");
    let at = WRITTEN.binary_search_by(|(name, _)| (*name).cmp(&file)).ok()?;
    Some(WRITTEN[at].1)
}

/// Real files of two parts or more.
pub(crate) fn assemblies() -> impl Iterator<Item = &'static str> {
    let named = |(file, written): &(&'static str, Written)| {
        let name = file.strip_prefix("real/")?;
        matches!(written, Parts(2..)).then_some(name)
    };
    WRITTEN.iter().filter_map(named)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_found_by_its_name() {
        assert!(WRITTEN.is_sorted_by(|a, b| a.0 < b.0));
        for (file, written) in WRITTEN {
            assert_eq!(of(file), Some(*written));
        }
        assert_eq!(of("real/as1-oc-214.stp"), Some(Parts(18)));
        assert_eq!(of("real/none.stp"), None);
        assert_eq!(assemblies().count(), 6);
    }
}
