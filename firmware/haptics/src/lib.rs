//! The force law: a pure function of state, scene, settings and inputs
