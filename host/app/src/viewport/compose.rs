//! Builds the picture from the session: colours, the held part, touching features, force arrows. Pure.

use glam::{DAffine3, DVec3};
use mortise_guide::Standing;
use mortise_protocol::image::NO_FACE;
use mortise_protocol::message::Telemetry;
use mortise_protocol::parameter::ParameterId;

use super::camera::Camera;
use super::picture::{
    Areas, Arrow, Cutaway, Fill, Glow, Ground, Item, MAX_LIT, MAX_LIT_EDGES, Picture, Shells,
};
use crate::cut::Shown;
use crate::display::extent::Extent;
use crate::display::mesh::meeting;
use crate::session::Session;
use crate::session::document::Document;
use crate::session::fitting::Offer;
use crate::session::pose::point_from_wire;

/// Edges of parts, sRGB and opacity.
const EDGE: [f32; 4] = [0.05, 0.06, 0.08, 0.75];
/// Edges of transparent parts: light, for contrast with the dark ground.
const EDGE_GLASS: [f32; 4] = [0.66, 0.72, 0.80, 0.55];
/// Edges of the selected part.
const EDGE_MARKED: [f32; 4] = [0.45, 0.72, 1.0, 1.0];
/// Edges of the held part.
const EDGE_HELD: [f32; 4] = [1.0, 0.80, 0.45, 1.0];
/// The same three for the light ground, darker for contrast.
const EDGE_GLASS_LIGHT: [f32; 4] = [0.22, 0.27, 0.34, 0.60];
const EDGE_MARKED_LIGHT: [f32; 4] = [0.05, 0.32, 0.72, 1.0];
const EDGE_HELD_LIGHT: [f32; 4] = [0.55, 0.28, 0.0, 1.0];
/// Colour mixed into the held part, and its weight.
const TINT_HELD: [f32; 4] = [0.96, 0.65, 0.26, 0.55];
/// Colour mixed into parts that are pointed out, and its weight.
const TINT_MARKED: [f32; 4] = [0.45, 0.72, 1.0, 0.35];
/// Colour mixed into the part under the pointer, and its weight.
const TINT_OVER: [f32; 4] = [0.45, 0.72, 1.0, 0.12];
/// Colour of the ghost, which shows the pose that the handle commands for the held part.
const GHOST: [f32; 3] = [0.45, 0.72, 1.0];
/// Colour of the ghost of a part in a fit.
const GHOST_FIT: [f32; 3] = [0.40, 0.82, 0.58];
/// Opacity of a wall of the glow from where a part is drawn to its fit, at the largest force.
const GLOW_OPACITY: f32 = 0.12;
/// Directions across the hatching of sections, degrees, by part.
const HATCHES: [f32; 4] = [45.0, 135.0, 20.0, 110.0];
/// Opacity of fixed parts drawn as glass.
const SEEN_THROUGH: f32 = 0.26;
/// Smallest distance at which a ghost is drawn, in radii of the scene: a nearer one is indistinguishable from its part.
const GHOST_FROM: f64 = 5e-4;
/// Longest arrow, in radii of the scene. At the force below, N, an arrow has 63 % of it: small forces are visible, large ones stay in the
/// picture.
const LONGEST_RADII: f64 = 0.9;
const ARROW_FORCE: f64 = 2.5;

/// How a document is looked at.
#[derive(Clone, Copy, Default)]
pub struct Look<'a> {
    /// Camera.
    pub camera: Camera,
    /// Whether fixed parts are drawn as glass.
    pub see_through: bool,
    /// The section, where there is one.
    pub cut: Option<Shown<'a>>,
    /// Parts that are pointed out.
    pub marked: &'a [usize],
    /// The part under the pointer.
    pub over: Option<usize>,
    /// The parts of the connection under the pointer: outlined, and the others drawn as glass.
    pub pair: Option<[usize; 2]>,
    /// Background.
    pub ground: Ground,
    /// Pixels per point; 0: edges have no width.
    pub scale: f32,
}

impl Look<'_> {
    /// Whether the pointer is on a part or on a connection of it.
    fn is_over(&self, part: usize) -> bool {
        self.over == Some(part) || self.pair.is_some_and(|pair| pair.contains(&part))
    }
}

