//! Where closed loops become unstable, by theory and by experiment.

pub mod bench;
pub mod boundary;
pub mod oracle;
pub mod slab;
