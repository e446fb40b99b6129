//! The device of a model's arithmetic.

use std::str::FromStr;

use clap::Args;
use selvedge::machine::{DeviceName, Machine};

use crate::ranks;

/// A device.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct DeviceArgs {
    /// The device of the model: cpu, or a GPU as gpu or gpu:N (the N-th, counted from 0). Several
    /// ranks on a machine take that one and those after it.
    #[arg(long, value_name = "DEVICE", default_value = "cpu", value_parser = DeviceName::from_str)]
    pub(crate) device: DeviceName,
}

impl DeviceArgs {
    /// Opens the machine that is asked for.
    pub(crate) fn open(&self) -> anyhow::Result<Machine> {
        Ok(Machine::open(self.of_rank()?)?)
    }

    /// Of several ranks on a machine each has a GPU of its own.
    fn of_rank(&self) -> anyhow::Result<DeviceName> {
        let ranks = ranks::all();
        if ranks.are_several() {
            Ok(self.device.of_rank(ranks.local_rank())?)
        } else {
            Ok(self.device)
        }
    }
}
