//! Plots of numbers as SVG: lines over an axis, in the manner of figure 3 of Libao et al. 2023, drawn
//! by `plotters` without a font: the reader's browser has one.
//!
//! Names are in the colours of their lines; the same names in the same order have the same colours. A chart is a pure function of its
//! values: same values, same bytes.

mod lines;
mod ticks;

pub use lines::{Axis, Line, LineChart, Role, Scale};

use thiserror::Error;

/// The reason why there is no plot.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum PlotError {
    #[error("plot {0:?} has nothing to show")]
    Empty(String),
    #[error("plot {0}")]
    Invalid(String),
}

#[cfg(test)]
mod tests;
