//! Groups of parts that move as one, and where their parts are. Pure. Poses are rigid, part to world, mm.
//!
//! A group has the frame of its first part: where that one is, the group is, and the others follow. So the first part stands for the group wherever a part has a
//! number: in the scene of a board, in targets, in fits.

use glam::DAffine3;

use super::pose::rigid;

/// Relative poses that differ by less are those of the file, mm and as components of unit vectors: the rounding of a project file, 1e-9 mm, some times over.
const SAME: f64 = 1e-8;
/// Most names in the name of a group.
const NAMED: usize = 3;

/// Parts that move as one.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// Its parts, ascending.
    parts: Vec<usize>,
    /// A pose of each of them, with which they are as they are to one another.
    joined: Vec<DAffine3>,
}

impl Group {
    /// The group of `parts` as they are at `poses`; where the file has them so, exactly as in the `file`. `None`: fewer than two, or one that does not exist.
    pub fn new(name: String, mut parts: Vec<usize>, poses: &[DAffine3], file: &[DAffine3]) -> Option<Self> {
        parts.sort_unstable();
        parts.dedup();
        let of = |from: &[DAffine3]| -> Option<Vec<DAffine3>> {
            parts.iter().map(|&part| from.get(part).copied()).collect()
        };
        let (now, file) = (of(poses)?, of(file)?);
        let are_alike = alike(&now, &file);
        (parts.len() > 1).then_some(Self {
            name,
            parts,
            joined: if are_alike { file } else { now },
        })
    }

    /// Its parts, ascending.
    pub fn parts(&self) -> &[usize] {
        &self.parts
    }

    /// The part whose frame it has.
    pub fn first(&self) -> usize {
        self.parts[0]
    }

    /// Each part with its pose where the first one is at `pose`.
    pub fn placed(&self, pose: DAffine3) -> impl Iterator<Item = (usize, DAffine3)> {
        let first = self.joined[0];
        let by = pose * first.inverse();
        (self.parts.iter().zip(&self.joined).enumerate()).map(move |(number, (&part, joined))| {
            let pose = match number {
                0 => pose,
                // Exactly where they were joined.
                _ if pose == first => *joined,
                _ => rigid(&(by * *joined)),
            };
            (part, pose)
        })
    }

    /// Pose of the first part where `part` is at `pose`; `None`: it is none of the group.
    pub fn first_with(&self, part: usize, pose: DAffine3) -> Option<DAffine3> {
        let number = self.parts.iter().position(|&own| own == part)?;
        let joined = self.joined[number];
        Some(match number {
            0 => pose,
            _ if pose == joined => self.joined[0],
            _ => rigid(&(pose * joined.inverse() * self.joined[0])),
        })
    }

    /// Whether its parts are to one another as they are joined, but for rounding.
    fn is_kept(&self, poses: &[DAffine3]) -> bool {
        let now: Option<Vec<DAffine3>> = (self.parts.iter())
            .map(|&part| poses.get(part).copied())
            .collect();
        now.is_some_and(|now| alike(&now, &self.joined))
    }
}

/// Whether poses are alike to one another in both lists, seen from the first one.
fn alike(a: &[DAffine3], b: &[DAffine3]) -> bool {
    let seen = |poses: &[DAffine3]| -> Vec<DAffine3> {
        let back = poses.first().map(DAffine3::inverse).unwrap_or_default();
        poses.iter().map(|pose| back * *pose).collect()
    };
    (seen(a).iter().zip(seen(b))).all(|(a, b)| a.abs_diff_eq(b, SAME))
}

/// The groups of a document. No part is in two of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Groups(Vec<Group>);

impl Groups {
    /// These and another one, which takes in every group that it shares a part with.
    pub fn with(&self, group: Group) -> Self {
        let apart = |known: &&Group| known.parts.iter().all(|part| !group.parts.contains(part));
        let mut groups: Vec<Group> = self.0.iter().filter(apart).cloned().collect();
        groups.push(group);
        groups.sort_by_key(Group::first);
        Self(groups)
    }

