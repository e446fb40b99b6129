//! The optimiser on the device: the arrays of Adam and the schedule of its step.

use selvedge_train::AdamRates;

use crate::device::{DeviceError, Loaded};
use crate::kernels::adam::{ADAM, GRADIENT_NORM, GRADIENT_SQUARES, RUNNING_MEAN, SQUARES_PER_ROW};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Schedule, args};

/// Numbers of [`AdamRates`].
const RATES: usize = 7;

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
    /// Room for the moments of `parameters` weights.
    pub fn new(plan: &mut Plan, parameters: usize) -> Self {
        Self {
            first: plan.floats("first moments", parameters),
            second: plan.floats("second moments", parameters),
            averaged: None,
            norm: plan.doubles("norm of the gradient", 2),
            limit: plan.doubles("largest norm", 1),
            rates: plan.floats("rates", RATES),
            part: plan.floats("part of the mean", 1),
        }
    }

    /// The same with room for the running mean of the weights.
    #[must_use]
    pub fn with_mean(self, plan: &mut Plan) -> Self {
        Self {
            averaged: Some(plan.floats("mean weights", self.first.count())),
            ..self
        }
    }

    /// The arrays that are written from outside before the first step.
    #[must_use]
    pub fn regions(&self) -> Vec<Region> {
        let mut regions = vec![self.first, self.second];
        regions.extend([self.limit, self.rates, self.part]);
        regions.extend(self.averaged);
        regions
    }

    /// Writes the constants of a step: the largest norm, the rates, and the part of the way to the
    /// weights that their mean goes.
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
        weights: Region,
        gradient: Region,
    ) {
        let parameters = weights.count();
        let parts = parameters.div_ceil(SQUARES_PER_ROW);
        let mark = plan.mark();
        let squares = plan.doubles("squares of the gradient", parts);
        let arguments = args! { gradient, parameters, squares };
        schedule.launch(&GRADIENT_SQUARES, parts, arguments);
        let norm = self.norm;
        let arguments = args! { squares, parts, limit: self.limit, norm };
        schedule.launch(&GRADIENT_NORM, 1, arguments);
        let arguments = args! {
            weights,
            first: self.first,
            second: self.second,
            gradient,
            norm,
            rates: self.rates,
        };
        schedule.launch(&ADAM, parameters, arguments);
        if let Some(mean) = self.averaged {
            let arguments = args! { mean, weights, norm, part: self.part };
            schedule.launch(&RUNNING_MEAN, parameters, arguments);
        }
        plan.release(mark);
    }
}
