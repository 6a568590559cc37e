//! Ways in of the held part: found beside the window's thread when the part is grabbed, and followed by guidance.

use std::sync::Arc;

use mortise_fit::{FitOptions, find};
use mortise_guide::along;
use mortise_mating::recognise::Target;

use super::document::Document;
use super::finding::NO_FIT;
use super::fitting::is_closed;
use super::outbox::Update;
use super::state::Session;
use super::tap::GuidanceCommand;
use super::threads::spawn;
use super::ways::WaysFound;

/// Parts of the assembly whose ways are searched for a held part, the nearest ones.
const MOST_PARTNERS: usize = 12;

impl Session {
    /// Searches the ways of the held part in the assembly, once.
    pub(super) fn seek_ways(&mut self) {
        let (Some(moving), Some(document)) = (self.grabbed(), &self.document) else {
            return;
        };
        if self.ways.of_assembly.contains_key(&moving) {
            return;
        }
        self.ways.of_assembly.insert(moving, Vec::new());
        let partners = partners(document, moving);
        let model = Arc::clone(&document.grouped.model);
        let (outbox, cancel) = (self.outbox.clone(), self.ways.cancel.clone());
        let options = FitOptions {
            only_placed: true,
            most: 8,
            most_paths: 8,
            ..FitOptions::default()
        };
        spawn("mortise-ways", move || {
            let mut targets = Vec::new();
            for against in partners {
                if cancel.is_set() {
                    return;
                }
                // A pair that cannot be searched has no way.
                let found = find(&model, moving, against, &options).unwrap_or_default();
                targets.extend((found.fits.iter()).filter_map(|fit| along(&model, moving, against, fit)));
            }
            outbox.send(Update::Ways(WaysFound {
                model,
                moving,
                targets,
            }));
        });
    }

    /// Takes in what a search found.
    pub(super) fn ways_found(&mut self, found: WaysFound) {
        let is_current = (self.document.as_ref())
            .is_some_and(|document| Arc::ptr_eq(&document.grouped.model, &found.model));
        if is_current && !found.targets.is_empty() {
            self.ways.of_assembly.insert(found.moving, found.targets);
            self.command_guidance(GuidanceCommand::Follow(self.ways.followed()));
        }
    }

    /// The way of the fit that is shown, if one is known.
    fn shown_way(&self) -> Option<Target> {
        let (fitting, document) = (self.fitting.as_ref()?, self.document.as_ref()?);
        let offer = fitting.offer()?;
        along(&document.grouped.model, fitting.moving, offer.against, &offer.fit)
    }

    /// Whether guidance follows the fit that is shown by the operator's choice.
    pub fn follows_shown_fit(&self) -> bool {
        self.ways.chosen.is_some() && self.ways.chosen == self.shown_way()
    }

    /// Follows the fit that is shown, or no longer.
    pub(super) fn follow_fit(&mut self) {
        self.ways.chosen = match self.follows_shown_fit() {
            true => None,
            false => self.shown_way(),
        };
        self.command_guidance(GuidanceCommand::Follow(self.ways.followed()));
    }

    /// Why the fit that is shown cannot be followed, as a sentence.
    pub(super) fn no_following(&self) -> Option<String> {
        let shown = self.fitting.as_ref().and_then(|fitting| fitting.offer());
        let reason = match shown {
            None => NO_FIT,
            Some(_) if self.shown_way().is_none() => "No way in to this fit is known",
            Some(_) => return None,
        };
        Some(reason.to_owned())
    }
}

/// Parts with a closed surface in whose bounding spheres a part reaches where the file has both, the deepest first.
fn partners(document: &Document, moving: usize) -> Vec<usize> {
    let model = &document.grouped.model;
    let parts = &model.parts;
    let sphere = |part: usize| {
        let own = document.own_extent(part);
        (parts[part].placement.transform_point3(own.center), own.radius)
    };
    if !is_closed(model, moving) {
        return Vec::new();
    }
    let (middle, radius) = sphere(moving);
    let mut others: Vec<(f64, usize)> = (0..parts.len())
        .filter(|&part| part != moving && is_closed(model, part))
        .map(|part| {
            let (center, other) = sphere(part);
            (center.distance(middle) - radius - other, part)
        })
        .filter(|(gap, _)| *gap < 0.0)
        .collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0));
    others.truncate(MOST_PARTNERS);
    others.into_iter().map(|(_, part)| part).collect()
}
