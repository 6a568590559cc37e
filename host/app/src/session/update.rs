//! Effects of messages from other threads on the session.

use std::sync::Arc;

use glam::DVec3;
use mortise_protocol::image::NO_FACE;
use mortise_protocol::message::{DeviceState, ResetReason, Telemetry, ToDevice, TouchingPair};
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, Event, describe};

use super::ask::answer;
use super::document::Document;
use super::grouped::Grouped;
use super::held::Held;
use super::history::Sample;
use super::insertion::Wall;
use super::intent::Intent;
use super::link::{Command, Connection, Link};
use super::moves::PUT_BACK;
use super::notes::Severity;
use super::outbox::{CollisionModel, Imported, LinkUpdate, Update};
use super::pose;
use super::state::{Lost, Session};
use super::tap::{GuidanceCommand, Tap};
use super::touch::Touch;
use super::verdict::Moment;

/// Samples between two queries of the counters: about two seconds.
const STATISTICS_EVERY: u32 = 120;

/// Applies one message; returns the intent that it stands for, if any. Messages of a file or connection that no longer exists are dropped.
pub fn take(session: &mut Session, update: Update) -> Option<Intent> {
    match update {
        Update::Imported { generation, result } if is_awaited(session, generation) => {
            session.job = None;
            match result {
                Ok(imported) => opened(session, *imported),
                Err(why) => {
                    session.tour = None;
                    session.pending_project = None;
                    session.check_recent();
                    session.notes.add(Severity::Error, why);
                }
            }
        }
        Update::Working {
            generation,
            doing,
            fraction,
        } => {
            if let Some(job) = &mut session.job
                && job.generation == generation
            {
                if let Some(doing) = doing {
                    job.doing = doing;
                }
                job.fraction = Some(fraction);
            }
        }
        Update::Baked {
            generation,
            of,
            result,
        } if is_awaited(session, generation) && has_groups(session, &of) => {
            session.job = None;
            match result {
                Ok(model) => baked_of(session, model),
                Err(why) => {
                    session.tour = None;
                    session.notes.add(Severity::Error, format!("Not baked: {why}"));
                }
            }
        }
        Update::Imported { .. } | Update::Baked { .. } => {}
        Update::Rigs(rigs) => session.rigs = rigs,
        Update::Link { id, update } => {
            let current = match &session.link {
                Link::None => false,
                Link::Connecting { id: current, .. } => *current == id,
                Link::Connected(connection) => connection.id == id,
            };
            if current {
                link(session, update);
            }
        }
        Update::Guidance { link, list } => {
            if session.connection().is_some_and(|c| c.id == link) {
                session.guidance = list;
            }
        }
        Update::Fits(found) => session.fits_found(found),
        Update::Sequence(found) => session.sequencing.take_in(found),
        Update::Ways(found) => session.ways_found(found),
        Update::Energy(end) => session.energy_made(*end),
        Update::Chosen(purpose, path) => return Some(answer(purpose, path, true)),
        Update::NoDialog(purpose) => session.wants_path = Some(purpose),
        Update::Missing(missing) => session.missing = missing,
        Update::Marked { models, mark } => session.marked(models, mark),
        Update::ProjectRead { path, result } => session.project_read(path, result),
        Update::Run(read) => session.run_read(read),
        Update::Recompute(of, update) => session.recompute_update(&of, update),
        Update::Flashing(update) => session.flashed(update),
        Update::Joints(found) => session.joints.take_in(found),
        Update::Connections(found) => session.connections.take_in(found),
        Update::Written(Ok(done)) => session.notes.add(Severity::Good, done),
        Update::Written(Err(why)) => session.notes.add(Severity::Error, why),
    }
    None
}

fn is_awaited(session: &Session, generation: u64) -> bool {
    session
        .job
        .as_ref()
        .is_some_and(|job| job.generation == generation)
}

