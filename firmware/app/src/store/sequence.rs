//! Order of records in flash.

/// Whether `a` is newer than `b`: sequence numbers wrap, and half their range counts as newer.
pub(super) fn newer(a: u32, b: u32) -> bool {
    a.wrapping_sub(b) as i32 > 0
}
