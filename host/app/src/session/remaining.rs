//! Estimate of the remaining time of a job from its progress so far.

use std::time::Duration;

/// Least time and progress for an estimate: the first steps say little about the rest.
const LEAST: (Duration, f32) = (Duration::from_millis(800), 0.02);

/// Remaining time after `elapsed` at `fraction` (0 to 1), assuming a constant rate: `elapsed·(1 − f)/f`.
pub fn left(elapsed: Duration, fraction: f32) -> Option<Duration> {
    if !(fraction >= LEAST.1 && fraction <= 1.0) || elapsed < LEAST.0 {
        return None;
    }
    let f = f64::from(fraction);
    Duration::try_from_secs_f64(elapsed.as_secs_f64() * (1.0 - f) / f).ok()
}

/// The remaining time in words, rounded to the precision of an estimate.
pub fn words(left: Duration) -> String {
    let seconds = left.as_secs_f64().ceil() as u64;
    match seconds {
        0..=1 => "1 s left".to_owned(),
        2..=9 => format!("{seconds} s left"),
        10..=90 => format!("{} s left", seconds.div_ceil(5) * 5),
        _ => format!("{} min left", seconds.div_ceil(60)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_follows_from_what_was_done() {
        let s = Duration::from_secs;
        assert_eq!(left(s(10), 0.25), Some(s(30)));
        assert_eq!(left(s(10), 1.0), Some(s(0)));
        for (elapsed, fraction) in [(s(0), 0.5), (s(10), 0.0), (s(10), f32::NAN), (s(10), 1.5)] {
            assert_eq!(left(elapsed, fraction), None);
        }
        for (seconds, said) in [
            (0, "1 s left"),
            (7, "7 s left"),
            (41, "45 s left"),
            (200, "4 min left"),
        ] {
            assert_eq!(words(s(seconds)), said);
        }
    }
}
