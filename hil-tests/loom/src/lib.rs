//! Models of the planes for the loom model checker; they are the tests of this package.
