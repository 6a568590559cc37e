//! Motion by a six-axis device: its cap moves the view, the selected part, or the simulated hand, the faster the farther it is deflected.
//!
//! What the cap moves is chosen when it leaves its rest, and stays the same until it is back there: a part that is let go of in the meantime does not hand the
//! motion on to another one. Lengths are mm, angles rad, times s.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DAffine3, DQuat, DVec2, DVec3};

use super::camera::Camera;
use super::gesture::Viewpoint;
use super::six_axis::{Deflection, Subject, Use};
use crate::session::Session;
use crate::session::insertion::hold;
use crate::session::pose::{moved, rigid};

/// Shift at full deflection in a second, in heights of the picture.
const HEIGHTS_PER_S: f64 = 0.5;
/// Turn at full deflection, rad/s.
const RAD_PER_S: f64 = FRAC_PI_2;
/// Logarithm of the zoom at full deflection, 1/s.
const ZOOM_PER_S: f64 = 1.0;
/// Longest time that one frame covers: a late one does not jump.
const LONGEST_S: f64 = 0.1;
/// The hand goes this far ahead of the handle at most, mm and rad: at a wall it presses with 2 N, and leaves it at once when the cap turns back.
const LEAD_MM: f64 = 5.0;
const LEAD_RAD: f64 = 0.2;

impl Viewpoint {
    /// Moves what the cap moves, for `seconds` at this deflection.
    pub fn steer(&mut self, deflection: &Deflection, seconds: f64, session: &mut Session) {
        if deflection.is_rest() {
            if let Some(Subject::Part(part, _)) = self.six_axis.subject.take()
                && session.moves.dragged() == Some(part)
            {
                session.let_go_of_dragged("move");
            }
            return;
        }
        let subject = (self.six_axis.subject).unwrap_or_else(|| self.subject_of(session));
        let seconds = seconds.clamp(0.0, LONGEST_S);
        let [shift, turn] = deflection.speeds().map(|speed| speed * seconds);
        self.six_axis.subject = Some(match subject {
            Subject::View => {
                self.look_around(shift, turn, session);
                Subject::View
            }
            Subject::Hand(goal) => self.steer_hand(goal, [shift, turn], session),
            Subject::Part(part, goal) => self.steer_part(part, goal, [shift, turn], session),
            Subject::Nothing => Subject::Nothing,
        });
    }

    /// What a cap that leaves its rest moves.
    fn subject_of(&self, session: &mut Session) -> Subject {
        if self.is_dragging() {
            return Subject::Nothing;
        }
        if self.six_axis.used == Use::View {
            return Subject::View;
        }
        let simulated = session.connection().is_some_and(|c| c.capabilities.simulated);
        if let (true, Some(_), Some(handle)) = (simulated, session.grabbed(), session.scaled_handle()) {
            return Subject::Hand(handle);
        }
        let selected =
            (session.selected).filter(|part| session.document.as_ref().is_some_and(|d| !d.is_hidden(*part)));
        if let Some(part) = selected
            && session.begin_drag(part, self.handles.stops_at_contact)
            && let Some(pose) = session.dragged_from()
        {
            return Subject::Part(part, pose);
        }
        Subject::View
    }

    fn look_around(&mut self, shift: DVec3, turn: DVec3, session: &Session) {
        let Some(document) = &session.document else { return };
        self.goal = None;
        let camera = &mut self.camera;
        // The scene follows the cap as it follows the pointer; a drag over the whole height orbits by half a turn.
        camera.pan(HEIGHTS_PER_S * DVec2::new(shift.x, -shift.y));
        camera.orbit_about(camera.target, RAD_PER_S / PI * DVec2::new(turn.y, turn.x));
        camera.zoom_at(camera.target, (-ZOOM_PER_S * shift.z).exp(), document.extent);
    }

    fn steer_hand(&self, goal: DAffine3, by: [DVec3; 2], session: &mut Session) -> Subject {
        let (Some(part), Some(handle)) = (session.grabbed(), session.scaled_handle()) else {
            return Subject::Nothing;
        };
        let Some(middle) = session.document.as_ref().and_then(|d| d.middle(part)) else {
            return Subject::Nothing;
        };
        let next = stepped(&goal, middle, by, &self.camera);
        let goal = within_lead(&goal, &next, &handle);
        session.move_hand(hold(&goal));
        Subject::Hand(goal)
    }

    fn steer_part(&self, part: usize, goal: DAffine3, by: [DVec3; 2], session: &mut Session) -> Subject {
        if session.moves.dragged() != Some(part) {
            return Subject::Nothing;
        }
        let (Some(document), is_stopped) = (&session.document, session.moves.stopped_by().is_some()) else {
            return Subject::Nothing;
        };
        let (Some(pose), Some(middle)) = (document.poses.get(part), document.middle(part)) else {
            return Subject::Nothing;
        };
        // At another part the motion goes on from where it is, so that a cap that turns back acts at once.
        let goal = if is_stopped { *pose } else { goal };
        let middle = goal.transform_point3(pose.inverse().transform_point3(middle));
        let goal = stepped(&goal, middle, by, &self.camera);
        session.drag_to(goal);
        Subject::Part(part, goal)
    }
}

