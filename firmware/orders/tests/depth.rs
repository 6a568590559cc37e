//! No sequence of messages breaks a promise.

use mortise_orders::{enumerate, enumerate_topics};

/// The depth that fits into CI; `deep` goes to 8.
#[test]
fn no_order_of_four_events_breaks_a_promise() {
    let report = enumerate(4);
    println!("{report}");
    assert!(report.broken.is_empty(), "{report}");
}

/// Fewer events, longer sequences.
#[test]
fn no_order_of_eight_events_of_a_topic_breaks_a_promise() {
    for (topic, report) in enumerate_topics(8) {
        println!("{}: {report}", topic.name);
        assert!(report.broken.is_empty(), "{}: {report}", topic.name);
    }
}

/// `cargo test --release -p mortise-orders -- --ignored --nocapture`
#[test]
#[ignore = "long: docs/safety.md has its last result"]
fn deep() {
    for depth in 1..=8 {
        let begun = std::time::Instant::now();
        let report = enumerate(depth);
        println!("{report}, {:.1} s", begun.elapsed().as_secs_f64());
        assert!(report.broken.is_empty(), "{report}");
    }
}
