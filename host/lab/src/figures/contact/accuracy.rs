//! Error of distances against the closed form, and the time of a query on this computer.

use glam::{DQuat, DVec3};
use mortise_bake::Grabbable;
use mortise_scenario::probe::{NamedPose, ProbeRow, ProbeScene};

use super::limits::{CELL_MM, TIGHT_MM};
use crate::LabError;
use crate::figures::Row;
use crate::fit::Fit;
use crate::peer;
use crate::scene_p::{self, By};
use crate::variant::Variant;

/// Largest deviation of the peer's meshes from the surfaces, mm: the permitted error of Mortise's gaps.
const PEER_DEFLECTION_MM: f64 = 0.005;

/// Gap, penetration and time on scene P.
pub(super) fn scene_p(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let asked = scene_p::ask(&Variant::field(CELL_MM))?;
    let what = |what: &str| format!("scene P, {} poses, {CELL_MM} mm cells: {what}", asked.rows.len());
    for (by, of) in [
        (By::Probe, "as probed"),
        (
            By::Field,
            "by the field, which a tick acts on, 0.1 mm apart or nearer",
        ),
    ] {
        for (gaps, name, bound) in [(true, "gap", 5.0), (false, "penetration", 10.0)] {
            let (error, at) = asked.worst(by, gaps);
            let what = what(&format!("largest {name} error {of} (at {at})"));
            out(Row::at_most(what, 1e3 * error, "µm", bound));
        }
    }
    let (rounded, at) = asked.worst(By::FieldWithin { mm: 1.0 }, true);
    let what_rounded = what(&format!(
        "largest gap error by the field, 1 mm apart or nearer (at {at})"
    ));
    out(Row::reported(what_rounded, 1e3 * rounded, "µm"));
    out(Row::reported(what("image"), asked.image_bytes as f64, "bytes"));
    let ns = asked.median_ns();
    out(Row::at_most(what("median query on this computer"), ns, "ns", 15_000.0).varies());
    let peer = peer::ask(PEER_DEFLECTION_MM)?;
    let of = format!("parry3d, {} triangles", peer.triangles);
    let reported = Row::reported(
        what(&format!("{of}: median query over ours")),
        peer.median_ns / ns,
        "",
    );
    out(reported.varies());
    let reported = Row::reported(
        what(&format!("{of}: median gap query over our median")),
        peer.gap_ns / ns,
        "",
    );
    out(reported.varies());
    let reported = Row::reported(
        what(&format!("{of}: median depth query over our median")),
        peer.depth_ns / ns,
        "",
    );
    out(reported.varies());
    out(Row::reported(
        what(&format!("{of}: largest gap error")),
        1e3 * peer.gap_error_mm,
        "µm",
    ));
    out(Row::reported(
        what(&format!("{of}: largest penetration error")),
        1e3 * peer.depth_error_mm,
        "µm",
    ));
    Ok(())
}

/// A peg in the middle of its hole has no contact.
pub(super) fn centred(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let fit = Fit::thesis(TIGHT_MM);
    let pose = NamedPose {
        name: "centred".into(),
        // The peg's frame is at its upper end and points downwards.
        position_mm: DVec3::new(0.0, 0.0, 0.5 * (fit.height_mm + fit.length_mm)),
        orientation: DQuat::from_rotation_x(std::f64::consts::PI),
    };
    let ask = |variant: &Variant| -> Result<ProbeRow, LabError> {
        let scene = ProbeScene::bake(fit.file()?.path(), &variant.options(Grabbable::All))?;
        Ok(scene.probe(scene.pair("peg", Some("block"))?, &pose)?)
    };
    let what = |variant: &Variant, what: &str| {
        format!(
            "centred peg, {} µm diametral clearance, {variant}: {what}",
            1e3 * TIGHT_MM
        )
    };
    let (field, textbook) = (Variant::field(CELL_MM), Variant::textbook(CELL_MM));
    let row = ask(&field)?;
    out(Row::exactly(
        what(&field, "contacts reported"),
        f64::from(row.contacts),
        "contacts",
        0.0,
    ));
    // Half the clearance, within the permitted error of gaps: it is in the hole.
    let gap = 500.0 * TIGHT_MM;
    out(Row::within(
        what(&field, "gap"),
        1e3 * row.distance_mm,
        "µm",
        gap - 5.0,
        gap + 5.0,
    ));
    out(Row::within(
        what(&textbook, "contacts reported"),
        f64::from(ask(&textbook)?.contacts),
        "contacts",
        1.0,
        f64::INFINITY,
    ));
    Ok(())
}
