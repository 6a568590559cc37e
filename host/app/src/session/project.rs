//! The project of the open document: taken from the session, and given back to it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use glam::DAffine3;
use mortise_guide::When;
use mortise_mating::recognise::TargetId;
use mortise_protocol::parameter::PARAMETERS;

use super::document::Document;
use super::fits::FitChoice;
use super::kept_groups::{joined, kept};
use super::link::Link;
use super::notes::Severity;
use super::state::{GUIDE_CAP_N, Looks, OwnParameters, Session};
use crate::kept::project::{KeptFit, KeptPart, ModelFile, Placement, Project, Settings, VERSION, absolute};

/// Most names that a message lists.
const LISTED: usize = 5;

/// Where a project comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// Saved by itself at an earlier start.
    Autosave,
    /// A file of the user.
    File(PathBuf),
}

/// The project of a session with an open document.
pub fn capture(session: &Session, document: &Document) -> Project {
    let moved = |part: usize| document.poses[part] != document.model.parts[part].placement;
    let parts = (document.names.iter().enumerate())
        .filter(|&(part, _)| moved(part) || document.hidden[part])
        .map(|(part, name)| KeptPart {
            part: name.clone(),
            placement: (moved(part))
                .then(|| Placement::of(&document.poses[part]))
                .flatten(),
            hidden: document.hidden[part],
        });
    let fits = session
        .fits
        .iter()
        .filter(|(_, choice)| choice.pinned || choice.off);
    let fits = fits.filter_map(|(id, choice)| {
        // A fit of whole shapes is found again.
        let [moving_surface, fixed_surface] = id.surfaces?;
        Some(KeptFit {
            moving: document.names.get(id.moving_part)?.clone(),
            moving_surface,
            fixed: document.names.get(id.fixed_part)?.clone(),
            fixed_surface,
            pinned: choice.pinned,
            off: choice.off,
        })
    });
    Project {
        version: VERSION,
        model: ModelFile {
            path: document.path.as_deref().map(absolute),
            sha256: document.sha256.clone(),
        },
        parts: parts.collect(),
        groups: kept(document),
        locked: document.grouped.locked.as_ref().map(|locked| {
            let names = locked.iter().filter_map(|&part| document.names.get(part));
            names.cloned().collect()
        }),
        fits: fits.collect(),
        settings: settings(session),
        rig: Some(session.chosen.to_string()),
        signals: session.preferences.signals.clone(),
        view: session.view.clone(),
    }
}

fn settings(session: &Session) -> Settings {
    let changed = |own: &OwnParameters| -> BTreeMap<String, f32> {
        let changed = PARAMETERS.iter().filter_map(|row| {
            let value = *own.get(&(row.id as usize))?;
            (value != row.default && value.is_finite()).then(|| (row.name.to_owned(), value))
        });
        changed.collect()
    };
    let rigs = session.own_parameters.iter();
    let parameters = rigs.map(|(rig, own)| (rig.clone(), changed(own)));
    let (guide, usual) = (&session.guide, mortise_guide::GuideSettings::default());
    Settings {
        parameters: parameters.filter(|(_, changed)| !changed.is_empty()).collect(),
        engage: (guide.when != usual.when).then(|| name(guide.when).to_owned()),
        guide_cap_n: (guide.force_cap_n != usual.force_cap_n).then_some(guide.force_cap_n),
        method: (session.method != mortise_bake::Method::default()).then_some(session.method),
    }
}

/// Name in files of a condition for guidance.
fn name(when: When) -> &'static str {
    match when {
        When::Touching => "touching",
        When::Near => "near",
    }
}