/// A pose turned about `middle` and shifted by a step of the cap, in the directions of the screen.
fn stepped(pose: &DAffine3, middle: DVec3, [shift, turn]: [DVec3; 2], camera: &Camera) -> DAffine3 {
    let axes = [camera.right(), camera.up(), camera.backward()];
    let in_world = |of: DVec3| of.x * axes[0] + of.y * axes[1] + of.z * axes[2];
    let height = camera.height_at(middle).abs();
    let turn = DQuat::from_scaled_axis(RAD_PER_S * in_world(turn));
    rigid(&moved(
        pose,
        middle,
        turn,
        HEIGHTS_PER_S * height * in_world(shift),
    ))
}

/// `next`, drawn back to within the lead of `at`, or to as far as `goal` is already.
fn within_lead(goal: &DAffine3, next: &DAffine3, at: &DAffine3) -> DAffine3 {
    let start = DQuat::from_mat3(&at.matrix3).normalize();
    let lead = |pose: &DAffine3| {
        let turn = DQuat::from_mat3(&pose.matrix3).normalize() * start.inverse();
        [pose.translation - at.translation, rotation_vector(turn)]
    };
    let (before, after) = (lead(goal), lead(next));
    let drawn = |i: usize, most: f64| after[i].clamp_length_max(most.max(before[i].length()));
    let [shift, turn] = [drawn(0, LEAD_MM), drawn(1, LEAD_RAD)];
    if [shift, turn] == after {
        return *next;
    }
    DAffine3::from_rotation_translation(DQuat::from_scaled_axis(turn) * start, at.translation + shift)
}