/// Whether a collision model has the groups of the open document.
fn has_groups(session: &Session, of: &Arc<Grouped>) -> bool {
    let document = session.document.as_ref();
    document.is_some_and(|document| Arc::ptr_eq(&document.grouped, of))
}

fn opened(session: &mut Session, Imported { document, saved }: Imported) {
    session.note_project();
    let parts = document.model.parts.len();
    session.notes.add(
        Severity::Good,
        format!(
            "Opened {}: {parts} {}, unit {}",
            document.title,
            if parts == 1 { "part" } else { "parts" },
            document.model.unit
        ),
    );
    for warning in &document.model.warnings {
        session.notes.add(Severity::Warning, warning.clone());
    }
    session.select(None);
    session.drop_fits();
    session.playback = None;
    session.before_run = None;
    session.sequencing.cancel();
    session.connections.cancel();
    session.ways.clear();
    session.partner = None;
    session.verdict = None;
    session.instructions.end();
    session.document = Some(document);
    session.view = None;
    session.clear_board();
    session.restore(saved);
    session.bake();
}

fn baked_of(session: &mut Session, CollisionModel { baked, reached }: CollisionModel) {
    let report = &baked.report;
    let (kib, shapes) = (report.image_bytes.div_ceil(1024), report.shapes.len());
    let cells = report.shapes.iter().map(|s| s.cell_mm);
    let what = reached.unwrap_or_else(|| {
        let finest = cells.fold(f64::INFINITY, f64::min);
        format!("finest cells {finest:.3} mm")
    });
    session.notes.add(
        Severity::Good,
        format!("Collision model baked: {kib} KiB, {shapes} shapes; {what}"),
    );
    for warning in &report.warnings {
        session.notes.add(Severity::Warning, warning.clone());
    }
    if let Some(document) = &mut session.document {
        document.baked = Some(baked);
    }
}

fn link(session: &mut Session, update: LinkUpdate) {
    match update {
        LinkUpdate::Connected {
            client,
            parameters,
            tap,
        } => connected(session, client, parameters, tap),
        LinkUpdate::Failed(why) => {
            std::mem::replace(&mut session.link, Link::None).close(false);
            session.tour = None;
            if let Some(lost) = &mut session.lost {
                lost.why.clone_from(&why);
            }
            session.notes.add(Severity::Error, why);
        }
        LinkUpdate::Event(event) => self::event(session, event),
        LinkUpdate::Answered { message, result } => answered(session, &message, result),
        LinkUpdate::Unanswered => {}
        LinkUpdate::Uploading(progress) => {
            if let Some(connection) = session.connection_mut() {
                connection.upload = Some(progress);
            }
        }
        LinkUpdate::Uploaded { generation, result } => uploaded(session, generation, result),
        LinkUpdate::Recording(update) => session.recording_update(update),
        LinkUpdate::Rig(result) => session.rig_read(*result),
        LinkUpdate::RigSent(result) => session.rig_sent(result.map(|sent| *sent)),
        LinkUpdate::Readings(readings) => session.readings(&readings),
        LinkUpdate::Referenced(result) => session.reference_set(result),
        LinkUpdate::MotorTested(result) => session.motor_tested(result),
        LinkUpdate::Statistics(statistics) => {
            if let Some(connection) = session.connection_mut() {
                connection.statistics = Some(statistics);
            }
        }
    }
}

