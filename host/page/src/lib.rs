//! Report of the steps in which an assembly goes together, as one HTML page that needs no other file.
//!
//! 1. [`picture`]: parts drawn by a depth buffer, without a graphics card.
//! 2. [`pictures()`]: one of each step, for the page and for other lists of the steps.
//! 3. [`page()`]: the order with a picture of each step, clearances, and what does not come apart.

mod page;
mod picture;

pub use page::{escaped, page, pictures};
pub use picture::{Drawn, Picture, picture};
