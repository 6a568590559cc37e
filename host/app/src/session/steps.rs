//! The history of placements: named steps that can be undone and redone. Pure.
//!
//! A step holds only the parts that it moved, each with its pose before and after, so that a step of one part costs some two hundred bytes however large the
//! assembly is. Whatever moved parts beside the history is a step too, added by [`Steps::record`] before the next one: undo and redo then go through the same
//! states, in the same order, as a list of all states does. Poses are rigid, part to world, mm.

use std::collections::VecDeque;

use glam::DAffine3;

use super::groups::Groups;

/// Most steps kept: the oldest one is forgotten first.
pub const MOST_STEPS: usize = 200;

/// A part that a step moved.
#[derive(Clone, Debug, PartialEq)]
struct Change {
    part: usize,
    before: DAffine3,
    after: DAffine3,
}

/// A step of the history.
#[derive(Clone, Debug, PartialEq)]
struct Step {
    name: String,
    changes: Vec<Change>,
    /// Groups before and after, where it has changed them.
    regrouped: Option<[Groups; 2]>,
}

/// Where the parts are, and the steps before and after.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Steps {
    done: VecDeque<Step>,
    /// The step that is redone next is the last one.
    undone: Vec<Step>,
    now: Vec<DAffine3>,
    groups: Groups,
}

impl Steps {
    /// A history that begins with the parts at these poses and in these groups.
    pub fn beginning(poses: &[DAffine3], groups: Groups) -> Self {
        Self {
            now: poses.to_vec(),
            groups,
            ..Self::default()
        }
    }

    /// Where the history has the parts, mm.
    pub fn poses(&self) -> &[DAffine3] {
        &self.now
    }

    /// How the history has the parts grouped.
    pub fn groups(&self) -> &Groups {
        &self.groups
    }

    /// Adds a step, after which the parts are at `poses`, and forgets what was undone. No effect where nothing has moved, or there is another number of parts.
    /// Returns whether a step was added.
    pub fn record(&mut self, name: &str, poses: &[DAffine3]) -> bool {
        let changes = self.changes(poses);
        !changes.is_empty() && self.add(name, changes, None, poses)
    }

    /// Adds a step that groups the parts otherwise, after which they are at `poses`. Returns whether a step was added.
    pub fn regroup(&mut self, name: &str, poses: &[DAffine3], groups: Groups) -> bool {
        if groups == self.groups {
            return self.record(name, poses);
        }
        let before = std::mem::replace(&mut self.groups, groups.clone());
        self.add(name, self.changes(poses), Some([before, groups]), poses)
    }

    /// The parts that are elsewhere at `poses`; none where there is another number of parts.
    fn changes(&self, poses: &[DAffine3]) -> Vec<Change> {
        if poses.len() != self.now.len() {
            return Vec::new();
        }
        let pairs = self.now.iter().zip(poses).enumerate();
        pairs
            .filter(|(_, (before, after))| before != after)
            .map(|(part, (before, after))| Change {
                part,
                before: *before,
                after: *after,
            })
            .collect()
    }

    fn add(
        &mut self,
        name: &str,
        changes: Vec<Change>,
        regrouped: Option<[Groups; 2]>,
        poses: &[DAffine3],
    ) -> bool {
        self.undone.clear();
        self.done.push_back(Step {
            name: name.to_owned(),
            changes,
            regrouped,
        });
        if self.done.len() > MOST_STEPS {
            self.done.pop_front();
        }
        self.now = poses.to_vec();
        true
    }

    /// Adds a step that goes on with the last one, where that has the same name and moved the same parts: both are undone at once, as for a key that is held
    /// down.
    pub fn go_on(&mut self, name: &str, poses: &[DAffine3]) -> bool {
        let added = self.record(name, poses);
        let count = self.done.len();
        if !added || count < 2 {
            return added;
        }
        let (before, last) = (&self.done[count - 2], &self.done[count - 1]);
        let parts = |step: &Step| step.changes.iter().map(|change| change.part).collect::<Vec<_>>();
        let regroups = before.regrouped.is_some() || last.regrouped.is_some();
        if !regroups && before.name == last.name && parts(before) == parts(last) {
            let last = self.done.pop_back();
            let ends = last.into_iter().flat_map(|step| step.changes);
            let onto = self
                .done
                .back_mut()
                .into_iter()
                .flat_map(|step| &mut step.changes);
            for (change, end) in onto.zip(ends) {
                change.after = end.after;
            }
        }
        true
    }

