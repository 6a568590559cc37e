//! The queue between the planes, as `heapless` implements it: a slot is read only after it was written completely, in order, and is written again
//! only after it was read.
//!
//! Loom cannot observe the memory of the slots, so cells that it watches stand for it. For each item the producer writes a cell before it enqueues,
//! and the consumer reads it after it dequeues. For each dequeued item the consumer first writes a second cell, and the producer reads it after it
//! has enqueued the item that takes the same slot. If an ordering in the queue were weaker than release and acquire, loom would report a race.

use heapless::spsc::Queue;
use loom::cell::UnsafeCell;
use loom::sync::Arc;
use loom::thread;

/// Capacity of the queue.
const SLOTS: usize = 2;
/// Number of items sent: every slot of the ring is used, the first ones twice.
const ITEMS: usize = 4;

/// One cell per item and direction.
struct Cells {
    forward: [UnsafeCell<usize>; ITEMS],
    back: [UnsafeCell<usize>; ITEMS],
}

// SAFETY: loom reports two accesses that are not ordered; this is the property under test.
unsafe impl Sync for Cells {}

fn cells() -> [UnsafeCell<usize>; ITEMS] {
    std::array::from_fn(|_| UnsafeCell::new(usize::MAX))
}

fn write(cell: &UnsafeCell<usize>, value: usize) {
    // SAFETY: ordered before every read, or loom reports it.
    cell.with_mut(|place| unsafe { *place = value });
}

fn read(cell: &UnsafeCell<usize>) -> usize {
    // SAFETY: ordered after the write, or loom reports it.
    cell.with(|place| unsafe { *place })
}

#[test]
fn items_arrive_whole_and_in_order() {
    loom::model(|| {
        let queue = Box::into_raw(Box::new(Queue::<usize, { SLOTS + 1 }>::new()));
        // SAFETY: the only reference. Both halves end before the box is taken back below.
        let (mut producer, mut consumer) = unsafe { &mut *queue }.split();
        // Both of the queue's atomics are registered with the model before the second thread starts.
        assert_eq!(consumer.len(), 0);
        let cells = Arc::new(Cells {
            forward: cells(),
            back: cells(),
        });
        let far = Arc::clone(&cells);
        let sender = thread::spawn(move || {
            for item in 0..ITEMS {
                write(&far.forward[item], item);
                while producer.enqueue(item).is_err() {
                    thread::yield_now();
                }
                // The ring has one slot more than its capacity.
                if let Some(before) = item.checked_sub(SLOTS) {
                    assert_eq!(read(&far.back[before]), before, "the slot was read before");
                }
            }
        });
        for item in 0..ITEMS {
            write(&cells.back[item], item);
            let taken = loop {
                match consumer.dequeue() {
                    Some(taken) => break taken,
                    None => thread::yield_now(),
                }
            };
            assert_eq!(taken, item, "order");
            assert_eq!(read(&cells.forward[item]), item, "whole");
        }
        sender.join().expect("the sender ends");
        // SAFETY: both halves are no longer used.
        drop(unsafe { Box::from_raw(queue) });
    });
}
