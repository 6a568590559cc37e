//! Geometric energies where the operator guides by them: made beside the window's thread for the fit that is shown of the held or selected part, and brought into the scene.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DAffine3;
use mortise_bake::{Cache as _, SLOT_BYTES};
use mortise_brep::CadModel;
use mortise_energy::{BakedEnergy, of_fit};
use mortise_fit::Fit;
use mortise_protocol::parameter::ParameterId;

use super::energies::{EnergyIntent, EnergyMade, Made, Making, Pairing, Unmade};
use super::fitting::Offer;
use super::kept_energy::{from_bytes, name, to_bytes};
use super::notes::Severity;
use super::outbox::Update;
use super::state::Session;
use super::threads::{Cancel, spawn};
use super::travel::pose_at;
use crate::display::basin::basin;
use crate::folder_cache::FolderCache;

/// Value of the parameter `Guidance` with which energies guide.
const BY_ENERGY: f32 = 3.0;
/// Time for which a fit is shown before its energy is begun: meanwhile the operator may go on to the next one.
const SETTLED: Duration = Duration::from_millis(400);
/// Stretch of the way over which the basin is drawn: from so far beyond the fit to so far before the way begins, in steps of so much, mm, and no more of them than this.
const BEYOND_FIT_MM: f64 = 4.0;
const BEFORE_WAY_MM: f64 = 10.0;
const STATION_MM: f64 = 1.0;
const MOST_STATIONS: f64 = 80.0;

impl Session {
    /// Whether the board guides by the energies of its scene.
    pub fn guides_by_energy(&self) -> bool {
        self.parameters[ParameterId::Guidance as usize] >= BY_ENERGY - 0.5
    }

    /// Makes and attaches what is wanted now. Call it after every change.
    pub(super) fn follow_energies(&mut self) {
        let Some(document) = self.document.as_ref().filter(|_| self.guides_by_energy()) else {
            return;
        };
        if document.baked.is_some() {
            self.energies.of_model(&document.grouped.model);
            self.seek_fits_to_be_drawn_to();
            self.begin_energy();
            self.attach_energies();
        }
    }

    /// The part that an energy could draw: the held or selected one, where it can be held.
    fn drawn_part(&self) -> Option<usize> {
        let document = self.document.as_ref()?;
        self.fit_subject().filter(|part| document.is_grabbable(*part))
    }

    /// Searches the fits of the part, once.
    fn seek_fits_to_be_drawn_to(&mut self) {
        let Some(part) = self.drawn_part() else { return };
        let shown = self.fitting.as_ref().filter(|fitting| fitting.moving == part);
        let known = shown.is_some() || self.energies.chosen(part).is_some();
        if known || self.energies.sought.contains(&part) || self.no_search().is_some() {
            return;
        }
        if let Some(cut_short) = self.fitting.as_ref().filter(|fitting| fitting.search.is_some()) {
            self.energies.sought.remove(&cut_short.moving);
        }
        self.energies.sought.insert(part);
        self.find_fits();
    }

    /// The fit whose energy is to draw the part: the one that is shown, once all are found, if a way in is known.
    pub(super) fn drawing_fit(&self) -> Option<(Pairing, &Offer)> {
        let part = self.drawn_part()?;
        let fitting = self.fitting.as_ref()?;
        let offer = fitting.offer().filter(|offer| offer.fit.path.is_some())?;
        (fitting.moving == part && fitting.search.is_none()).then(|| (Pairing::of(part, offer), offer))
    }

    /// Begins the energy of the fit that is shown, unless it is made, being made, or not to be made.
    fn begin_energy(&mut self) {
        let (Some((of, offer)), Some(document)) = (self.drawing_fit(), &self.document) else {
            return;
        };
        if self.energies.unmade(&of).is_some() {
            return;
        }
        let fit = offer.fit.clone();
        let model = Arc::clone(&document.grouped.model);
        let kept = name(document, of.moving, of.against, &fit).zip(self.cache.clone());
        let middle = document.own_extent(of.moving).center;
        if self.energies.choose(&of) {
            return;
        }
        if let Some(making) = &self.energies.making {
            if making.of != of {
                making.cancel.set();
            }
            return;
        }
        let cancel = Cancel::default();
        self.energies.making = Some(Making {
            of,
            since: Instant::now(),
            cancel: cancel.clone(),
        });
        let outbox = self.outbox.clone();
        spawn("mortise-energy", move || {
            std::thread::sleep(SETTLED);
            let energy = match cancel.is_set() {
                true => None,
                false => energy(&model, &of, &fit, kept),
            };
            let made = energy.map(|energy| Made {
                of,
                basin: Arc::new(basin(&energy, &stations(&model, &of, &fit), middle)),
                energy,
            });
            outbox.send(Update::Energy(Box::new(EnergyMade {
                cancel,
                model,
                of,
                made,
            })));
        });
    }

