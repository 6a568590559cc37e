//! The real planes on two threads: the link plane receives frames while the control plane ticks, in every interleaving with up to `PREEMPTIONS`
//! preemptions, and with every stale value that the memory model allows it to read.
//!
//! - A tick that begins after STOP was received drives no motor, and neither does any later one.
//! - Motors and flash exclude each other: loom watches one cell that a driven motor and a flash operation both write.

mod board;

use board::{Board, Halves};
use loom::sync::Arc;
use loom::sync::atomic::{AtomicBool, Ordering};
use loom::thread;
use mortise_protocol::message::ToDevice;

/// Preemptions that loom adds to the switches in the code. Most concurrency faults need one or two.
const PREEMPTIONS: usize = 3;
/// Ticks during the link plane's work.
const TICKS: usize = 3;

/// Stack of a thread, in words.
const STACK: usize = 256 * 1024;

fn explore(model: impl Fn() + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = Some(PREEMPTIONS);
    builder.max_branches = 20_000;
    let model = std::sync::Arc::new(model);
    builder.check(move || {
        let model = std::sync::Arc::clone(&model);
        // On a separate thread because of its stack; loom's first thread has a small one.
        spawn(move || model()).join().expect("the model holds");
    });
}

/// Starts a thread with a stack large enough for a board.
fn spawn<T: Send + 'static>(body: impl FnOnce() -> T + Send + 'static) -> thread::JoinHandle<T> {
    let builder = thread::Builder::new().stack_size(STACK);
    builder.spawn(body).expect("loom starts it")
}

/// Runs `messages` through the link plane during `TICKS` ticks; `stopped` is set once the last one was received.
fn beside(board: &mut Board, messages: Vec<ToDevice>, stop_is_last: bool) -> bool {
    let frames: Vec<Vec<u8>> = messages.iter().map(|message| board.frame(message)).collect();
    let stopped = Arc::new(AtomicBool::new(false));
    let Halves {
        mut link,
        mut control,
    } = board.take();
    let reported = Arc::clone(&stopped);
    let linked = spawn(move || {
        for frame in frames {
            link.receive(&frame);
        }
        reported.store(true, Ordering::Release);
        link
    });
    let mut driven = false;
    for _ in 0..TICKS {
        let after_stop = stop_is_last && stopped.load(Ordering::Acquire);
        control.tick();
        driven |= control.is_live();
        assert!(
            !(after_stop && control.is_live()),
            "driven in a tick that began after STOP was taken"
        );
    }
    let link = linked.join().expect("the link plane does not panic");
    control.tick();
    assert!(!(stop_is_last && control.is_live()), "driven after STOP");
    board.put_back(Halves { link, control });
    driven
}

#[test]
fn stop_overtakes_what_was_sent_before_it() {
    explore(|| {
        let mut board = Board::with_scene();
        beside(&mut board, vec![ToDevice::Arm, ToDevice::Stop], true);
        // No pending command undoes it.
        for _ in 0..3 {
            board.round();
            assert!(!board.is_live(), "driven after STOP");
        }
    });
}

#[test]
fn motors_and_flash_exclude_each_other() {
    explore(|| {
        let mut board = Board::with_scene();
        let begin = board.begin();
        beside(&mut board, vec![ToDevice::Arm, begin], false);
        for _ in 0..3 {
            board.round();
        }
    });
}

#[test]
fn flash_begun_before_arming_keeps_the_motors_off() {
    explore(|| {
        let mut board = Board::with_scene();
        let begin = board.begin();
        beside(&mut board, vec![begin, ToDevice::Arm], false);
        board.round();
    });
}

/// The models above are meaningful only if motors are driven in some of their interleavings.
#[test]
fn the_models_reach_driven_motors() {
    use std::sync::atomic::AtomicBool as Plain;
    static REACHED: Plain = Plain::new(false);
    explore(|| {
        let mut board = Board::with_scene();
        if beside(&mut board, vec![ToDevice::Arm], false) {
            REACHED.store(true, Ordering::Relaxed);
        }
    });
    assert!(REACHED.load(Ordering::Relaxed));
}
