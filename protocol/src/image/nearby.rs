//! Palette entries: the surfaces near a cell and how they give its distance, or the finer brick over it.

use super::records::NO_FACE;

/// Most finer bricks in one another.
pub const MOST_LEVELS: usize = 4;

/// Faces that meet in a cell, at most [`Self::MOST`]: a list, whose neighbours may be joined to clauses.
///
/// Each of the 16-bit words holds a face in bits 0–13, in bit 14 whether the next face belongs to the same clause, in bit 15 whether it is the
/// last; the words behind the last are [`NO_FACE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Group([u16; Self::MOST]);

impl Group {
    /// Most faces of a group.
    pub const MOST: usize = 8;
    const JOINED: u16 = 0x4000;
    const LAST: u16 = 0x8000;

    /// Of clauses of faces; `None` for none, an empty clause, too many faces, or a face above [`Nearby::MAX_FACES`].
    pub fn new(clauses: &[&[u16]]) -> Option<Self> {
        let mut words = [NO_FACE; Self::MOST];
        let mut count = 0;
        for clause in clauses {
            let (last, before) = clause.split_last()?;
            for &face in before {
                *words.get_mut(count)? = face | Self::JOINED;
                count += 1;
            }
            *words.get_mut(count)? = *last;
            count += 1;
        }
        if clauses
            .iter()
            .any(|c| c.iter().any(|&face| face > Nearby::MAX_FACES))
        {
            return None;
        }
        *words.get_mut(count.checked_sub(1)?)? |= Self::LAST;
        Some(Self(words))
    }

    /// Of the words of a palette from an index on. A last word that is missing counts as there: any words are a group.
    #[inline]
    pub fn read(words: &[u16]) -> Option<Self> {
        let mut group = [NO_FACE; Self::MOST];
        for (to, &word) in group.iter_mut().zip(words) {
            *to = word;
            if word & Self::LAST != 0 {
                break;
            }
        }
        (!words.is_empty()).then_some(Self(group))
    }

    /// The words to store.
    pub fn words(&self) -> &[u16] {
        let last = self.0.iter().position(|word| word & Self::LAST != 0);
        &self.0[..last.map_or(Self::MOST, |last| last + 1)]
    }

    /// Its faces in order, each with whether the next one belongs to the same clause.
    #[inline]
    pub fn faces(&self) -> impl Iterator<Item = (u16, bool)> {
        let mut ended = false;
        self.0.into_iter().map_while(move |word| {
            if ended {
                return None;
            }
            ended = word & Self::LAST != 0;
            Some((word & Nearby::MAX_FACES, word & Self::JOINED != 0))
        })
    }

    /// Number of its faces.
    #[inline]
    pub fn count(&self) -> u32 {
        self.words().len() as u32
    }

    /// Whether every clause is one face.
    #[inline]
    pub fn is_plain(&self) -> bool {
        self.faces().all(|(_, joined)| !joined)
    }
}

/// A palette entry: the faces nearest to a cell, and whether their exact surfaces give the distance there.
///
/// Of the 16 bits the upper two are the kind: 00 [`Self::Face`], 01 [`Self::Roughly`], 10 [`Self::Convex`], 11 [`Self::Reentrant`]. The others are
/// the face, or the index in the brick's palette of its [`Group`]. [`NO_FACE`] as a whole is [`Self::Unknown`]. Upper bits 101 are none of these kinds: a
/// *finer brick* covers the cell ([`Self::finer`]); no palette is so long that the index of a group reaches bit 13.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Nearby {
    /// Nearest face unknown.
    Unknown,
    /// The distance to this surface is exact all over the cell.
    Face(u16),
    /// This face is nearest; the distance is interpolated.
    Roughly(u16),
    /// A convex edge or corner of these faces: the largest of the distances to their surfaces has the sign of the true distance and no larger
    /// magnitude; inside, and at the faces, it is exact. A clause of several faces counts as the smallest of its distances; with such a clause the
    /// result is exact at the faces only.
    Convex(Group),
    /// A re-entrant edge or corner of these faces: the same for the smallest; outside, and at the faces, it is exact. A clause counts as the largest
    /// of its distances.
    Reentrant(Group),
}

impl Nearby {
    /// Most faces and patches of a shape whose palettes state more than [`Self::Unknown`].
    pub const MAX_FACES: u16 = 0x3fff;
    const KIND: u16 = 0xc000;
    const FINER: u16 = 0xa000;
    const FINER_MASK: u16 = 0xe000;

    /// From a palette entry; `group` reads a group from an index in the brick's palette.
    #[inline]
    pub fn from_bits(bits: u16, group: impl FnOnce(u16) -> Option<Group>) -> Self {
        let rest = bits & Self::MAX_FACES;
        match bits & Self::KIND {
            0 => Self::Face(rest),
            0x4000 => Self::Roughly(rest),
            0x8000 => group(rest).map_or(Self::Unknown, Self::Convex),
            _ if bits == NO_FACE => Self::Unknown,
            _ => group(rest).map_or(Self::Unknown, Self::Reentrant),
        }
    }

    /// Whether a palette entry names a finer brick.
    #[inline(always)]
    pub const fn is_finer(bits: u16) -> bool {
        bits & Self::FINER_MASK == Self::FINER
    }

    /// Number of the finer brick that a palette entry names, if it does; `palette` begins with the brick's own.
    #[inline]
    pub fn finer(bits: u16, palette: &[u16]) -> Option<u16> {
        if !Self::is_finer(bits) {
            return None;
        }
        palette.get(usize::from(bits & !Self::FINER_MASK)).copied()
    }

    /// Palette entry of a cell under a finer brick; `at` is the index in the brick's palette of its number.
    pub const fn finer_bits(at: u16) -> u16 {
        Self::FINER | at & !Self::FINER_MASK
    }

    /// To a palette entry; `at` is the index in the brick's palette of the group, for the kinds that have one.
    pub const fn to_bits(self, at: u16) -> u16 {
        match self {
            Self::Unknown => NO_FACE,
            Self::Face(face) => face & Self::MAX_FACES,
            Self::Roughly(face) => 0x4000 | face & Self::MAX_FACES,
            Self::Convex(_) => 0x8000 | at & Self::MAX_FACES,
            Self::Reentrant(_) => 0xc000 | at & Self::MAX_FACES,
        }
    }

    /// The nearest face and another nearby face, each [`NO_FACE`] if there is none.
    pub fn two_faces(self) -> [u16; 2] {
        match self {
            Self::Convex(group) | Self::Reentrant(group) => {
                let mut faces = group.faces().map(|(face, _)| face);
                [(); 2].map(|()| faces.next().unwrap_or(NO_FACE))
            }
            Self::Unknown | Self::Face(_) | Self::Roughly(_) => [self.face(), NO_FACE],
        }
    }

    /// One of the nearest faces, or [`NO_FACE`].
    pub fn face(self) -> u16 {
        match self {
            Self::Unknown => NO_FACE,
            Self::Face(face) | Self::Roughly(face) => face,
            Self::Convex(_) | Self::Reentrant(_) => self.two_faces()[0],
        }
    }
}