    /// Brings the energy of the part into the scene, which then gets to the board like any other. Only while nothing moves and nothing is uploaded.
    fn attach_energies(&mut self) {
        let Some(part) = self.drawn_part() else { return };
        let (Some(document), Some(made)) = (&self.document, self.energies.chosen(part)) else {
            return;
        };
        let Some(scene) = document.baked.clone() else {
            return;
        };
        let has_it = self
            .energies
            .of_scene(Some(&scene))
            .iter()
            .any(|there| Arc::ptr_eq(there, made));
        if has_it
            || self.energies.no_room(part, &scene).is_some()
            || self.no_move().is_some()
            || self.is_touring()
        {
            return;
        }
        let capacity = self
            .connection()
            .map(|c| u64::from(c.capabilities.scene_capacity));
        let room = usize::try_from(capacity.unwrap_or(SLOT_BYTES)).unwrap_or(usize::MAX);
        let Some(document) = &mut self.document else {
            return;
        };
        let attached = self
            .energies
            .attached(part, &scene, room, |part| document.scene_part(part));
        match attached {
            Ok(whole) => {
                document.baked = Some(whole);
                // Where a hand has left the parts they stay.
                document.place(document.poses.clone());
                if let Some(connection) = self.connection_mut() {
                    connection.scene_of = None;
                    connection.refused_scene_of = None;
                }
            }
            Err(why) => self.notes.add(Severity::Warning, why),
        }
    }

    /// Takes the end of making an energy in.
    pub(super) fn energy_made(&mut self, end: EnergyMade) {
        let of = end.of;
        if self.energies.take_in(end)
            && let Some(document) = &self.document
        {
            let [part, other] = [of.moving, of.against].map(|part| document.moving_name(part));
            let text = format!("Energy made: it draws {part} into its fit with {other}");
            self.notes.add(Severity::Good, text);
        }
    }

    pub(super) fn perform_on_energies(&mut self, intent: EnergyIntent) {
        let of = self.drawing_fit().map(|(of, _)| of);
        match intent {
            EnergyIntent::Make => self.energies.decline(None),
            EnergyIntent::Cancel => self.energies.decline(of),
        }
    }

    /// Why an action on energies is not possible now, as a sentence.
    pub(super) fn no_energy_action(&self, intent: EnergyIntent) -> Option<String> {
        let declined = (self.drawing_fit()).and_then(|(of, _)| self.energies.unmade(&of));
        let reason = match intent {
            EnergyIntent::Cancel if self.energy_under_way().is_none() => "No energy is being made",
            EnergyIntent::Make if declined != Some(Unmade::Cancelled) => {
                "Show a fit whose energy was cancelled"
            }
            EnergyIntent::Cancel | EnergyIntent::Make => return None,
        };
        Some(reason.to_owned())
    }

    /// The energy that is being made for the fit that is shown.
    pub fn energy_under_way(&self) -> Option<&Making> {
        let (of, _) = self.drawing_fit().filter(|_| self.guides_by_energy())?;
        let making = self.energies.making.as_ref();
        making.filter(|making| making.of == of && self.energies.unmade(&of).is_none())
    }

    /// The energies that the scene has.
    pub fn scene_energies(&self) -> &[Arc<Made>] {
        self.energies.of_scene(
            self.document
                .as_ref()
                .and_then(|document| document.baked.as_ref()),
        )
    }

    /// The energy that draws the held or selected part: the one in the scene, or one that is to come there.
    pub fn drawing_energy(&self) -> Option<&Arc<Made>> {
        let part = self.drawn_part().filter(|_| self.guides_by_energy())?;
        let in_scene = self.scene_energies().iter().find(|made| made.of.moving == part);
        in_scene.or_else(|| self.energies.chosen(part))
    }
}

/// The energy of a part in a fit, which is taken from the cache or kept there.
fn energy(
    model: &CadModel,
    of: &Pairing,
    fit: &Fit,
    kept: Option<(String, Arc<FolderCache>)>,
) -> Option<BakedEnergy> {
    let Some((name, cache)) = kept else {
        return of_fit(model, of.moving, of.against, fit);
    };
    let known = cache.get(&name).and_then(|bytes| from_bytes(&bytes));
    known.or_else(|| {
        let energy = of_fit(model, of.moving, of.against, fit)?;
        cache.put(&name, &to_bytes(&energy));
        Some(energy)
    })
}

/// Poses of the part in the other part's frame along its way, from beyond the fit to before the way begins, mm.
fn stations(model: &CadModel, of: &Pairing, fit: &Fit) -> Vec<DAffine3> {
    let (Some(path), Some(other)) = (&fit.path, model.parts.get(of.against)) else {
        return Vec::new();
    };
    let back = other.placement.inverse();
    let length = BEYOND_FIT_MM + path.length_mm + BEFORE_WAY_MM;
    let count = (length / STATION_MM).ceil().clamp(2.0, MOST_STATIONS);
    (0..=count as usize)
        .map(|k| back * pose_at(path, &fit.placement, length * k as f64 / count - BEYOND_FIT_MM))
        .collect()
}
