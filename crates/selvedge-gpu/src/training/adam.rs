//! How weights follow their gradient on the device: the table of `kernels/adam.cu`, its arrays and the
//! schedule of a step.

use selvedge_train::AdamRates;

use crate::device::{DeviceError, Loaded};
use crate::kernels::{Access, Kernel, Parameter, Part, Program, Shape, Width};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Argument, Schedule};

use Access::{Count, Doubles, DoublesOut, In, InOut};

/// Numbers of the gradient whose squares a row of the launch sums.
const SQUARES_PER_ROW: usize = 4096;

/// Numbers of [`AdamRates`].
const RATES: usize = 7;

const ONE: Width = Width::Numbers(1);

/// The file and its kernels.
pub static PART: Part = Part {
    name: "adam.cu",
    text: include_str!("../kernels/adam.cu"),
    kernels: &[&GRADIENT_SQUARES, &GRADIENT_NORM, &ADAM, &RUNNING_MEAN],
};

/// Sums of squares of parts of the gradient.
pub static GRADIENT_SQUARES: Kernel = Kernel {
    name: "gradient_squares",
    shape: Shape::Row,
    parameters: &[
        Parameter::any("gradient", In),
        Parameter::any("parameters", Count),
        Parameter::per_count("squares", DoublesOut, ONE),
    ],
};

/// The norm of the gradient, and what it is multiplied by.
pub static GRADIENT_NORM: Kernel = Kernel {
    name: "gradient_norm",
    shape: Shape::Row,
    parameters: &[
        Parameter::any("squares", Doubles),
        Parameter::any("parts", Count),
        Parameter::per_count("limit", Doubles, ONE),
        Parameter::per_count("norm", DoublesOut, Width::Numbers(2)),
    ],
};

/// The step.
pub static ADAM: Kernel = Kernel {
    name: "adam",
    shape: Shape::Element,
    parameters: &[
        Parameter::per_count("weights", InOut, ONE),
        Parameter::per_count("first", InOut, ONE),
        Parameter::per_count("second", InOut, ONE),
        Parameter::per_count("gradient", In, ONE),
        Parameter::fixed("norm", Doubles, Width::Numbers(2)),
        Parameter::fixed("rates", In, Width::Numbers(RATES)),
    ],
};

/// The running mean of the weights.
pub static RUNNING_MEAN: Kernel = Kernel {
    name: "running_mean",
    shape: Shape::Element,
    parameters: &[
        Parameter::per_count("mean", InOut, ONE),
        Parameter::per_count("weights", In, ONE),
        Parameter::fixed("norm", Doubles, Width::Numbers(2)),
        Parameter::fixed("part", In, ONE),
    ],
};

/// Adds the kernels.
pub fn define(program: &mut Program) {
    program.define("SQUARES_PER_ROW", SQUARES_PER_ROW);
    program.define("LARGEST_NORM", "1.7976931348623157e308");
    program.add(&PART);
}

/// The optimiser in the arena.
#[derive(Clone, Copy, Debug)]
pub struct AdamArrays {
    /// m, `[parameters]`.
    pub first: Region,
    /// v, `[parameters]`.
    pub second: Region,
    /// The running mean of the weights, where there is one, `[parameters]`.
    pub averaged: Option<Region>,
    /// The gradient's norm, and what clipping multiplies it by, `[2]`.
    pub norm: Region,
    /// The largest norm, `[1]`.
    limit: Region,
    rates: Region,
    part: Region,
}

impl AdamArrays {
    /// Room for so many parameters, and for their running mean if there is one.
    pub fn new(plan: &mut Plan, parameters: usize, averaged: Option<()>) -> Self {
        Self {
            first: plan.floats("first moments", parameters),
            second: plan.floats("second moments", parameters),
            averaged: averaged.map(|()| plan.floats("mean weights", parameters)),
            norm: plan.doubles("norm of the gradient", 2),
            limit: plan.doubles("largest norm", 1),
            rates: plan.floats("rates", RATES),
            part: plan.floats("part of the mean", 1),
        }
    }

    /// All that is written from outside before the first step.
    #[must_use]
    pub fn regions(&self) -> Vec<Region> {
        let mut regions = vec![self.first, self.second];
        regions.extend([self.limit, self.rates, self.part]);
        regions.extend(self.averaged);
        regions
    }

    /// Writes the constants of a step: the largest norm, Adam's, and the part of the way to the weights
    /// that their mean goes.
    ///
    /// # Errors
    /// When the device fails.
    pub fn upload(
        &self,
        loaded: &mut dyn Loaded,
        limit: f64,
        rates: AdamRates,
        part: f32,
    ) -> Result<(), DeviceError> {
        let rates = [
            rates.keep1,
            rates.take1,
            rates.keep2,
            rates.take2,
            rates.rate,
            rates.root,
            rates.epsilon,
        ];
        loaded.put_doubles(self.limit, &[limit])?;
        loaded.put(self.rates, &rates)?;
        loaded.put(self.part, &[part])
    }

    /// Adds a step of `weights` against `gradient` to a schedule.
    pub fn step(
        &self,
        plan: &mut Plan,
        schedule: &mut Schedule,
        (weights, gradient): (Region, Region),
    ) {
        let parameters = weights.count();
        let rows = parameters.div_ceil(SQUARES_PER_ROW);
        let mark = plan.mark();
        let squares = plan.doubles("squares of the gradient", rows);
        let count = |count: usize| Argument::Count(count as u32);
        let arguments = [gradient.into(), count(parameters), squares.into()];
        schedule.launch(&GRADIENT_SQUARES, rows, &arguments);
        let arguments = [
            squares.into(),
            count(rows),
            self.limit.into(),
            self.norm.into(),
        ];
        schedule.launch(&GRADIENT_NORM, 1, &arguments);
        let arguments = [
            weights.into(),
            self.first.into(),
            self.second.into(),
            gradient.into(),
            self.norm.into(),
            self.rates.into(),
        ];
        schedule.launch(&ADAM, parameters, &arguments);
        if let Some(mean) = self.averaged {
            let arguments = [mean, weights, self.norm, self.part].map(Argument::from);
            schedule.launch(&RUNNING_MEAN, parameters, &arguments);
        }
        plan.release(mark);
    }
}
