//! Integration tests of this package: one program, which is linked once.

mod common;
mod document;
mod enumerated;
mod garbage;
mod hello;
mod image_damage;
mod image_document;
mod image_energy;
mod image_finer;
mod image_golden;
mod round_trip;
mod scene;
mod schema_hash;
