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
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum PlotError {
    #[error("plot {title:?} has nothing to show")]
    Empty { title: String },
    #[error("plot {title:?}: a value of {name:?} is {value}: values must be finite")]
    NonFinite {
        title: String,
        name: String,
        value: f64,
    },
    #[error("plot {title:?} could not be drawn: {problem}")]
    Drawing { title: String, problem: String },
}

#[cfg(test)]
mod tests;