    /// These without the group of a part.
    pub fn without(&self, part: usize) -> Self {
        let others = self.0.iter().filter(|group| !group.parts.contains(&part));
        Self(others.cloned().collect())
    }

    /// Each group, in the order of their first parts.
    pub fn iter(&self) -> impl Iterator<Item = &Group> {
        self.0.iter()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The group of a part.
    pub fn of(&self, part: usize) -> Option<&Group> {
        self.0.iter().find(|group| group.parts.contains(&part))
    }

    /// The part that stands for this one: the first of its group, or itself.
    pub fn first(&self, part: usize) -> usize {
        self.of(part).map_or(part, Group::first)
    }

    /// The parts that move with this one, and itself, ascending.
    pub fn together(&self, part: usize) -> Vec<usize> {
        self.of(part)
            .map_or_else(|| vec![part], |group| group.parts.clone())
    }

    /// Puts a part at a pose, and with it those of its group. No effect where there is no such part.
    pub fn put(&self, poses: &mut [DAffine3], part: usize, pose: DAffine3) {
        let group = self.of(part);
        let Some((group, first)) = group.and_then(|group| Some((group, group.first_with(part, pose)?)))
        else {
            if let Some(place) = poses.get_mut(part) {
                *place = pose;
            }
            return;
        };
        for (other, placed) in group.placed(first) {
            if let Some(place) = poses.get_mut(other) {
                *place = if other == part { pose } else { placed };
            }
        }
    }

    /// Puts every group where its first part is.
    pub fn gather(&self, poses: &mut [DAffine3]) {
        for group in &self.0 {
            if let Some(first) = poses.get(group.first()).copied() {
                self.put(poses, group.first(), first);
            }
        }
    }

    /// The first group whose parts are not to one another as they are joined.
    pub fn broken(&self, poses: &[DAffine3]) -> Option<&Group> {
        self.0.iter().find(|group| !group.is_kept(poses))
    }
}

/// Name of a group of parts with these names: all of few, the first of many.
pub fn name_of(names: &[&str]) -> String {
    if names.len() <= NAMED {
        return names.join(", ");
    }
    let shown = NAMED - 1;
    format!("{} and {} more", names[..shown].join(", "), names.len() - shown)
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};
    use proptest::prelude::*;

    use super::*;

    fn poses() -> impl Strategy<Value = DAffine3> {
        let numbers = || prop::array::uniform3(-1.0..1.0f64);
        (numbers(), numbers()).prop_map(|(at, turn)| {
            let turn = DQuat::from_scaled_axis(3.0 * DVec3::from(turn));
            DAffine3::from_rotation_translation(turn, 400.0 * DVec3::from(at))
        })
    }

    /// Poses of six parts, and to which of two groups each belongs, if to one.
    fn scenes() -> impl Strategy<Value = (Vec<DAffine3>, Groups)> {
        let placed = prop::collection::vec(poses(), 6);
        (placed, prop::collection::vec(0..3usize, 6)).prop_map(|(placed, which)| {
            let group = |number: usize| {
                let parts = (0..6).filter(|&part| which[part] == number).collect();
                Group::new(format!("{number}"), parts, &placed, &placed)
            };
            let groups = (1..3).filter_map(group);
            let groups = groups.fold(Groups::default(), |all, group| all.with(group));
            (placed, groups)
        })
    }

    /// 400 mm and unit vectors, rounded to 2⁻⁵³ in a few products of poses.
    const ROUNDING: f64 = 1e-11;