/// The picture of `document` in the state of `session`.
pub fn compose(session: &Session, document: &Document, look: &Look<'_>) -> Picture {
    let [marked_line, held_line, glass_line] = match look.ground {
        Ground::Dark => [EDGE_MARKED, EDGE_HELD, EDGE_GLASS],
        Ground::Light => [EDGE_MARKED_LIGHT, EDGE_HELD_LIGHT, EDGE_GLASS_LIGHT],
    };
    let held = session.grabbed();
    let fit = session
        .fitting
        .as_ref()
        .and_then(|fitting| Some((fitting.moving, fitting.offer()?)));
    let touching = session.telemetry.as_deref().filter(|_| held.is_some());
    // A part within others is seen through them.
    let focus = session.joints.in_focus(document);
    let focus = focus.or(look.pair.map(Vec::from));
    let mut items: Vec<Item> = (document.model.parts.iter().enumerate())
        .filter(|&(index, _)| !document.is_hidden(index) || session.is_held(index))
        .map(|(index, part)| {
            let in_hand = session.is_held(index);
            let marked = session.is_selected(index) || look.is_over(index) || look.marked.contains(&index);
            let aside = focus.as_ref().is_some_and(|focus| !focus.contains(&index));
            let glass = aside || look.see_through && !in_hand && is_fixed(document, index);
            Item {
                shape: part.shape,
                pose: (session.joints.displacement(document, index))
                    .map_or(document.poses[index], |by| by * document.poses[index]),
                color: document.colors[index].map(|c| f32::from(c) / 255.0),
                opacity: if glass { SEEN_THROUGH } else { 1.0 },
                tint: tint(index, in_hand, look),
                line: match (in_hand, marked) {
                    (true, _) => held_line,
                    (_, true) => marked_line,
                    _ if glass => glass_line,
                    _ => EDGE,
                },
                lit: touching.map_or_else(Vec::new, |t| lit(document, t, index, in_hand)),
                lit_edges: touching.map_or_else(Vec::new, |t| lit_edges(document, t, index, in_hand)),
                mates: mates(session, document, index, fit),
            }
        })
        .collect();
    let commanded = session.ghost();
    let commanded = commanded.map_or_else(Vec::new, |(part, pose)| with_group(document, part, pose));
    items.extend(
        commanded
            .into_iter()
            .filter_map(|(part, pose)| ghost(document, part, pose)),
    );
    match fit {
        Some((part, offer)) => items.extend(fit_ghosts(document, part, offer)),
        None => {
            let next = session.next_places();
            items.extend(
                next.into_iter()
                    .filter_map(|(part, pose)| ghost(document, part, pose)),
            );
        }
    }
    let cut = look.cut.map(|shown| Cutaway {
        plane: shown.plane,
        areas: shown.cut.map(|cut| Areas(cut.clone())),
        fills: fills(session, document, shown, look),
    });
    Picture {
        camera: look.camera,
        extent: document.extent,
        ground: look.ground,
        items,
        cut,
        glow: glow(session, document, look.ground),
        arrows: touching.map_or_else(Vec::new, |t| arrows(document, t)),
        line_width: 1.25 * look.scale,
    }
}

/// From where the energy of the held or selected part draws it, the brighter the larger its force; where the fixed part is.
fn glow(session: &Session, document: &Document, ground: Ground) -> Option<Glow> {
    let made = session.drawing_energy()?;
    let [r, g, b] = ground.glow();
    let force = ParameterId::GeometricForce;
    let share = session.parameters[force as usize] / force.row().max;
    (share > 0.0).then_some(Glow {
        shells: Shells(made.basin.clone()),
        pose: *document.poses.get(made.of.against)?,
        color: [r, g, b, GLOW_OPACITY * share.min(1.0).sqrt()],
    })
}

/// Colour mixed into a part, and its weight.
fn tint(part: usize, in_hand: bool, look: &Look<'_>) -> [f32; 4] {
    if in_hand {
        TINT_HELD
    } else if look.marked.contains(&part) {
        TINT_MARKED
    } else if look.is_over(part) {
        TINT_OVER
    } else {
        [0.0; 4]
    }
}