    /// As [`Self::go_on`], whatever parts have moved before and now, as for a slider that moves one after another. A step that leads back to where it began
    /// stays, so that what follows does not go on with the step before it.
    pub fn go_on_with_others(&mut self, name: &str, poses: &[DAffine3]) {
        if self.to_undo() != Some(name) || poses.len() != self.now.len() {
            self.record(name, poses);
            return;
        }
        self.undo();
        self.undone.clear();
        if !self.record(name, poses) {
            self.done.push_back(Step {
                name: name.to_owned(),
                changes: Vec::new(),
                regrouped: None,
            });
        }
    }

    /// Name of the step that is undone next.
    pub fn to_undo(&self) -> Option<&str> {
        self.done.back().map(|step| step.name.as_str())
    }

    /// Name of the step that is redone next.
    pub fn to_redo(&self) -> Option<&str> {
        self.undone.last().map(|step| step.name.as_str())
    }

    /// Whether the step that is undone next, or redone, groups the parts otherwise.
    pub fn regroups(&self, back: bool) -> bool {
        let next = if back {
            self.done.back()
        } else {
            self.undone.last()
        };
        next.is_some_and(|step| step.regrouped.is_some())
    }

    /// Goes back by one step; returns its name. The parts are then at [`Self::poses`].
    pub fn undo(&mut self) -> Option<String> {
        let step = self.done.pop_back()?;
        for change in &step.changes {
            self.now[change.part] = change.before;
        }
        if let Some([before, _]) = &step.regrouped {
            self.groups.clone_from(before);
        }
        let name = step.name.clone();
        self.undone.push(step);
        Some(name)
    }