/// Applies a project to the open document, and says what was restored and what was not. Nothing is restored that refers to a part that the model does not
/// have, and no choice of a fit in another version of the model.
pub fn apply(session: &mut Session, project: &Project, source: &Source) {
    let Some(document) = &session.document else { return };
    let same = project.model.sha256 == document.sha256;
    let numbers: BTreeMap<_, usize> = document.names.iter().zip(0..).collect();
    let mut poses: Vec<DAffine3> = document.model.parts.iter().map(|part| part.placement).collect();
    let mut hidden = vec![false; poses.len()];
    let (mut moved, mut missing) = (0, Vec::new());
    for kept in &project.parts {
        let Some(&part) = numbers.get(&kept.part) else {
            missing.push(kept.part.name.as_str());
            continue;
        };
        hidden[part] = kept.hidden;
        if let Some(pose) = kept.placement.and_then(|placement| placement.pose()) {
            poses[part] = pose;
            moved += 1;
        }
    }
    let fits = project.fits.iter().filter(|_| same).filter_map(|fit| {
        let id = TargetId {
            moving_part: *numbers.get(&fit.moving)?,
            fixed_part: *numbers.get(&fit.fixed)?,
            surfaces: Some([fit.moving_surface, fit.fixed_surface]),
        };
        let choice = FitChoice {
            pinned: fit.pinned,
            off: fit.off,
        };
        Some((id, choice))
    });
    let mut fits: BTreeMap<TargetId, FitChoice> = fits.collect();
    let (groups, left_out) = joined(document, &project.groups, &poses);
    // The surfaces of a group that is not there.
    let is_left_out = |part: usize| left_out.iter().any(|group| group.parts.contains(&part));
    fits.retain(|id, _| !is_left_out(id.moving_part) && !is_left_out(id.fixed_part));
    let locked = project.locked.as_ref().map(|locked| {
        let parts = locked.iter().filter_map(|name| numbers.get(name).copied());
        parts.collect::<BTreeSet<usize>>()
    });
    // With nothing free there would be nothing to grab.
    let locked = locked.filter(|locked| locked.len() < poses.len());
    let counts = [
        (moved, "part moved", "parts moved"),
        (groups.iter().count(), "group", "groups"),
        (
            locked.as_ref().map_or(0, BTreeSet::len),
            "part locked to the ground",
            "parts locked to the ground",
        ),
        (
            hidden.iter().filter(|hidden| **hidden).count(),
            "part hidden",
            "parts hidden",
        ),
        (fits.len(), "choice of a fit", "choices of fits"),
        (project.settings.count(), "setting", "settings"),
    ];
    if let Some(document) = &mut session.document {
        document.hidden = hidden;
    }
    session.place(poses);
    session.regroup(groups);
    if let Some(document) = &mut session.document {
        document.grouped = Arc::new(document.grouped.with_locked(locked));
    }
    session.fits = fits;
    session.view.clone_from(&project.view);
    session.looks = Some(Looks {
        signals: project.signals.clone(),
        view: project.view.clone(),
    });
    apply_settings(session, project);
    let restored = counts.into_iter().filter(|(count, ..)| *count > 0);
    let restored: Vec<String> = restored
        .map(|(count, one, many)| format!("{count} {}", if count == 1 { one } else { many }))
        .collect();
    report(session, project, source, same, &restored, &missing);
    for group in left_out {
        session.notes.add(Severity::Warning, group.why);
    }
}

fn apply_settings(session: &mut Session, project: &Project) {
    let Settings {
        parameters,
        engage,
        guide_cap_n,
        method,
    } = &project.settings;
    // A connection that exists or is being made was chosen by the user since.
    let rig = project.rig.as_ref().and_then(|rig| rig.parse().ok());
    if let (Link::None, None, Some(rig)) = (&session.link, &session.tour, rig) {
        session.chosen = rig;
    }
    let known = |kept: &BTreeMap<String, f32>| -> OwnParameters {
        let known = PARAMETERS.iter().filter_map(|row| {
            let value = kept.get(row.name).copied().filter(|value| value.is_finite())?;
            Some((row.id as usize, value))
        });
        known.collect()
    };
    let kept = parameters.iter().map(|(rig, kept)| (rig.clone(), known(kept)));
    let before = std::mem::replace(&mut session.own_parameters, kept.collect());
    let of_this_rig = |rigs: &BTreeMap<String, OwnParameters>| {
        rigs.get(&session.rig_of_parameters())
            .cloned()
            .unwrap_or_default()
    };
    let (before, kept) = (of_this_rig(&before), of_this_rig(&session.own_parameters));
    for row in PARAMETERS {
        let value = kept.get(&(row.id as usize));
        if value.is_some() || before.contains_key(&(row.id as usize)) {
            session.set_parameter(row.id, value.copied().unwrap_or(row.default));
        }
    }
    let usual = mortise_guide::GuideSettings::default();
    let named = |when: &When| engage.as_deref() == Some(name(*when));
    session.guide.when = When::ALL.into_iter().find(named).unwrap_or(usual.when);
    let cap = guide_cap_n
        .filter(|newton| newton.is_finite())
        .unwrap_or(usual.force_cap_n);
    session.guide.force_cap_n = cap.clamp(*GUIDE_CAP_N.start(), *GUIDE_CAP_N.end());
    session.method = method.unwrap_or_default();
}

fn report(
    session: &mut Session,
    project: &Project,
    source: &Source,
    same: bool,
    restored: &[String],
    missing: &[&str],
) {
    let from = match source {
        Source::Autosave => "from the last time".to_owned(),
        Source::File(path) => format!("from {}", path.display()),
    };
    let what = match restored {
        [] => "nothing".to_owned(),
        some => some.join(", "),
    };
    let left_out = !same && !project.fits.is_empty();
    let silent = *source == Source::Autosave && restored.is_empty();
    if missing.is_empty() && !left_out && (same || silent) {
        if !silent {
            let text = format!("Restored {from}: {what}");
            session.notes.add(Severity::Good, text);
        }
        return;
    }
    let mut text = match same {
        true => format!("Restored {from}: {what}"),
        false => format!("The model has changed since the project was saved; restored {from}: {what}"),
    };
    if !missing.is_empty() {
        let listed: Vec<&str> = missing.iter().take(LISTED).copied().collect();
        text += &format!("; parts that no longer exist: {}", listed.join(", "));
        if missing.len() > LISTED {
            text += &format!(" and {} more", missing.len() - LISTED);
        }
    }
    if left_out {
        text += "; choices of fits are left out, because surfaces may be others";
    }
    session.notes.add(Severity::Warning, text);
}
