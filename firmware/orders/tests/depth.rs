//! No sequence of messages breaks a promise.

use mortise_orders::{ALPHABET, Event, TOPICS, compare_equals, enumerate, enumerate_topics};

/// Half a minute; `deep` goes to 8.
#[test]
fn no_order_of_seven_events_breaks_a_promise() {
    let report = enumerate(7);
    println!("{report}");
    assert!(report.broken.is_empty(), "{report}");
}

/// Fewer events, longer sequences.
#[test]
fn no_order_of_ten_events_of_a_topic_breaks_a_promise() {
    for (topic, report) in enumerate_topics(10) {
        println!("{}: {report}", topic.name);
        assert!(report.broken.is_empty(), "{}: {report}", topic.name);
    }
}

/// What is not continued because an equal state is behaves alike: all such sequences of up to 4 events, and every 20th of up to 5; of each topic
/// all of up to 7.
#[test]
fn equal_states_behave_alike() {
    let compare = |events: &[Event], depth, each, least| {
        let (compared, differ) = compare_equals(events, depth, each);
        println!("{compared} outcomes compared");
        assert!(compared > least);
        assert!(differ.is_empty(), "{} differ: {:#?}", differ.len(), &differ[..1]);
    };
    for (depth, each) in [(5, 1), (6, 20)] {
        compare(&ALPHABET, depth, each, 100_000);
    }
    for topic in TOPICS {
        compare(topic.events, 8, 1, 100);
    }
}

/// `cargo test --release -p mortise-orders -- --ignored --nocapture`
#[test]
#[ignore = "some minutes: docs/safety.md has its last result"]
fn deep() {
    for depth in 1..=8 {
        let begun = std::time::Instant::now();
        let report = enumerate(depth);
        println!("{report}, {:.1} s", begun.elapsed().as_secs_f64());
        assert!(report.broken.is_empty(), "{report}");
    }
}
