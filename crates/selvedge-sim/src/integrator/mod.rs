//! Formulas of a substep: backward Euler ([`System::advance`](crate::solver::System::advance)), and
//! the [`second_order`] with its coefficients ([`two_step`]) and the [`history`] that it needs.

mod edge_projection;
mod history;
mod second_order;
mod tape;
mod two_step;

pub(crate) use history::History;
pub use history::SubstepCounts;
pub(crate) use second_order::SecondOrder;
pub(crate) use second_order::backward::{Pulled, pull_euler};
pub(crate) use tape::{Changes, SolveTape, SubstepTape, Tape};

#[cfg(test)]
mod tests;