    /// Goes on by the step undone last; returns its name. The parts are then at [`Self::poses`].
    pub fn redo(&mut self) -> Option<String> {
        let step = self.undone.pop()?;
        for change in &step.changes {
            self.now[change.part] = change.after;
        }
        if let Some([_, after]) = &step.regrouped {
            self.groups.clone_from(after);
        }
        let name = step.name.clone();
        self.done.push_back(step);
        Some(name)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;
    use crate::session::groups::Group;

    fn at(x: f64) -> DAffine3 {
        DAffine3::from_translation(x * DVec3::X)
    }

    #[test]
    fn steps_are_undone_and_redone_by_name() {
        let mut steps = Steps::beginning(&[at(0.0), at(1.0)], Groups::default());
        assert_eq!((steps.undo(), steps.redo()), (None, None));
        assert!(steps.record("move a", &[at(5.0), at(1.0)]));
        assert!(!steps.record("nothing", &[at(5.0), at(1.0)]));
        assert!(!steps.record("another assembly", &[at(0.0)]));
        assert!(steps.record("move b", &[at(5.0), at(2.0)]));
        assert_eq!((steps.to_undo(), steps.to_redo()), (Some("move b"), None));
        assert_eq!(steps.undo().as_deref(), Some("move b"));
        assert_eq!(steps.poses(), [at(5.0), at(1.0)]);
        assert_eq!(
            (steps.to_undo(), steps.to_redo()),
            (Some("move a"), Some("move b"))
        );
        assert_eq!(steps.redo().as_deref(), Some("move b"));
        assert_eq!(steps.poses(), [at(5.0), at(2.0)]);
    }

    #[test]
    fn a_key_that_is_held_down_is_one_step() {
        let mut steps = Steps::beginning(&[at(0.0), at(1.0)], Groups::default());
        for x in 1..=10 {
            assert!(steps.go_on("nudge a", &[at(f64::from(x)), at(1.0)]));
        }
        // Another part, and another name.
        steps.go_on("nudge a", &[at(10.0), at(2.0)]);
        steps.go_on("turn a", &[at(11.0), at(2.0)]);
        let mut undone = Vec::new();
        while steps.undo().is_some() {
            undone.push(steps.poses()[0]);
        }
        assert_eq!(undone, [at(10.0), at(10.0), at(0.0)]);
        while steps.redo().is_some() {}
        assert_eq!(steps.poses(), [at(11.0), at(2.0)]);
    }

    /// The slider moves one part after the other, back to where it began, and on again.
    #[test]
    fn a_slider_that_is_dragged_is_one_step() {
        let mut steps = Steps::beginning(&[at(0.0), at(0.0)], Groups::default());
        assert!(steps.record("slide", &[at(1.0), at(0.0)]));
        assert!(steps.record("slide", &[at(2.0), at(0.0)]));
        for poses in [[3.0, 0.0], [3.0, 1.0], [2.0, 0.0], [1.0, 0.0], [1.0, 5.0]] {
            steps.go_on_with_others("slide", &poses.map(at));
            assert_eq!(steps.poses(), poses.map(at));
        }
        assert_eq!(steps.undo().as_deref(), Some("slide"));
        assert_eq!(steps.poses(), [at(1.0), at(0.0)], "no more than the drag");
        assert_eq!(steps.redo().as_deref(), Some("slide"));
        assert_eq!(steps.poses(), [at(1.0), at(5.0)]);
    }

    #[test]
    fn a_change_of_groups_is_a_step_though_nothing_moves() {
        let poses = [at(0.0), at(1.0), at(2.0)];
        let mut steps = Steps::beginning(&poses, Groups::default());
        let group = Group::new("g".into(), vec![0, 1], &poses, &poses).expect("two parts");
        let groups = Groups::default().with(group);
        assert!(!steps.regroup("nothing", &poses, Groups::default()));
        assert!(steps.regroup("group g", &poses, groups.clone()));
        let moved = [at(5.0), at(6.0), at(2.0)];
        assert!(steps.go_on("move g", &moved));
        assert!(steps.regroup("ungroup g", &moved, Groups::default()));
        assert!(steps.regroups(true) && !steps.regroups(false));
        assert_eq!(steps.undo().as_deref(), Some("ungroup g"));
        assert!(!steps.regroups(true) && steps.regroups(false));
        assert_eq!((steps.groups(), steps.poses()), (&groups, &moved[..]));
        assert_eq!(steps.undo().as_deref(), Some("move g"));
        assert_eq!((steps.groups(), steps.poses()), (&groups, &poses[..]));
        assert_eq!(steps.undo().as_deref(), Some("group g"));
        assert!(steps.groups().is_empty());
        assert_eq!(steps.redo().as_deref(), Some("group g"));
        assert_eq!(steps.groups(), &groups);
    }

    #[test]
    fn the_oldest_steps_are_forgotten() {
        let mut steps = Steps::beginning(&[at(0.0)], Groups::default());
        for x in 1..=MOST_STEPS + 7 {
            steps.record("move", &[at(x as f64)]);
        }
        let undone = std::iter::from_fn(|| steps.undo()).count();
        assert_eq!((undone, steps.poses()), (MOST_STEPS, &[at(7.0)][..]));
    }

    /// What is done in the test below.
    #[derive(Clone, Debug)]
    enum Doing {
        Move(Vec<(usize, f64)>),
        Undo,
        Redo,
    }

    fn doings() -> impl Strategy<Value = Vec<Doing>> {
        let moves = prop::collection::vec((0..4usize, -3.0..3.0f64), 1..4);
        let one = prop_oneof![
            3 => moves.prop_map(Doing::Move),
            2 => Just(Doing::Undo),
            1 => Just(Doing::Redo),
        ];
        prop::collection::vec(one, 0..300)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// The list has every state since the beginning, and the place in it at which the parts are.
        #[test]
        fn the_history_is_a_list_of_states(doings in doings()) {
            let start = vec![at(0.0); 4];
            let mut steps = Steps::beginning(&start, Groups::default());
            let (mut states, mut place) = (vec![start], 0);
            for doing in doings {
                match doing {
                    Doing::Move(parts) => {
                        let mut poses = steps.poses().to_vec();
                        for (part, x) in parts {
                            poses[part] = at(x);
                        }
                        if poses != states[place] {
                            states.truncate(place + 1);
                            states.push(poses.clone());
                            // The oldest ones are forgotten.
                            let surplus = states.len().saturating_sub(MOST_STEPS + 1);
                            states.drain(..surplus);
                            place = states.len() - 1;
                        }
                        steps.record("move", &poses);
                    }
                    Doing::Undo => {
                        prop_assert_eq!(steps.undo().is_some(), place > 0);
                        place = place.saturating_sub(1);
                    }
                    Doing::Redo => {
                        let further = place + 1 < states.len();
                        prop_assert_eq!(steps.redo().is_some(), further);
                        place += usize::from(further);
                    }
                }
                prop_assert_eq!(steps.poses(), &states[place][..]);
            }
        }
    }
}