fn connected(session: &mut Session, client: Arc<Client>, parameters: Vec<(ParameterId, f32)>, tap: Tap) {
    let Link::Connecting {
        id,
        spec,
        commands,
        thread,
    } = std::mem::replace(&mut session.link, Link::None)
    else {
        return;
    };
    let connection = Connection::new(id, spec, client, tap, commands, thread);
    session.lost = None;
    session.notes.add(
        Severity::Good,
        format!(
            "Connected to {} ({}), {} Hz, {}",
            connection.capabilities.board,
            connection.spec,
            connection.capabilities.tick_hz,
            describe(connection.state),
        ),
    );
    // An unexpected restart is reported; power-up is not.
    let reset = connection.capabilities.reset;
    if !matches!(
        reset,
        ResetReason::PowerOn | ResetReason::Requested | ResetReason::Unknown
    ) {
        session.notes.add(Severity::Warning, describe(reset));
    }
    for (id, value) in parameters {
        if let Some(known) = session.parameters.get_mut(id as usize) {
            *known = value;
        }
    }
    let capacity = u64::from(connection.capabilities.scene_capacity);
    session.link = Link::Connected(Box::new(connection));
    session.send_own_parameters();
    session.show_board_rig();
    session.history.interrupt();
    let too_large = (session.document.as_ref())
        .and_then(|d| d.baked.as_ref())
        .is_some_and(|baked| baked.image.len() as u64 > capacity);
    if too_large && !session.is_busy() {
        session.notes.add(
            Severity::Info,
            format!(
                "The collision model is larger than the {} KiB this board holds: baking a coarser one",
                capacity / 1024
            ),
        );
        session.bake();
    }
}

fn event(session: &mut Session, event: Event) {
    match event {
        Event::Telemetry(telemetry) => sample(session, telemetry),
        Event::State { state, .. } => {
            let Some(connection) = session.connection_mut() else {
                return;
            };
            if connection.state == state {
                return;
            }
            connection.state = state;
            if state != DeviceState::Active {
                session.let_go();
            }
            // The fault itself was reported in the tick in which it occurred.
            if matches!(state, DeviceState::Fault(_)) {
                return;
            }
            let severity = match state {
                DeviceState::Stopped => Severity::Error,
                DeviceState::Armed => Severity::Good,
                _ => Severity::Info,
            };
            session
                .notes
                .add(severity, format!("Board is {}", describe(state)));
        }
        Event::Fault { fault, .. } => session.notes.add(Severity::Error, describe(fault)),
        Event::Log(line) => session.notes.add(Severity::Info, format!("Board: {line}")),
        Event::LinkLost(why) => {
            let link = std::mem::replace(&mut session.link, Link::None);
            if let Link::Connected(connection) = &link {
                session.lost = Some(Lost {
                    spec: connection.spec.clone(),
                    why: why.clone(),
                });
            }
            link.close(false);
            session.clear_board();
            session.rig_page.link_lost();
            session.tour = None;
            session.notes.add(
                Severity::Error,
                format!("The link to the board is lost: {why}; the board switches its motors off by itself; press Reconnect"),
            );
        }
    }
}

fn sample(session: &mut Session, telemetry: Box<Telemetry>) {
    let Some(connection) = session.connection_mut() else {
        return;
    };
    let sample = Sample::of(&telemetry, connection.capabilities.tick_hz);
    session.history.add(sample);
    if let (Some((part, object)), Some(document)) = (&telemetry.object, &mut session.document)
        && let Some(part) = document.model_part(*part)
    {
        let object = pose::from_wire(object);
        document.put(part, object);
        if session.held.is_none_or(|held| held.part != part) {
            let scale = session.chosen_position_scale();
            session.held = Some(Held::new(part, scale, &telemetry.handle, &object));
            session.verdict = None;
        }
        watch(session, part, &telemetry, &sample);
    } else if telemetry.object.is_none() {
        session.held = None;
    }
    session.telemetry = Some(telemetry);
    session.samples_since_statistics += 1;
    if session.samples_since_statistics >= STATISTICS_EVERY {
        session.samples_since_statistics = 0;
        if let Some(connection) = session.connection() {
            connection.command(Command::Statistics);
        }
    }
}

/// Reports whether the held part is fully inserted or stuck.
fn watch(session: &mut Session, held: usize, telemetry: &Telemetry, sample: &Sample) {
    let Some(document) = &mut session.document else {
        return;
    };
    let moment = Moment {
        time_s: sample.time_s,
        held,
        contact_n: DVec3::from(telemetry.contact.force.map(f64::from)),
        handle_n: f64::from(sample.handle_n),
    };
    // Moved out of the document because `blocker` borrows the rest of it.
    let mut watch = std::mem::take(&mut document.watch);
    let verdict = watch.sample(&document.poses, &moment, |walls| {
        blocker(document, held, telemetry, walls)
    });
    document.watch = watch;
    session.report(verdict);
}

