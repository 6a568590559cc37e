//! Chapter 7 of the thesis (Faas 2010) repeated with a simulated operator: which voxels let a peg into its hole.

pub mod design;
pub mod faas;
pub mod feature_size;
pub mod operator;
pub mod shrink;
pub mod statistics;
