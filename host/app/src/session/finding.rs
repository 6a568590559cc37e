//! Finding fits on request, beside the window's thread, and placing a part in the one that the operator accepts.

use std::sync::Arc;

use super::document::Document;
use super::fitting::{FitsFound, Fitting, is_closed, nearest};
use super::notes::Severity;
use super::outbox::Update;
use super::state::Session;
use super::threads::{Cancel, spawn};

/// Why no fit can be shown.
pub(super) const NO_FIT: &str = "No fit is shown: find fits first";

impl Session {
    /// The part whose fits are found: the held one, or the selected one; of a group its first part.
    pub fn fit_subject(&self) -> Option<usize> {
        let part = self.grabbed().or(self.selected)?;
        let document = self.document.as_ref()?;
        (part < document.poses.len()).then(|| document.groups().first(part))
    }

    /// Searches the fits with the chosen part, or with the nearest ones.
    pub(super) fn find_fits(&mut self) {
        self.drop_fits();
        let (Some(moving), Some(document)) = (self.fit_subject(), &self.document) else {
            return;
        };
        let partners = self
            .partner
            .map_or_else(|| nearest(document, moving), |part| vec![part]);
        self.fit_searches += 1;
        let (id, model) = (self.fit_searches, Arc::clone(&document.grouped.model));
        let (outbox, cancel) = (self.outbox.clone(), Cancel::default());
        self.fitting = Some(Fitting::new(id, moving, partners.len(), cancel.clone()));
        spawn("mortise-fits", move || {
            for (number, &against) in partners.iter().enumerate() {
                if cancel.is_set() {
                    return;
                }
                let found = mortise_fit::find(&model, moving, against, &mortise_fit::FitOptions::default());
                let found = FitsFound {
                    id,
                    against,
                    result: found.map(|found| found.fits).map_err(|error| error.to_string()),
                    left: partners.len() - number - 1,
                };
                if !outbox.send(Update::Fits(found)) {
                    return;
                }
            }
        });
    }

    /// Shows another of the fits that were found.
    pub(super) fn show_fit(&mut self, choose: impl FnOnce(&mut Fitting, &Document)) {
        if let (Some(fitting), Some(document)) = (&mut self.fitting, &self.document) {
            choose(fitting, document);
        }
    }

    /// Takes in what a search found; what is no longer wanted is dropped.
    pub(super) fn fits_found(&mut self, found: FitsFound) {
        let wanted = |fitting: &&mut Fitting| fitting.id == found.id && fitting.search.is_some();
        let Some(fitting) = self.fitting.as_mut().filter(wanted) else {
            return;
        };
        match found.result {
            Ok(fits) => {
                fitting.add(found.against, fits);
                if let Some(document) = &self.document {
                    fitting.show_as_it_lies(document);
                }
            }
            Err(why) => fitting.failures.push(why),
        }
        if let Some(search) = &mut fitting.search {
            search.left = found.left;
        }
        if found.left == 0 {
            fitting.search = None;
        }
    }

    /// Ends a search; what it has found stays.
    pub(super) fn cancel_fits(&mut self) {
        let Some(fitting) = &mut self.fitting else { return };
        if let Some(search) = fitting.search.take() {
            search.cancel.set();
        }
        if fitting.offers.is_empty() {
            self.fitting = None;
        }
    }

    /// Shows no fits any more.
    pub(super) fn drop_fits(&mut self) {
        self.cancel_fits();
        self.fitting = None;
    }

    /// Why no fits can be searched now, as a sentence.
    pub(super) fn no_search(&self) -> Option<String> {
        let no = |reason: &str| Some(reason.to_owned());
        let Some(document) = &self.document else {
            return no("No file is open");
        };
        let Some(part) = self.fit_subject() else {
            return no("Select a part first");
        };
        if !is_closed(&document.grouped.model, part) {
            let name = document.moving_name(part);
            return Some(format!("{name} has no closed surface: choose another part"));
        }
        match self.partner {
            Some(other) if other == part => {
                no("A part does not fit itself: choose another one to fit it with")
            }
            None if nearest(document, part).is_empty() => no("No other part has a closed surface"),
            _ => None,
        }
    }

    /// Why the part cannot be put into the fit that is shown, as a sentence.
    pub(super) fn no_placing(&self) -> Option<String> {
        let is_shown = self.fitting.as_ref().and_then(Fitting::offer).is_some();
        let reason = if is_shown { self.no_move() } else { Some(NO_FIT) };
        reason.map(str::to_owned)
    }

    /// Puts the part into the fit that is shown.
    pub(super) fn place_fit(&mut self) {
        let (Some(fitting), Some(document)) = (&self.fitting, &self.document) else {
            return;
        };
        let Some(offer) = fitting.offer() else { return };
        let moving = fitting.moving;
        let Some(pose) = offer.pose(document) else { return };
        let poses = document.poses_with(moving, pose);
        let (part, other) = (document.moving_name(moving), document.moving_name(offer.against));
        let text = format!("Placed {part} in its fit with {other}; Ctrl+Z undoes it");
        let name = format!("place {part} in its fit with {other}");
        self.place(poses);
        self.note_step(&name);
        self.notes.add(Severity::Good, text);
        self.drop_fits();
    }
}
