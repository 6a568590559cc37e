//! Scenarios as data, run against every rig
