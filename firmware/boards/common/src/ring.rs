//! Bytes of log frames that wait to be sent. A frame that finds no room is dropped whole, so that the host's decoder stays in step.

use heapless::Deque;

/// See the module.
pub struct Ring<const N: usize> {
    bytes: Deque<u8, N>,
    /// Bytes of the frame under way, taken back should it not fit.
    frame: usize,
    /// It does not fit.
    overflow: bool,
}

impl<const N: usize> Default for Ring<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Ring<N> {
    /// Empty.
    pub const fn new() -> Self {
        Self {
            bytes: Deque::new(),
            frame: 0,
            overflow: false,
        }
    }

    /// A frame begins.
    pub fn begin(&mut self) {
        self.frame = 0;
        self.overflow = false;
    }

    /// More of the frame.
    pub fn push(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if self.overflow || self.bytes.push_back(byte).is_err() {
                self.overflow = true;
                return;
            }
            self.frame += 1;
        }
    }

    /// The frame is whole.
    pub fn end(&mut self) {
        if self.overflow {
            for _ in 0..self.frame {
                self.bytes.pop_back();
            }
        }
    }

    /// Copies waiting bytes to `out`, oldest first; returns how many.
    pub fn peek(&self, out: &mut [u8]) -> usize {
        out.iter_mut()
            .zip(&self.bytes)
            .map(|(place, byte)| *place = *byte)
            .count()
    }

    /// The oldest `count` bytes are sent.
    pub fn drop_front(&mut self, count: usize) {
        for _ in 0..count {
            self.bytes.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    use super::*;

    proptest! {
        /// Whatever is pushed and sent: what comes out is whole frames in order.
        #[test]
        fn frames_come_out_whole_and_in_order(
            frames in prop::collection::vec((prop::collection::vec(1u8..=255, 0..40), 0usize..60), 0..40),
        ) {
            let mut ring = Ring::<64>::new();
            let mut out = Vec::new();
            let mut kept = Vec::new();
            let mut waiting = 0;
            for (frame, sent) in &frames {
                ring.begin();
                for piece in frame.chunks(7) {
                    ring.push(piece);
                }
                ring.end();
                if waiting + frame.len() <= 64 {
                    kept.extend_from_slice(frame);
                    waiting += frame.len();
                }
                let mut piece = vec![0; *sent];
                let offered = ring.peek(&mut piece);
                out.extend_from_slice(&piece[..offered]);
                ring.drop_front(offered);
                waiting -= offered;
            }
            prop_assert_eq!(&out[..], &kept[..out.len()]);
            prop_assert_eq!(out.len() + waiting, kept.len());
        }
    }
}
