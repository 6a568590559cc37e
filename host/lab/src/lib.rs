//! Experiments, figures and charts
