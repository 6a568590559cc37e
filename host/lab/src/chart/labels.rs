//! Placement of labels beside points: the first place around each point that covers nothing drawn before.

/// A rectangle, pixels: left, top, right, bottom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Box4 {
    pub left: i32,
    pub top: i32,
    pub right: i32,
    pub bottom: i32,
}

impl Box4 {
    /// A square about a centre.
    pub fn about((x, y): (i32, i32), half: i32) -> Self {
        Self {
            left: x - half,
            top: y - half,
            right: x + half,
            bottom: y + half,
        }
    }

    fn meets(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn lies_in(&self, frame: &Self) -> bool {
        self.left >= frame.left
            && self.right <= frame.right
            && self.top >= frame.top
            && self.bottom <= frame.bottom
    }
}

/// Upper left corner of a label of `size` beside the point `at`, inside `frame` and clear of `taken`, to which the label is then added; `None` where
/// there is no space.
pub(super) fn place(
    at: (i32, i32),
    size: (i32, i32),
    gap: i32,
    frame: &Box4,
    taken: &mut Vec<Box4>,
) -> Option<(i32, i32)> {
    let (width, height) = size;
    // Nearest places first: right, left, above, below, and the corners; then the same farther out.
    for reach in [1, 2, 3, 4] {
        let gap = gap * reach;
        let (right, left, middle) = (at.0 + gap, at.0 - gap - width, at.0 - width / 2);
        let (above, below, level) = (at.1 - gap - height, at.1 + gap, at.1 - height / 2);
        for (x, y) in [
            (right, level),
            (right, above),
            (left, above),
            (middle, above),
            (left, level),
            (right, below),
            (middle, below),
            (left, below),
        ] {
            let words = Box4 {
                left: x,
                top: y,
                right: x + width,
                bottom: y + height,
            };
            if words.lies_in(frame) && !taken.iter().any(|other| words.meets(other)) {
                taken.push(words);
                return Some((x, y));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_labels_meet_and_none_leaves_the_frame() {
        let frame = Box4 {
            left: 0,
            top: 0,
            right: 400,
            bottom: 300,
        };
        let points: Vec<(i32, i32)> = (0..12).map(|i| (30 * i + 20, 20 * i + 30)).collect();
        let mut taken: Vec<Box4> = points.iter().map(|&point| Box4::about(point, 5)).collect();
        let placed = points
            .iter()
            .filter_map(|&point| place(point, (70, 14), 7, &frame, &mut taken))
            .count();
        assert!(placed >= 10, "{placed}");
        for (i, a) in taken.iter().enumerate() {
            assert!(a.lies_in(&frame), "{a:?}");
            for b in &taken[..i] {
                assert!(!a.meets(b), "{a:?} {b:?}");
            }
        }
    }
}
