//! Meaning of a SpaceMouse's own reports.
//!
//! The first byte is the number of the report. 1: translations along x (right), y (towards the viewer) and z (down), each a signed 16-bit number, the low
//! byte first; newer models send all six axes in it. 2: rotations about the same axes, of older models. 3: the buttons that are down, a bit each. A
//! deflection of about 350 is full. Sources: devices.toml of PySpaceMouse for the layouts and the scale; dev.c of spacenavd 1.3.1 (swapped and inverted y
//! and z) and its defaults in cfgfile.c (values under 2 are none) for the directions, which are the same as through the daemon.

use glam::DVec3;

use super::watch::Event;
use crate::viewport::six_axis::Deflection;

const TRANSLATIONS: u8 = 1;
const ROTATIONS: u8 = 2;
const BUTTONS: u8 = 3;
/// Full deflection, units of the device.
const FULL: f64 = 350.0;
/// Smallest deflection that is one.
const LEAST: u16 = 2;

/// Reads reports one after another.
#[derive(Debug)]
pub(super) struct Decoder {
    deflection: Deflection,
    /// Buttons that are down.
    down: u32,
    /// Bit of button 0; those below have no number.
    first: u32,
}

impl Decoder {
    /// A device at rest whose button 0 is the bit `first`, below 32.
    pub(super) fn new(first: u32) -> Self {
        Self {
            deflection: Deflection::default(),
            down: 0,
            first,
        }
    }

    /// Adds what a report says to `events`. Reports that are unknown or too short say nothing.
    pub(super) fn take(&mut self, report: &[u8], events: &mut Vec<Event>) {
        let Some((&number, data)) = report.split_first() else {
            return;
        };
        match number {
            TRANSLATIONS => {
                self.deflection.shift = axes(data).unwrap_or(self.deflection.shift);
                let turn = data.get(6..).and_then(axes);
                self.deflection.turn = turn.unwrap_or(self.deflection.turn);
            }
            ROTATIONS => self.deflection.turn = axes(data).unwrap_or(self.deflection.turn),
            BUTTONS if !data.is_empty() => return self.press(data, events),
            _ => return,
        }
        events.push(Event::Deflected(self.deflection));
    }

    /// Takes the bit mask of the buttons; up to 32 of them are known.
    fn press(&mut self, data: &[u8], events: &mut Vec<Event>) {
        let mut bytes = [0; 4];
        for (byte, sent) in bytes.iter_mut().zip(data) {
            *byte = *sent;
        }
        let down = u32::from_le_bytes(bytes);
        let pressed = (down & !self.down) >> self.first;
        self.down = down;
        let numbers = (0..32).filter(|bit| pressed >> bit & 1 == 1);
        events.extend(numbers.map(Event::Pressed));
    }
}

/// Three axes of the device in the directions of the screen: right, up, towards the viewer.
fn axes(data: &[u8]) -> Option<DVec3> {
    let (words, _) = data.as_chunks::<2>();
    let [x, y, z] = words.first_chunk()?.map(|word| share(i16::from_le_bytes(word)));
    Some(DVec3::new(x, -z, y))
}

/// Share of full deflection.
fn share(raw: i16) -> f64 {
    if raw.unsigned_abs() < LEAST {
        return 0.0;
    }
    (f64::from(raw) / FULL).clamp(-1.0, 1.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn said(decoder: &mut Decoder, report: &[u8]) -> Vec<Event> {
        let mut events = Vec::new();
        decoder.take(report, &mut events);
        events
    }

    fn deflected(shift: [f64; 3], turn: [f64; 3]) -> Event {
        Event::Deflected(Deflection {
            shift: shift.into(),
            turn: turn.into(),
        })
    }

    /// 175 = 0x00af, −350 = 0xfea2, 35 = 0x0023.
    #[test]
    fn translations_and_rotations_of_older_models_come_apart() {
        let mut decoder = Decoder::new(0);
        let shifted = said(&mut decoder, &[1, 0xaf, 0, 0xa2, 0xfe, 0x23, 0]);
        assert_eq!(shifted, [deflected([0.5, -0.1, -1.0], [0.0; 3])]);
        let turned = said(&mut decoder, &[2, 0xa2, 0xfe, 0xaf, 0, 0, 0]);
        assert_eq!(turned, [deflected([0.5, -0.1, -1.0], [-1.0, 0.0, 0.5])]);
        let back = said(&mut decoder, &[1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(back, [deflected([0.0; 3], [-1.0, 0.0, 0.5])]);
        assert_eq!(
            said(&mut decoder, &[2, 0, 0, 0, 0, 0, 0]),
            [deflected([0.0; 3], [0.0; 3])]
        );
    }

    #[test]
    fn newer_models_send_six_axes_at_once() {
        let mut decoder = Decoder::new(0);
        let report = [1, 0xaf, 0, 0, 0, 0xa2, 0xfe, 0, 0, 0x23, 0, 0xaf, 0];
        assert_eq!(
            said(&mut decoder, &report),
            [deflected([0.5, 1.0, 0.0], [0.0, -0.5, 0.1])]
        );
    }

    #[test]
    fn noise_at_rest_is_none_and_full_deflection_is_not_exceeded() {
        let mut decoder = Decoder::new(0);
        let noise = said(&mut decoder, &[1, 1, 0, 0xff, 0xff, 1, 0]);
        assert_eq!(noise, [deflected([0.0; 3], [0.0; 3])]);
        let most = said(&mut decoder, &[1, 0xff, 0x7f, 0, 0x80, 2, 0]);
        assert_eq!(most, [deflected([1.0, -2.0 / 350.0, -1.0], [0.0; 3])]);
    }

    #[test]
    fn buttons_are_reported_when_they_go_down() {
        let mut decoder = Decoder::new(0);
        assert_eq!(said(&mut decoder, &[3, 1, 0]), [Event::Pressed(0)]);
        assert_eq!(said(&mut decoder, &[3, 3, 0]), [Event::Pressed(1)]);
        assert_eq!(said(&mut decoder, &[3, 0, 0]), []);
        let both = said(&mut decoder, &[3, 3]);
        assert_eq!(both, [Event::Pressed(0), Event::Pressed(1)]);
    }

    /// Keys 1 and 2 of a SpaceMouse Pro are the bits 12 and 13, its menu key the bit 0.
    #[test]
    fn keys_with_numbers_are_numbered_as_by_the_daemon() {
        let mut decoder = Decoder::new(12);
        assert_eq!(said(&mut decoder, &[3, 1, 0, 0, 0]), []);
        assert_eq!(said(&mut decoder, &[3, 1, 0x10, 0, 0]), [Event::Pressed(0)]);
        assert_eq!(said(&mut decoder, &[3, 0, 0x20, 0, 0]), [Event::Pressed(1)]);
    }

    proptest! {
        #[test]
        fn any_bytes_give_bounded_deflections_and_known_buttons(
            reports in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..80), 0..20),
            number in 0_u8..5,
            first in 0_u32..32,
        ) {
            let mut decoder = Decoder::new(first);
            for mut report in reports {
                // Half of them have a number that is known.
                if let [begin, after, ..] = &mut report[..] && *after < 128 {
                    *begin = number;
                }
                for event in said(&mut decoder, &report) {
                    match event {
                        Event::Deflected(Deflection { shift, turn }) => {
                            for part in [shift, turn] {
                                prop_assert!(part.is_finite() && part.abs().max_element() <= 1.0);
                            }
                        }
                        Event::Pressed(button) => prop_assert!((0..32).contains(&button)),
                    }
                }
            }
        }
    }
}
