//! Integration tests of this package: one program, which is linked once.

mod control;
mod freshness;
mod link;
mod motor_test;
mod placing;
mod position_scale;
mod recording;
mod reset;
mod rig;
mod store;
mod store_states;
mod support;
mod upload;
