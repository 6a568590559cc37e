//! Integration tests of this package: one program, which is linked once.

mod cell_rules;
mod classic;
mod common;
mod contact_sampling;
mod convex_probe;
mod crossing_bars;
mod damage;
mod distance;
mod edges;
mod far_origins;
mod field;
mod finer;
mod free_form;
mod occupancy;
mod planner;
mod pointshell;
mod proven_probe;
mod rounds;
mod samples;
mod scene;
mod shared_parts;
