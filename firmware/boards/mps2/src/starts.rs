//! How often the board has started since power-on, in memory that a reset leaves alone.

/// A count and its complement, by which memory that was never written is recognised.
pub type Counted = [u32; 2];

/// The count after one more start; 1 where there is none yet.
pub const fn after_one_more([starts, check]: Counted) -> Counted {
    let starts = if check == !starts {
        starts.wrapping_add(1)
    } else {
        1
    };
    [starts, !starts]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn memory_never_written_is_the_first_start() {
        for never in [[0, 0], [u32::MAX; 2], [0x5555_5555; 2]] {
            assert_eq!(after_one_more(never)[0], 1);
        }
    }

    proptest! {
        #[test]
        fn each_start_counts_one(starts in any::<u32>()) {
            let next = after_one_more([starts, !starts]);
            prop_assert_eq!(next[0], starts.wrapping_add(1));
            prop_assert_eq!(after_one_more(next)[0], starts.wrapping_add(2));
        }

        #[test]
        fn a_flipped_bit_is_no_count(starts in any::<u32>(), bit in 0usize..64) {
            let mut words = [starts, !starts];
            words[bit / 32] ^= 1 << (bit % 32);
            prop_assert_eq!(after_one_more(words)[0], 1);
        }
    }
}
