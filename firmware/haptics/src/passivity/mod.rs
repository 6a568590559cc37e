//! Energy at the handle: passivity observer and energy tank of the coupling, and the bound on the energy that constraint targets deliver to the
//! operator.

pub(crate) mod energy_bound;
mod quantised_work;
pub(crate) mod tank;
