//! Geometric energies of the open model: made of fits, the one of each part that is drawn by it, and those that the scene has. Pure.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

use glam::DAffine3;
use mortise_bake::Baked;
use mortise_brep::CadModel;
use mortise_energy::{BakedEnergy, Placed, attach, bytes};

use super::fitting::Offer;
use super::threads::Cancel;
use crate::display::mesh::ShapeMesh;

/// Energies that are kept while a model is open, the newest ones: about 32 KiB each, and as much for the basin.
const MOST: usize = 64;

/// An action on energies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnergyIntent {
    /// Make the energy of the fit that is shown.
    Make,
    /// Do without the one that is being made.
    Cancel,
}

/// What an energy is of: a part in a fit with another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pairing {
    /// The part that is drawn.
    pub moving: usize,
    /// The part that it fits.
    pub against: usize,
    /// Placement in the fit, with the other part where the file has it.
    placement: DAffine3,
}

impl Pairing {
    /// Of a part in a fit that is offered.
    pub fn of(moving: usize, offer: &Offer) -> Self {
        Self {
            moving,
            against: offer.against,
            placement: offer.fit.placement,
        }
    }
}

/// An energy that was made.
pub struct Made {
    /// Of what.
    pub of: Pairing,
    /// The energy.
    pub energy: BakedEnergy,
    /// From where it draws the middle of the part, in the other part's frame, mm.
    pub basin: Arc<ShapeMesh>,
}

impl Made {
    /// Bytes that it adds to a scene.
    pub fn bytes(&self) -> usize {
        bytes(&[self.placed([0, 1])])
    }

    /// For an image in which the parts have these numbers.
    fn placed(&self, [moving, fixed]: [u16; 2]) -> Placed {
        Placed {
            moving,
            fixed,
            energy: self.energy.clone(),
        }
    }
}

/// An energy that is being made.
pub struct Making {
    /// Of what.
    pub of: Pairing,
    /// Its beginning.
    pub since: Instant,
    pub(super) cancel: Cancel,
}

/// The end of making an energy.
pub struct EnergyMade {
    /// The flag that ends it.
    pub(super) cancel: Cancel,
    /// The model in which it was made.
    pub model: Arc<CadModel>,
    /// Of what.
    pub of: Pairing,
    /// The energy; `None` where there is none, or it was cancelled before it was begun.
    pub made: Option<Made>,
}

/// Why there is no energy of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unmade {
    /// By the operator's choice.
    Cancelled,
    /// The two parts have none for each other.
    Impossible,
}

/// A scene with energies.
struct Scene {
    bare: Arc<Baked>,
    whole: Arc<Baked>,
    energies: Vec<Arc<Made>>,
}

/// The energies of the open model.
#[derive(Default)]
pub struct Energies {
    model: Option<Arc<CadModel>>,
    made: Vec<Arc<Made>>,
    /// The one that draws each part.
    chosen: BTreeMap<usize, Arc<Made>>,
    scene: Option<Scene>,
    /// At most one is made at a time; it goes on after it was cancelled, for it cannot be interrupted.
    pub(super) making: Option<Making>,
    unmade: Option<(Pairing, Unmade)>,
    /// Parts whose fits were searched for their energy.
    pub(super) sought: BTreeSet<usize>,
    /// An energy that a scene has no room for, and the scene.
    no_room: Option<(Arc<Made>, Arc<Baked>, String)>,
}

impl Energies {
    /// Forgets all that is of another model.
    pub(super) fn of_model(&mut self, model: &Arc<CadModel>) {
        if self.model.as_ref().is_some_and(|known| Arc::ptr_eq(known, model)) {
            return;
        }
        let making = self.making.take();
        if let Some(making) = &making {
            making.cancel.set();
        }
        *self = Self {
            model: Some(Arc::clone(model)),
            making,
            ..Self::default()
        };
    }

    /// Takes the end of making one in; returns whether it was made, for the open model.
    pub(super) fn take_in(&mut self, end: EnergyMade) -> bool {
        let is_current = |making: &Making| making.cancel.is(&end.cancel);
        if self.making.as_ref().is_some_and(is_current) {
            self.making = None;
        }
        let same_model = self
            .model
            .as_ref()
            .is_some_and(|known| Arc::ptr_eq(known, &end.model));
        match end.made {
            _ if !same_model => false,
            Some(made) => {
                self.made.truncate(MOST - 1);
                self.made.insert(0, Arc::new(made));
                true
            }
            None if end.cancel.is_set() => false,
            None => {
                self.unmade = Some((end.of, Unmade::Impossible));
                false
            }
        }
    }

