//! Orders of messages: the model checker's counts, one row a promise.

use mortise_orders::{Broken, PROMISES, Report, enumerate, enumerate_topics};

use crate::figures::Row;

/// Events in the longest orders over the whole alphabet: some minutes.
const DEPTH: usize = 8;
/// Events in the longest orders over one topic.
const TOPIC_DEPTH: usize = 10;

/// Measures every row.
pub(super) fn measure(out: &mut dyn FnMut(Row)) {
    rows(
        &format!("orders of messages, all events, to depth {DEPTH}"),
        &enumerate(DEPTH),
        out,
    );
    for (topic, report) in enumerate_topics(TOPIC_DEPTH) {
        let what = format!(
            "orders of messages, events on the {}, to depth {TOPIC_DEPTH}",
            topic.name
        );
        rows(&what, &report, out);
    }
}

fn rows(what: &str, report: &Report, out: &mut dyn FnMut(Row)) {
    out(Row::reported(
        format!("{what}: orders covered"),
        report.orders as f64,
        "orders",
    ));
    for promise in PROMISES {
        let broken = report.count(promise) as f64;
        out(Row::exactly(
            format!("{what}: {}", words(promise)),
            broken,
            "steps",
            0.0,
        ));
    }
}

/// Description of the violation of a promise.
fn words(promise: Broken) -> &'static str {
    match promise {
        Broken::NoChecksum => "motors live without the scene's checksum",
        Broken::NoReference => "motors live without a reference",
        Broken::NotFresh => "motors live by a command that was late, repeated or of another session",
        Broken::AfterStop => "motors live behind a stop or fault that no fresh command cleared",
        Broken::StopLate => "motors live in the tick behind STOP",
        Broken::ReadBack => "a parameter read back that is not in force",
        Broken::FlashWhileLive => "flash written while motors are driven",
        Broken::StateDiffers => "motors and reported state differ",
    }
}