/// Feature that the held part meets, in words: “rim of plate, hole 2”.
fn blocker(document: &Document, held: usize, telemetry: &Telemetry, walls: &[Wall]) -> String {
    let Some((pair, part)) = (telemetry.pairs.first())
        .and_then(|pair| document.model_part(pair.static_part).map(|part| (pair, part)))
    else {
        return "an unknown obstacle".to_owned();
    };
    met(document, held, pair, part, walls)
}

/// Feature of `part` that the held part meets by this pair, in words. Several holes are numbered in the order of their faces.
fn met(document: &Document, held: usize, pair: &TouchingPair, part: usize, walls: &[Wall]) -> String {
    let faces = [pair.static_face, pair.static_edge_face];
    let touch = Touch::of(document, part, faces, pose::point_from_wire(pair.point));
    let known: Vec<u32> = (faces.iter())
        .filter(|&&face| face != NO_FACE)
        .map(|&face| face.into())
        .collect();
    let (owner, _) = document.owner(part, &known);
    let is_its = |wall: &&Wall| owner.is_none() || document.owner(part, &wall.faces).0 == owner;
    let bores: Vec<&Wall> = (walls.iter())
        .filter(|wall| wall.part == part && wall.inner)
        .filter(is_its)
        .collect();
    let met = (bores.iter()).position(|bore| faces.iter().any(|&f| bore.faces.contains(&u32::from(f))));
    let what = match (touch, met) {
        (Touch::Edge, Some(_)) => "rim".to_owned(),
        (Touch::Face, Some(_)) => "wall".to_owned(),
        (other, _) => other.to_string(),
    };
    let name = document.owner_name(part, &known);
    let own = Touch::of(
        document,
        held,
        [pair.moving_face, pair.moving_edge_face],
        pose::point_from_wire(pair.point),
    );
    match met {
        Some(index) if bores.len() > 1 => format!("{what} of {name}, hole {}", index + 1),
        Some(_) => format!("{what} of {name}"),
        None => format!("{own} on {what} of {name}"),
    }
}

fn answered(session: &mut Session, message: &ToDevice, result: Result<(), String>) {
    if let Some(connection) = session.connection_mut() {
        connection.answered(message);
    }
    if let Err(why) = result {
        session.tour = None;
        session.notes.add(Severity::Error, why);
        return;
    }
    if let (ToDevice::ResetScene, Some(document)) = (message, &mut session.document) {
        document.reset_poses();
        session.note_step(PUT_BACK);
        session.verdict = None;
        session.command_guidance(GuidanceCommand::PutBack);
    }
}

