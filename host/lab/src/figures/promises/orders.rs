//! Orders of messages: the model checker's counts, one row a promise.

use mortise_orders::{Broken, PROMISES, Report, enumerate, enumerate_topics};

use crate::figures::{Plan, Row};

/// Events in the longest orders over the whole alphabet, which orders no restart and no test of a motor: some minutes in the full form, some seconds in the shorter one.
const DEPTH: usize = 8;
const DEPTH_QUICK: usize = 6;
/// Events in the longest orders over one topic.
const TOPIC_DEPTH: usize = 10;
const TOPIC_DEPTH_QUICK: usize = 8;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) {
    let (depth, topic_depth) = if plan.quick {
        (DEPTH_QUICK, TOPIC_DEPTH_QUICK)
    } else {
        (DEPTH, TOPIC_DEPTH)
    };
    rows(
        &format!("orders of messages, all events but restarts and tests, to depth {depth}"),
        &enumerate(depth),
        out,
    );
    for (topic, report) in enumerate_topics(topic_depth) {
        let what = format!(
            "orders of messages, events on the {}, to depth {topic_depth}",
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
        Broken::AfterDisarm => "motors driven behind a disarming or a greeting, other than to fade out",
        Broken::FadeLate => "motors live longer than a soft stop takes",
        Broken::NotGrabbed => {
            "a part felt behind a release, or by a command that was late, repeated or of another session"
        }
        Broken::Restart => {
            "restart with motors live, or by a command that was late, repeated or of another session"
        }
    }
}
