//! The scene that a board has in its flash, and how its parts get to other places without another upload. Pure.

use std::sync::Arc;

use glam::DAffine3;
use mortise_bake::Baked;
use mortise_protocol::message::ToDevice;

use super::placed_scene::with_placements;
use super::pose;

/// A scene that was sent to a board.
pub struct Flashed {
    /// The image as baked, with its parts where the file has them.
    baked: Arc<Baked>,
    /// Where its parts are in the image that was sent, in the image's order, mm.
    placements: Vec<DAffine3>,
}

impl Flashed {
    /// The scene `baked`, with its parts, in the image's order, at `placements`, mm.
    pub fn new(baked: Arc<Baked>, placements: Vec<DAffine3>) -> Self {
        Self { baked, placements }
    }

    /// The image to send; `None` when a pose is not finite, or parts are missing.
    pub fn image(&self) -> Option<Arc<Baked>> {
        let image = with_placements(&self.baked.image, &self.placements)?;
        let report = self.baked.report.clone();
        Some(Arc::new(Baked { image, report }))
    }

    /// Whether it is this one, wherever its parts are.
    pub fn has(&self, baked: &Arc<Baked>) -> bool {
        Arc::ptr_eq(&self.baked, baked)
    }

    /// Whether a reset puts its parts at `placements`.
    pub fn resets_to(&self, placements: &[DAffine3]) -> bool {
        self.placements == placements
    }

    /// Messages that put every part at its place, wherever a hand has left it.
    pub fn moved_to(&self, placements: &[DAffine3]) -> Vec<ToDevice> {
        let places =
            (self.placements.iter().zip(placements).zip(0u16..)).filter(|((was, now), _)| was != now);
        let places = places.map(|((_, now), part)| ToDevice::Place {
            part,
            pose: pose::to_wire(now),
        });
        std::iter::once(ToDevice::ResetScene).chain(places).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use mortise_bake::BakeReport;

    use super::*;

    #[test]
    fn only_parts_that_are_elsewhere_are_placed_after_the_reset() {
        let baked = || {
            Arc::new(Baked {
                image: Vec::new(),
                report: BakeReport::default(),
            })
        };
        let (first, second) = (baked(), baked());
        let there = DAffine3::from_translation(DVec3::X);
        let flashed = Flashed::new(first.clone(), vec![DAffine3::IDENTITY, there, DAffine3::IDENTITY]);
        assert!(flashed.has(&first) && !flashed.has(&second));
        assert_eq!(
            flashed.moved_to(&[DAffine3::IDENTITY, there, DAffine3::IDENTITY]),
            [ToDevice::ResetScene]
        );
        let moved = flashed.moved_to(&[DAffine3::IDENTITY, DAffine3::IDENTITY, there]);
        let place = |part, at: &DAffine3| ToDevice::Place {
            part,
            pose: pose::to_wire(at),
        };
        assert_eq!(
            moved,
            [
                ToDevice::ResetScene,
                place(1, &DAffine3::IDENTITY),
                place(2, &there)
            ]
        );
    }
}