fn uploaded(session: &mut Session, generation: u64, result: Result<bool, String>) {
    let current = session.document.as_ref().map(|d| d.generation);
    let Some(connection) = session.connection_mut() else {
        return;
    };
    let whole = connection.sent_scene(matches!(result, Ok(true)));
    match result {
        Ok(false) => {
            // Uploaded again only on the operator's request.
            connection.refused_scene_of = Some(generation);
            session.tour = None;
            session.notes.add(
                Severity::Info,
                "Upload cancelled: the previous collision model stays in use",
            );
        }
        Ok(true) => {
            connection.scene_of = Some(generation);
            connection.refused_scene_of = None;
            if current == Some(generation) {
                if let Some(document) = &mut session.document {
                    document.reset_poses();
                }
                session.start_guidance();
                if whole {
                    session
                        .notes
                        .add(Severity::Good, "The collision model is on the board");
                }
            }
        }
        Err(why) => {
            connection.refused_scene_of = Some(generation);
            session.tour = None;
            session
                .notes
                .add(Severity::Error, format!("Upload failed: {why}"));
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;
    use mortise_brep::{CadModel, Face, Frame, Mesh, Part, Shape, Surface};

    use super::*;
    use crate::session::insertion::local_walls;

    /// A top face, then a wall for each of `holes`: x of its axis, and the z range of its wall's mesh.
    fn plate(holes: &[(f64, f64, f64)]) -> Shape {
        let frame = |x: f64| Frame {
            origin: DVec3::new(x, 0.0, 0.0),
            x: DVec3::X,
            y: DVec3::Y,
            z: DVec3::Z,
        };
        let face = |surface, reversed| Face {
            surface,
            fit_mm: None,
            reversed,
            area_mm2: 1.0,
            edges: vec![],
            color: None,
        };
        let mut shape = Shape {
            faces: vec![face(Surface::Plane { frame: frame(0.0) }, false)],
            mesh: Mesh {
                vertices: vec![],
                triangles: vec![],
                triangle_face: vec![],
            },
            ..Shape::default()
        };
        for &(x, low, high) in holes {
            let (first, id) = (shape.mesh.vertices.len() as u32, shape.faces.len() as u32);
            let surface = Surface::Cylinder {
                frame: frame(x),
                radius: 5.0,
            };
            shape.faces.push(face(surface, true));
            let at = |y: f64, z: f64| DVec3::new(x, y, z);
            shape
                .mesh
                .vertices
                .extend([at(5.0, low), at(-5.0, low), at(5.0, high)]);
            shape.mesh.triangles.push([first, first + 1, first + 2]);
            shape.mesh.triangle_face.push(id);
        }
        shape
    }

    fn met_at(shape: Shape, faces: [u16; 2]) -> String {
        let part = |name: &str| Part {
            name: name.into(),
            path: vec![],
            shape: 0,
            placement: DAffine3::IDENTITY,
            color: None,
        };
        let model = CadModel {
            shapes: vec![shape],
            parts: vec![part("plate"), part("other plate")],
            ..CadModel::default()
        };
        // The held part is the other plate; its own holes must not be counted.
        let walls = local_walls(&model);
        let document = Document::of(model, None, String::new(), 0);
        let pair = TouchingPair {
            moving_face: 0,
            static_part: 0,
            static_face: faces[0],
            moving_edge_face: NO_FACE,
            static_edge_face: faces[1],
            count: 1,
            depth: 1e-5,
            point: [0.0; 3],
            insertion: 0.0,
        };
        met(&document, 1, &pair, 0, &walls)
    }

    #[test]
    fn holes_of_a_part_with_several_are_numbered() {
        let two = || plate(&[(-20.0, 0.0, 8.0), (20.0, 0.0, 8.0)]);
        assert_eq!(met_at(two(), [1, NO_FACE]), "wall of plate, hole 1");
        assert_eq!(met_at(two(), [2, NO_FACE]), "wall of plate, hole 2");
        assert_eq!(met_at(two(), [0, 2]), "rim of plate, hole 2");
        assert_eq!(met_at(two(), [2, 0]), "rim of plate, hole 2");
        assert_eq!(met_at(two(), [0, NO_FACE]), "face on face of plate");
        // A wall in two halves is one hole; two walls on one axis with a gap between them are two.
        let halves = plate(&[(-20.0, 0.0, 8.0), (-20.0, 0.0, 8.0), (20.0, 0.0, 8.0)]);
        assert_eq!(met_at(halves.clone(), [2, NO_FACE]), "wall of plate, hole 1");
        assert_eq!(met_at(halves, [3, NO_FACE]), "wall of plate, hole 2");
        let above = plate(&[(0.0, 0.0, 8.0), (0.0, 20.0, 28.0)]);
        assert_eq!(met_at(above, [2, NO_FACE]), "wall of plate, hole 2");
        // A single hole needs no number.
        let one = plate(&[(0.0, 0.0, 8.0)]);
        assert_eq!(met_at(one, [1, NO_FACE]), "wall of plate");
    }
}
