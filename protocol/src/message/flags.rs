//! Flags of a tick: the one list from force law to window.

/// A flag with what is said about it.
#[derive(Clone, Copy, Debug)]
pub struct FlagRow {
    /// The flag.
    pub flag: Flags,
    /// Name in the message table.
    pub name: &'static str,
    /// When it is set, a sentence.
    pub meaning: &'static str,
    /// Text in the window.
    pub words: &'static str,
}

/// Declares every flag with its meaning (the first line of its documentation), bit and words.
macro_rules! flags {
    ($(#[doc = $meaning:literal] $(#[doc = $detail:literal])* $name:ident = $bit:literal, $words:literal;)+) => {
        bitflags::bitflags! {
            /// Set of conditions of a tick, as the force law raises them, the board adds to them, and [`super::Telemetry::flags`] carries them.
            #[derive(Clone, Copy, Default, PartialEq, Eq)]
            pub struct Flags: u16 {
                $(#[doc = $meaning] $(#[doc = $detail])* const $name = 1 << $bit;)+
                // Bits of a newer board are kept.
                const _ = !0;
            }
        }

        impl Flags {
            /// Every flag, most important first.
            pub const ROWS: &[FlagRow] = &[$(FlagRow {
                flag: Self::$name,
                name: stringify!($name),
                meaning: $meaning.trim_ascii(),
                words: $words,
            },)+];
        }
    };
}

flags! {
    /// A computed number was not finite: the wrench is zero.
    ///
    /// The object stays where it was.
    NON_FINITE = 4, "the computed force was not finite";
    /// A sensor reading was not finite or implausible.
    ///
    /// Out of range, or not a rotation: zero wrench, and nothing moved.
    BAD_INPUT = 13, "a sensor reading was not a number or out of proportion";
    /// The force limit acted.
    FORCE_LIMIT = 1, "force limit acts";
    /// The torque limit acted.
    TORQUE_LIMIT = 2, "torque limit acts";
    /// The limit on the change of force acted.
    FORCE_SLEW = 3, "limit on change of force acts";
    /// The limit on the change of torque acted.
    TORQUE_SLEW = 14, "limit on change of torque acts";
    /// The coupling slipped at its largest force.
    COUPLING_FORCE = 7, "the coupling slips: force";
    /// The coupling slipped at its largest torque.
    COUPLING_TORQUE = 12, "the coupling slips: torque";
    /// The part's speed was limited to its maximum, or to the search margin.
    SPEED_LIMIT = 9, "speed limit acts";
    /// The handle's wrench is damped because the loop generated energy.
    SOFTENED = 8, "damped for stability";
    /// A point is too deep inside for the field to give a way out.
    ///
    /// The point does not push.
    DEEP = 10, "penetration too deep";
    /// The step's touching points had not come to rest.
    ///
    /// Their set still changed in the last solve allowed.
    UNSETTLED = 11, "contacts had not settled";
    /// The point budget was reached: some points were not queried this tick.
    ///
    /// Points are decimated evenly; when that is not enough, the rest waits for the next ticks. Points that touched stay felt.
    BUDGET = 0, "point budget reached";
    /// More contacts than the board stores.
    ///
    /// Kept are the deepest candidates, and of the rest those that a rotation would bring to touch first. If more touch than fit, points are
    /// decimated evenly from the next tick on ([`Self::BUDGET`]).
    CONTACTS = 6, "more contacts than fit";
    /// More face pairs touch than the message holds.
    ///
    /// Added by the board's control plane; the force law raises all others.
    PAIRS = 5, "more touching faces than are shown";
}

impl Flags {
    /// Sets all of `other` when `condition` holds.
    pub fn insert_if(&mut self, condition: bool, other: Self) {
        if condition {
            self.insert(other);
        }
    }

    /// Rows of the flags that are set, most important first.
    pub fn rows(self) -> impl Iterator<Item = &'static FlagRow> {
        (Self::ROWS.iter()).filter(move |row| self.contains(row.flag))
    }
}

impl core::fmt::Debug for Flags {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_set().entries(self.rows().map(|row| row.name)).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_flag_has_a_bit_a_name_and_words_of_its_own() {
        for (i, row) in Flags::ROWS.iter().enumerate() {
            assert_eq!(row.flag.bits().count_ones(), 1, "{}", row.name);
            assert!(row.meaning.ends_with('.') && !row.words.is_empty(), "{row:?}");
            for other in &Flags::ROWS[..i] {
                assert!(!row.flag.intersects(other.flag), "{row:?}, {other:?}");
                assert!(
                    row.name != other.name && row.words != other.words,
                    "{row:?}, {other:?}"
                );
            }
        }
        assert_eq!(
            Flags::from_bits_retain(u16::MAX).rows().count(),
            Flags::ROWS.len()
        );
        assert_eq!(Flags::empty().rows().count(), 0);
    }
}