/// The areas of a section, each in its part's colour and hatched in a direction of its own.
fn fills(session: &Session, document: &Document, shown: Shown<'_>, look: &Look<'_>) -> Vec<Fill> {
    let areas = shown.cut.map_or(&[][..], |cut| cut.areas.as_slice());
    (areas.iter().enumerate())
        .filter(|(_, area)| !document.is_hidden(area.part) || session.is_held(area.part))
        .filter_map(|(index, area)| {
            let color = document.colors.get(area.part)?;
            Some(Fill {
                area: index,
                color: color.map(|c| f32::from(c) / 255.0),
                tint: tint(area.part, session.is_held(area.part), look),
                line: EDGE,
                hatch: HATCHES[area.part % HATCHES.len()].to_radians(),
            })
        })
        .collect()
}

fn is_fixed(document: &Document, part: usize) -> bool {
    document.baked.is_some() && !document.is_grabbable(part)
}

/// Faces of a part that touch, deepest first.
fn lit(document: &Document, telemetry: &Telemetry, part: usize, in_hand: bool) -> Vec<u32> {
    let first = document.groups().first(part);
    let mut faces: Vec<u32> = Vec::new();
    for pair in &telemetry.pairs {
        let face = if in_hand {
            pair.moving_face
        } else if document.model_part(pair.static_part) == Some(first) {
            pair.static_face
        } else {
            continue;
        };
        let own = (face != NO_FACE).then(|| document.grouped.owner(first, face.into()));
        if let Some((owner, face)) = own.flatten()
            && owner == part
            && faces.len() < MAX_LIT
            && !faces.contains(&face)
        {
            faces.push(face);
        }
    }
    faces
}

/// Edges of a part that touch, deepest first.
fn lit_edges(document: &Document, telemetry: &Telemetry, part: usize, in_hand: bool) -> Vec<[u32; 2]> {
    let first = document.groups().first(part);
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for pair in &telemetry.pairs {
        let faces = if in_hand {
            [pair.moving_face, pair.moving_edge_face]
        } else if document.model_part(pair.static_part) == Some(first) {
            [pair.static_face, pair.static_edge_face]
        } else {
            continue;
        };
        if faces.contains(&NO_FACE) {
            continue;
        }
        let own = faces.map(|face| document.grouped.owner(first, face.into()));
        if let [Some((a, one)), Some((b, other))] = own
            && [a, b] == [part; 2]
        {
            let edge = meeting(&[one, other]);
            if edges.len() < MAX_LIT_EDGES && !edges.contains(&edge) {
                edges.push(edge);
            }
        }
    }
    edges
}

/// A part at a pose, and with it those of its group.
fn with_group(document: &Document, part: usize, pose: DAffine3) -> Vec<(usize, DAffine3)> {
    match document.groups().of(part) {
        Some(group) if group.first() == part => group.placed(pose).collect(),
        _ => vec![(part, pose)],
    }
}

/// The ghost of a part elsewhere; `None` where the part is there.
fn ghost(document: &Document, part: usize, pose: DAffine3) -> Option<Item> {
    let here = document.poses.get(part)?;
    if apart(&pose, here, document, part) <= GHOST_FROM * document.extent.radius {
        return None;
    }
    Some(Item {
        shape: document.model.parts[part].shape,
        pose,
        color: GHOST,
        opacity: 0.16,
        tint: [0.0; 4],
        line: [GHOST[0], GHOST[1], GHOST[2], 0.55],
        lit: Vec::new(),
        lit_edges: Vec::new(),
        mates: Vec::new(),
    })
}

/// The ghosts of a part and of its group in a fit, their mating faces marked; none where the part is there.
fn fit_ghosts(document: &Document, part: usize, offer: &Offer) -> Vec<Item> {
    let (Some(pose), Some(here)) = (offer.pose(document), document.poses.get(part)) else {
        return Vec::new();
    };
    if apart(&pose, here, document, part) <= GHOST_FROM * document.extent.radius {
        return Vec::new();
    }
    let ghost = |(own, pose): (usize, DAffine3)| Item {
        shape: document.model.parts[own].shape,
        pose,
        color: GHOST_FIT,
        opacity: 0.34,
        tint: [0.0; 4],
        line: [GHOST_FIT[0], GHOST_FIT[1], GHOST_FIT[2], 0.9],
        lit: Vec::new(),
        lit_edges: Vec::new(),
        mates: of_fit(document, offer, 0, own),
    };
    let parts = with_group(document, part, pose);
    parts.into_iter().map(ghost).collect()
}

