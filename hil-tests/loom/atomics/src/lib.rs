//! Atomics with the names of `portable-atomic`, in a form that the loom model checker can observe.
//!
//! `heapless` and `mortise-firmware` build their queues and words in `const` functions, which loom's atomics do not have. Each atomic here therefore
//! registers itself with the model at its first use. A model must therefore read each atomic once before it starts its second thread: loom treats the
//! registration as a write, which has to come before every other thread's accesses, and reports a causality violation otherwise.

use std::mem::ManuallyDrop;
use std::sync::{Mutex, OnceLock, PoisonError};

pub use loom::sync::atomic::{Ordering, fence};

/// Defines one atomic type: `name`, its value's type, loom's type.
macro_rules! atomic {
    ($name:ident, $value:ty) => {
        /// Like the type of this name in `core::sync::atomic`.
        #[derive(Debug)]
        pub struct $name {
            initial: $value,
            /// Without a destructor, which values in `const` functions must not have; there is nothing to free.
            model: ManuallyDrop<OnceLock<loom::sync::atomic::$name>>,
        }

        impl $name {
            /// An atomic with this value.
            pub const fn new(initial: $value) -> Self {
                Self {
                    initial,
                    model: ManuallyDrop::new(OnceLock::new()),
                }
            }

            fn model(&self) -> &loom::sync::atomic::$name {
                self.model
                    .get_or_init(|| loom::sync::atomic::$name::new(self.initial))
            }

            /// As in `core`.
            #[track_caller]
            pub fn load(&self, order: Ordering) -> $value {
                self.model().load(order)
            }

            /// As in `core`.
            #[track_caller]
            pub fn store(&self, value: $value, order: Ordering) {
                self.model().store(value, order);
            }

            /// As in `core`.
            #[track_caller]
            pub fn swap(&self, value: $value, order: Ordering) -> $value {
                self.model().swap(value, order)
            }

            /// As in `core`.
            ///
            /// # Errors
            /// The current value, if it was a different one.
            #[track_caller]
            pub fn compare_exchange(
                &self,
                current: $value,
                new: $value,
                success: Ordering,
                failure: Ordering,
            ) -> Result<$value, $value> {
                self.model()
                    .compare_exchange(current, new, success, failure)
            }

            /// As in `core`.
            ///
            /// # Errors
            /// The current value, if it was a different one or by spurious failure.
            #[track_caller]
            pub fn compare_exchange_weak(
                &self,
                current: $value,
                new: $value,
                success: Ordering,
                failure: Ordering,
            ) -> Result<$value, $value> {
                self.model()
                    .compare_exchange_weak(current, new, success, failure)
            }
        }
    };
}

/// Adds the operations of numbers.
macro_rules! number {
    ($name:ident, $value:ty) => {
        atomic!($name, $value);

        impl $name {
            /// As in `core`.
            #[track_caller]
            pub fn fetch_add(&self, value: $value, order: Ordering) -> $value {
                self.model().fetch_add(value, order)
            }

            /// As in `core`.
            #[track_caller]
            pub fn fetch_sub(&self, value: $value, order: Ordering) -> $value {
                self.model().fetch_sub(value, order)
            }
        }
    };
}

atomic!(AtomicBool, bool);
number!(AtomicU8, u8);
number!(AtomicU16, u16);
number!(AtomicU32, u32);
number!(AtomicU64, u64);
number!(AtomicUsize, usize);

/// Needed to compile the pools of `heapless`. No model uses it, and loom does not observe it.
#[derive(Debug)]
pub struct AtomicU128(Mutex<u128>);

impl AtomicU128 {
    /// An atomic with this value.
    pub const fn new(initial: u128) -> Self {
        Self(Mutex::new(initial))
    }

    /// As in `core`.
    pub fn load(&self, _order: Ordering) -> u128 {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// As in `core`.
    pub fn store(&self, value: u128, _order: Ordering) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = value;
    }

    /// As in `core`.
    ///
    /// # Errors
    /// The current value, if it was a different one.
    pub fn compare_exchange_weak(
        &self,
        current: u128,
        new: u128,
        _success: Ordering,
        _failure: Ordering,
    ) -> Result<u128, u128> {
        let mut place = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if *place == current {
            *place = new;
            Ok(current)
        } else {
            Err(*place)
        }
    }
}