    /// Has the part drawn by the energy of this fit, if it was made; returns whether it is.
    pub(super) fn choose(&mut self, of: &Pairing) -> bool {
        let made = self.made.iter().find(|made| made.of == *of);
        if let Some(made) = made {
            self.chosen.insert(of.moving, Arc::clone(made));
        }
        made.is_some()
    }

    /// Why there is no energy of this fit, where that is known.
    pub fn unmade(&self, of: &Pairing) -> Option<Unmade> {
        self.unmade.filter(|(known, _)| known == of).map(|(_, why)| why)
    }

    /// Does without the energy of this fit, or no longer.
    pub(super) fn decline(&mut self, of: Option<Pairing>) {
        self.unmade = of.map(|of| (of, Unmade::Cancelled));
        if let (Some(_), Some(making)) = (of, &self.making) {
            making.cancel.set();
        }
    }

    /// The energy that draws a part, once the scene has it.
    pub fn chosen(&self, part: usize) -> Option<&Arc<Made>> {
        self.chosen.get(&part)
    }

    /// The energies that a scene has.
    pub fn of_scene(&self, scene: Option<&Arc<Baked>>) -> &[Arc<Made>] {
        match (&self.scene, scene) {
            (Some(known), Some(scene)) if Arc::ptr_eq(&known.whole, scene) => &known.energies,
            _ => &[],
        }
    }

    /// Why a scene has no room for the energy of a part.
    pub fn no_room(&self, part: usize, scene: &Arc<Baked>) -> Option<&str> {
        let (made, bare, why) = self.no_room.as_ref()?;
        let is_it = Arc::ptr_eq(made, self.chosen.get(&part)?) && Arc::ptr_eq(bare, &self.bare(scene));
        is_it.then_some(why)
    }

    /// Bytes to leave for energies where a scene is baked.
    pub(super) fn wanted_bytes(&self) -> u64 {
        let placed: Vec<Placed> = self.chosen.values().map(|made| made.placed([0, 1])).collect();
        if placed.is_empty() {
            0
        } else {
            bytes(&placed) as u64
        }
    }

    /// A scene without its energies.
    fn bare(&self, scene: &Arc<Baked>) -> Arc<Baked> {
        match &self.scene {
            Some(known) if Arc::ptr_eq(&known.whole, scene) => Arc::clone(&known.bare),
            _ => Arc::clone(scene),
        }
    }

    /// The scene with the energy of a part, and of those of others as many as have room in `room` bytes. `number` is the number of a part in it.
    ///
    /// # Errors
    /// One line: why it has no room, or what is wrong.
    pub(super) fn attached(
        &mut self,
        part: usize,
        scene: &Arc<Baked>,
        room: usize,
        number: impl Fn(usize) -> Option<u16>,
    ) -> Result<Arc<Baked>, String> {
        let bare = self.bare(scene);
        let first = self.chosen.get(&part).into_iter();
        let others = self.chosen.iter().filter(|(other, _)| **other != part);
        let mut energies: Vec<Arc<Made>> = Vec::new();
        let mut placed: Vec<Placed> = Vec::new();
        for made in first.chain(others.map(|(_, made)| made)) {
            let numbers = (number(made.of.moving)).zip(number(made.of.against));
            let Some((moving, fixed)) = numbers else { continue };
            placed.push(made.placed([moving, fixed]));
            if bare.image.len().next_multiple_of(4) + bytes(&placed) > room {
                placed.pop();
            } else {
                energies.push(Arc::clone(made));
            }
        }
        let result = match energies.first() {
            Some(made) if made.of.moving == part => {
                attach(&bare.image, &placed).map_err(|error| error.to_string())
            }
            _ => Err(too_large(bare.image.len(), self.chosen.get(&part), room)),
        };
        let image = match result {
            Ok(image) => image,
            Err(why) => {
                let made = self.chosen.get(&part).map(Arc::clone);
                self.no_room = made.map(|made| (made, bare, why.clone()));
                return Err(why);
            }
        };
        let mut report = bare.report.clone();
        report.image_bytes = image.len() as _;
        let whole = Arc::new(Baked { image, report });
        self.scene = Some(Scene {
            bare,
            whole: Arc::clone(&whole),
            energies,
        });
        Ok(whole)
    }
}

/// Why a scene has no room for an energy, and what to do.
fn too_large(scene: usize, made: Option<&Arc<Made>>, room: usize) -> String {
    let kib = |bytes: usize| bytes as f64 / 1024.0;
    let energy = made.map_or(0, |made| made.bytes());
    format!(
        "The energy takes {:.1} KiB, and the collision model {:.1} of the {:.1} KiB that the board holds: bake again, which leaves room for it",
        kib(energy),
        kib(scene),
        kib(room)
    )
}