/// Axis times angle, rad, of the shorter way.
fn rotation_vector(turn: DQuat) -> DVec3 {
    if turn.w < 0.0 { -turn } else { turn }.to_scaled_axis()
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::sync::Arc;

    use super::*;
    use crate::session::document::Document;
    use crate::viewport::camera::View;

    fn session() -> Session {
        let mut session = Session::new(Arc::new(|| {}));
        session.document = Some(Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample"));
        session.poll();
        session
    }

    fn front() -> Viewpoint {
        let mut view = Viewpoint::default();
        view.camera.look(View::Front);
        view
    }

    fn along(x: f64, y: f64, z: f64) -> Deflection {
        Deflection {
            shift: DVec3::new(x, y, z),
            turn: DVec3::ZERO,
        }
    }

    fn about(x: f64, y: f64, z: f64) -> Deflection {
        Deflection {
            shift: DVec3::ZERO,
            turn: DVec3::new(x, y, z),
        }
    }

    /// Position of the middle of part 1 in the camera's frame.
    fn seen(view: &Viewpoint, session: &Session) -> DVec3 {
        let camera = &view.camera;
        let middle = session
            .document
            .as_ref()
            .expect("open")
            .middle(1)
            .expect("a part");
        let arm = middle - camera.eye();
        DVec3::new(
            arm.dot(camera.right()),
            arm.dot(camera.up()),
            arm.dot(camera.backward()),
        )
    }

    #[test]
    fn the_scene_goes_where_the_cap_is_pushed() {
        let mut session = session();
        for (push, axis) in [
            (along(0.5, 0.0, 0.0), DVec3::X),
            (along(0.0, 0.5, 0.0), DVec3::Y),
            (along(0.0, 0.0, 0.5), DVec3::Z),
        ] {
            let mut view = front();
            let before = seen(&view, &session);
            view.steer(&push, 0.1, &mut session);
            let by = seen(&view, &session) - before;
            assert!(
                by.dot(axis) > 0.9 * by.length() && by.length() > 0.1,
                "{axis}: {by}"
            );
            view.steer(&Deflection::default(), 0.1, &mut session);
            assert_eq!(view.six_axis.subject(), None);
        }
        // The front, which faces the viewer, goes to the right about up, and down about right.
        let document = session.document.as_ref().expect("open");
        let toward = document.extent.center - document.extent.radius * DVec3::Y;
        for (turn, axis) in [
            (about(0.0, 0.5, 0.0), DVec3::X),
            (about(0.5, 0.0, 0.0), DVec3::NEG_Y),
        ] {
            let mut view = front();
            view.camera.target = session.document.as_ref().expect("open").extent.center;
            let at = |view: &Viewpoint| {
                let (camera, arm) = (&view.camera, toward - view.camera.target);
                DVec3::new(arm.dot(camera.right()), arm.dot(camera.up()), 0.0)
            };
            let before = at(&view);
            view.steer(&turn, 0.1, &mut session);
            let by = at(&view) - before;
            assert!(
                by.dot(axis) > 0.9 * by.length() && by.length() > 0.1,
                "{axis}: {by}"
            );
        }
    }

    #[test]
    fn full_deflection_has_the_stated_speeds_and_half_of_it_a_quarter() {
        let mut session = session();
        session.selected = Some(1);
        let mut view = front();
        view.six_axis.switch();
        let pose = |session: &Session| session.document.as_ref().expect("open").poses[1];
        let before = pose(&session);
        let middle = session
            .document
            .as_ref()
            .expect("open")
            .middle(1)
            .expect("a part");
        let height = view.camera.height_at(middle);
        for _ in 0..10 {
            view.steer(&along(0.0, 1.0, 0.0), 0.1, &mut session);
        }
        let by = pose(&session).translation - before.translation;
        assert!((by - 0.5 * height * DVec3::Z).length() < 1e-9, "{by}");
        view.steer(&Deflection::default(), 0.1, &mut session);
        for _ in 0..10 {
            view.steer(&along(0.0, -0.5, 0.0), 0.1, &mut session);
        }
        let by = pose(&session).translation - before.translation;
        assert!((by - 0.375 * height * DVec3::Z).length() < 1e-9, "{by}");
        view.steer(&Deflection::default(), 0.1, &mut session);
        // A quarter of a turn a second about the part's own middle.
        let (middle, before) = (
            session
                .document
                .as_ref()
                .expect("open")
                .middle(1)
                .expect("a part"),
            pose(&session),
        );
        for _ in 0..10 {
            view.steer(&about(0.0, 0.0, 1.0), 0.1, &mut session);
        }
        let turned = pose(&session).matrix3 * before.matrix3.transpose();
        let turn = rotation_vector(DQuat::from_mat3(&turned));
        assert!((turn + FRAC_PI_2 * DVec3::Y).length() < 1e-9, "{turn}");
        let now = session
            .document
            .as_ref()
            .expect("open")
            .middle(1)
            .expect("a part");
        assert!(now.distance(middle) < 1e-9);
        view.steer(&Deflection::default(), 0.1, &mut session);
        let names: Vec<_> = std::iter::from_fn(|| {
            let name = session.moves.to_undo()?.to_owned();
            session.act(crate::session::Intent::Undo);
            Some(name)
        })
        .collect();
        assert_eq!(names, ["move peg"; 3], "each push is a step");
    }

    #[test]
    fn nothing_else_moves_until_the_cap_was_at_rest() {
        let mut session = session();
        session.selected = Some(1);
        let mut view = front();
        view.six_axis.switch();
        let push = along(1.0, 0.0, 0.0);
        view.steer(&push, 0.1, &mut session);
        assert!(matches!(view.six_axis.subject(), Some(Subject::Part(1, _))));
        session.take_back();
        let (camera, poses) = (
            view.camera,
            session.document.as_ref().expect("open").poses.clone(),
        );
        for _ in 0..5 {
            view.steer(&push, 0.1, &mut session);
        }
        assert_eq!(view.six_axis.subject(), Some(Subject::Nothing));
        assert_eq!(view.camera, camera);
        assert_eq!(session.document.as_ref().expect("open").poses, poses);
        view.steer(&Deflection::default(), 0.1, &mut session);
        assert_eq!(session.moves.to_undo(), None);
    }

    #[test]
    fn the_hand_stays_near_the_handle_and_may_always_come_back() {
        let at = |mm: f64| DAffine3::from_translation(mm * DVec3::X);
        let wall = at(0.0);
        let near = |a: DAffine3, b: DAffine3| assert!(a.abs_diff_eq(b, 1e-12), "{a:?} {b:?}");
        near(within_lead(&at(4.0), &at(4.9), &wall), at(4.9));
        near(within_lead(&at(4.9), &at(5.1), &wall), at(5.0));
        near(within_lead(&at(9.0), &at(9.5), &wall), at(9.0));
        near(within_lead(&at(9.0), &at(8.9), &wall), at(8.9));
        // Pressed against the wall it slides along it.
        let mut aside = at(5.0);
        aside.translation.y = 1.0;
        let slid = within_lead(&at(5.0), &aside, &wall).translation;
        assert!(slid.y > 0.9 && slid.length() < 5.0 + 1e-9, "{slid}");
        let turned = |rad: f64| DAffine3::from_rotation_z(rad);
        near(within_lead(&turned(0.19), &turned(0.21), &wall), turned(0.2));
        near(within_lead(&turned(0.4), &turned(0.39), &wall), turned(0.39));
    }

    #[test]
    fn a_late_frame_does_not_jump_and_garbage_is_bounded() {
        let mut session = session();
        let mut view = front();
        let before = view.camera.target;
        view.steer(&along(1e9, 0.0, 0.0), 1e9, &mut session);
        let by = view.camera.target.distance(before);
        let most = HEIGHTS_PER_S * LONGEST_S * view.camera.height_at(view.camera.target);
        assert!(by <= most * (1.0 + 1e-9), "{by} {most}");
    }
}
