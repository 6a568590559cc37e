//! Integration tests of this package: one program, which is linked once.

mod any_input;
mod contact_exclusion;
mod determinism;
mod explicit;
mod friction;
mod geometric_energy;
mod geometric_energy_bound;
mod guidance;
mod guided_energy;
mod insertion;
mod law;
mod many_contacts;
mod occupancy;
mod passivity;
mod path;
mod pressing;
mod probe;
mod support;
mod switching;
mod touching;
#[path = "support/trial.rs"]
mod trial;
#[path = "support/well.rs"]
mod well;
mod work;