/// Mating faces of a fit on one side, the moving part's or the other's, that `part` has.
fn of_fit(document: &Document, offer: &Offer, side: usize, part: usize) -> Vec<u32> {
    let faces = offer.fit.faces.iter().map(|pair| pair[side]);
    let mut faces = own_faces(document, part, faces);
    faces.sort_unstable();
    faces.dedup();
    faces.truncate(MAX_LIT);
    faces
}

/// Of faces of the part that stands for this one, those that this one has, with their numbers there.
fn own_faces(document: &Document, part: usize, faces: impl Iterator<Item = u32>) -> Vec<u32> {
    let first = document.groups().first(part);
    let own = faces.filter_map(|face| document.grouped.owner(first, face));
    own.filter(|(owner, _)| *owner == part)
        .map(|(_, face)| face)
        .collect()
}

/// Faces of a part that fit another part's: those of the joint that is marked, of the fit that is shown, and those that are held there, guided or by contact.
fn mates(session: &Session, document: &Document, part: usize, fit: Option<(usize, &Offer)>) -> Vec<u32> {
    let held = session.grabbed();
    let first = document.groups().first(part);
    let list = (held.is_some() && session.guidance.held == held).then_some(&session.guidance);
    let mut faces = match fit {
        Some((_, offer)) if offer.against == first => of_fit(document, offer, 1, part),
        _ => Vec::new(),
    };
    faces.extend(session.joints.marked_faces(document, part));
    for row in list.into_iter().flat_map(|list| &list.rows) {
        let target = &row.target;
        let own = match &row.standing {
            Standing::Sent | Standing::ByContact if first == target.id.moving_part => &target.moving_faces,
            Standing::Sent | Standing::ByContact if first == target.id.fixed_part => &target.fixed_faces,
            _ => continue,
        };
        let own = own_faces(document, part, own.iter().copied());
        let others: Vec<u32> = own.into_iter().filter(|face| !faces.contains(face)).collect();
        faces.extend(others);
    }
    faces.truncate(MAX_LIT);
    faces
}

/// Point of action of each pair's force, mm: the mean of the touching points, weighted by depth.
pub fn touching_points(telemetry: &Telemetry) -> Vec<DVec3> {
    telemetry
        .pairs
        .iter()
        .map(|pair| point_from_wire(pair.point))
        .collect()
}

fn arrows(document: &Document, telemetry: &Telemetry) -> Vec<Arrow> {
    let mut total = (DVec3::ZERO, 0.0);
    for pair in &telemetry.pairs {
        let weight = f64::from(pair.depth).max(1e-9) * f64::from(pair.count.max(1));
        total = (total.0 + weight * point_from_wire(pair.point), total.1 + weight);
    }
    let force = DVec3::from(telemetry.contact.force.map(f64::from));
    // Below the threshold of perception, a few hundredths of a newton, no arrow is drawn.
    if total.1 <= 0.0 || !force.is_finite() || force.length() < 0.03 {
        return Vec::new();
    }
    let radius = document.extent.radius;
    let length = LONGEST_RADII * radius * (1.0 - (-force.length() / ARROW_FORCE).exp());
    vec![Arrow {
        tail: total.0 / total.1,
        vector: length * force.normalize(),
        thickness: 0.018 * radius,
        color: [1.0, 0.44, 0.28, 0.95],
    }]
}

/// Largest distance between the points of a part's bounding sphere at two poses, mm.
fn apart(a: &DAffine3, b: &DAffine3, document: &Document, part: usize) -> f64 {
    let shape = document.model.parts[part].shape;
    let Extent { center, radius } = document.extents.get(shape).copied().unwrap_or_default();
    let centers = (a.transform_point3(center) - b.transform_point3(center)).length();
    let turned: f64 = (0..3)
        .map(|i| (a.matrix3.col(i) - b.matrix3.col(i)).length_squared())
        .sum::<f64>()
        .sqrt();
    centers + radius * turned
}