    proptest! {
        #[test]
        fn parts_of_a_group_stay_as_they_are_to_one_another_wherever_one_of_them_is_put(
            (placed, groups) in scenes(),
            moves in prop::collection::vec((0..6usize, poses()), 1..40),
        ) {
            let mut now = placed.clone();
            for (part, pose) in moves {
                let before = now.clone();
                groups.put(&mut now, part, pose);
                prop_assert_eq!(now[part], pose);
                let together = groups.together(part);
                for other in 0..6 {
                    if !together.contains(&other) {
                        prop_assert_eq!(now[other], before[other]);
                    }
                }
                for group in groups.iter() {
                    let first = group.first();
                    for &other in group.parts() {
                        let relative = |poses: &[DAffine3]| poses[first].inverse() * poses[other];
                        prop_assert!(relative(&now).abs_diff_eq(relative(&placed), ROUNDING));
                    }
                }
                prop_assert!(groups.broken(&now).is_none());
            }
        }

        #[test]
        fn the_pose_of_a_group_is_found_back_from_each_of_its_parts((placed, groups) in scenes(), pose in poses()) {
            for group in groups.iter() {
                for (part, own) in group.placed(pose) {
                    let back = group.first_with(part, own).expect("one of the group");
                    prop_assert!(back.abs_diff_eq(pose, ROUNDING));
                }
                // Where they were joined, to the bit.
                for &part in group.parts() {
                    let mut now = placed.clone();
                    groups.put(&mut now, group.first(), pose);
                    groups.put(&mut now, part, placed[part]);
                    prop_assert_eq!(&now, &placed);
                }
            }
        }
    }

    fn at(x: f64) -> DAffine3 {
        DAffine3::from_translation(x * DVec3::X)
    }

    #[test]
    fn a_part_is_in_one_group_and_another_one_takes_that_in() {
        let file: Vec<DAffine3> = (0..6).map(|x| at(f64::from(x))).collect();
        let group = |parts: &[usize]| Group::new("g".into(), parts.to_vec(), &file, &file);
        for wrong in [&[][..], &[3], &[3, 3], &[3, 9]] {
            assert_eq!(group(wrong), None, "{wrong:?}");
        }
        let groups = Groups::default()
            .with(group(&[4, 5]).expect("two"))
            .with(group(&[2, 1]).expect("two"));
        let lists = |groups: &Groups| groups.iter().map(|g| g.parts().to_vec()).collect::<Vec<_>>();
        assert_eq!(lists(&groups), [vec![1, 2], vec![4, 5]]);
        let larger = groups.with(group(&[1, 2, 3]).expect("three"));
        assert_eq!(lists(&larger), [vec![1, 2, 3], vec![4, 5]]);
        assert_eq!(
            [0, 2, 3, 5].map(|part| larger.first(part)),
            [0, 1, 1, 4],
            "the first of its group, or itself"
        );
        assert_eq!(lists(&larger.without(2)), [vec![4, 5]]);
        assert_eq!(larger.together(0), [0]);
    }

    #[test]
    fn parts_as_the_file_has_them_are_joined_as_the_file_has_them() {
        let file = vec![at(0.0), at(10.0), at(20.0)];
        let elsewhere = vec![at(5.0), at(15.0 + 1e-9), at(3.0)];
        let group = Group::new("g".into(), vec![0, 1], &elsewhere, &file).expect("two");
        assert_eq!(group.placed(file[0]).last(), Some((1, file[1])));
        let other = Group::new("g".into(), vec![0, 2], &elsewhere, &file).expect("two");
        assert_eq!(other.placed(elsewhere[0]).last(), Some((2, elsewhere[2])));
        let groups = Groups::default().with(other);
        assert!(groups.broken(&file).is_some() && groups.broken(&elsewhere).is_none());
        let mut gathered = file.clone();
        groups.gather(&mut gathered);
        assert!(gathered[2].abs_diff_eq(at(-2.0), 1e-12) && gathered[1] == file[1]);
    }

    #[test]
    fn a_group_has_the_names_of_its_parts() {
        assert_eq!(name_of(&["peg", "nut"]), "peg, nut");
        assert_eq!(name_of(&["a", "b", "c"]), "a, b, c");
        assert_eq!(name_of(&["a", "b", "c", "d"]), "a, b and 2 more");
    }
}
