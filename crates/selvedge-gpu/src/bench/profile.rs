//! The cost of the commands of a schedule: bytes and operations by their arguments, and the time of
//! each command by itself.
//!
//! An array counts once for each command that reads it and once for each that writes it: rows that
//! a kernel gathers twice may lie in a cache. The time is that of a few runs in a row with one
//! wait. A whole schedule takes less than the sum of its commands: there are no waits in between,
//! and a command finds the results of the one before in caches.

use std::time::Instant;

use crate::device::{DeviceError, Loaded};
use crate::kernels::{Kind, Parameter};
use crate::schedule::plan::Region;
use crate::schedule::{
    Argument, Command, Epilogue, Launch, NamedArgument, Onto, Product, Schedule,
};

/// Runs in a row, of which the mean counts: few of a long command, many of a short one, so that the
/// start and the wait, about 10 µs together, do not matter.
const REPEATS: [usize; 2] = [4, 50];

/// The time below which a command is short `[ms]`.
const SHORT: f64 = 0.2;

/// Bytes and operations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Bytes read and written.
    pub bytes: f64,
    /// Operations of products: two for each multiplication with its addition.
    pub flop: f64,
}

/// The cost of all commands of a name together.
#[derive(Clone, Debug, PartialEq)]
pub struct Spent {
    /// A kernel, or a product with its size.
    pub name: String,
    /// The number of commands.
    pub commands: usize,
    /// Time `[ms]`.
    pub elapsed_ms: f64,
    /// Their bytes and operations.
    pub work: Work,
}

impl Work {
    /// The work of one command.
    #[must_use]
    pub fn of(command: &Command) -> Self {
        match command {
            Command::Launch(launch) => Self::of_launch(launch),
            Command::Product(product) => Self::of_product(product),
            Command::Clear(region) => Self::moved(bytes(*region)),
            Command::Copy(from, to) => Self::moved(bytes(*from) + bytes(*to)),
        }
    }

    /// The work of all commands of a schedule.
    #[must_use]
    pub fn of_all(schedule: &Schedule) -> Self {
        let all = schedule.commands.iter().map(Self::of);
        all.fold(Self::default(), Self::with)
    }

    fn with(self, other: Self) -> Self {
        Self {
            bytes: self.bytes + other.bytes,
            flop: self.flop + other.flop,
        }
    }

    fn moved(bytes: f64) -> Self {
        Self { bytes, flop: 0.0 }
    }

    fn of_launch(launch: &Launch) -> Self {
        let pairs = launch.kernel.parameters().iter().zip(launch.arguments());
        let of = |(parameter, (_, argument)): (&Parameter, &NamedArgument)| match (
            parameter.kind,
            argument,
        ) {
            (Kind::Array { access, .. }, Argument::Region(region)) => {
                let times = u8::from(access.reads()) + u8::from(access.writes());
                f64::from(times) * bytes(*region)
            }
            _ => 0.0,
        };
        Self::moved(pairs.map(of).sum())
    }

    /// The work of a product and its epilogue, which reads and writes the result once more.
    fn of_product(product: &Product) -> Self {
        let [m, n, k] = product.size.map(|size| size as f64);
        let mut results = 1.0;
        if product.onto == Onto::Add {
            results += 1.0;
        }
        if let Epilogue::Bias(_) | Epilogue::BiasRelu(_) = product.epilogue {
            results += 2.0;
        }
        Self {
            bytes: 4.0 * (m * k + k * n + results * m * n),
            flop: 2.0 * m * n * k,
        }
    }
}

/// Runs every command of a schedule by itself; the most expensive name comes first. Everything that
/// the schedule reads must have been written. The contents of the arena are lost.
///
/// # Errors
/// When the device fails.
pub fn profile(loaded: &mut dyn Loaded, schedule: &Schedule) -> Result<Vec<Spent>, DeviceError> {
    let mut all: Vec<Spent> = Vec::new();
    for command in &schedule.commands {
        let (name, work) = (name(command), Work::of(command));
        let elapsed_ms = measure(loaded, command)?;
        match all.iter_mut().find(|spent| spent.name == name) {
            Some(spent) => {
                spent.commands += 1;
                spent.elapsed_ms += elapsed_ms;
                spent.work = spent.work.with(work);
            }
            None => all.push(Spent {
                name,
                commands: 1,
                elapsed_ms,
                work,
            }),
        }
    }
    all.sort_by(|a, b| b.elapsed_ms.total_cmp(&a.elapsed_ms));
    Ok(all)
}

/// The time of one run `[ms]`.
fn measure(loaded: &mut dyn Loaded, command: &Command) -> Result<f64, DeviceError> {
    let [few, many] = REPEATS;
    let elapsed_ms = measure_repeated(loaded, command, few)?;
    if elapsed_ms < SHORT {
        return measure_repeated(loaded, command, many);
    }
    Ok(elapsed_ms)
}

fn measure_repeated(
    loaded: &mut dyn Loaded,
    command: &Command,
    repeats: usize,
) -> Result<f64, DeviceError> {
    let mut repeated = Schedule::new("a command by itself");
    repeated.commands = vec![command.clone(); repeats];
    let prepared = loaded.prepare(&repeated)?;
    // A device may record what it runs a second time.
    for _ in 0..2 {
        loaded.run(prepared)?;
    }
    loaded.wait()?;
    let begin = Instant::now();
    loaded.run(prepared)?;
    loaded.wait()?;
    Ok(1e3 * begin.elapsed().as_secs_f64() / repeats as f64)
}

fn name(command: &Command) -> String {
    match command {
        Command::Launch(launch) => launch.kernel.name.to_owned(),
        Command::Product(product) => {
            let [m, n, k] = product.size;
            format!("product {m} × {n} × {k}")
        }
        Command::Clear(_) => "clear".to_owned(),
        Command::Copy(..) => "copy".to_owned(),
    }
}

fn bytes(region: Region) -> f64 {
    (4 * region.count() * region.element().words()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Precision;
    use crate::kernels::layers::{self, ADD_BIAS};
    use crate::kernels::{Program, Sizes};
    use crate::schedule::plan::Plan;
    use crate::schedule::{Matrix, args};
    use crate::test_graphs::device;

    #[test]
    fn every_command_is_counted_once_with_what_it_moves() {
        let mut plan = Plan::new();
        let [a, b, c] =
            [("a", 12), ("b", 8), ("c", 6)].map(|(name, count)| plan.floats(name, count));
        let bias = plan.floats("bias", 2);
        let product = Product {
            size: [3, 2, 4],
            a: Matrix::new(a, 4),
            b: Matrix::new(b, 4).transpose(),
            c: Matrix::new(c, 2),
            onto: Onto::Set,
            epilogue: Epilogue::Nothing,
        };
        let mut schedule = Schedule::new("test");
        for region in [a, b, c, bias] {
            schedule.clear(region);
        }
        schedule.product(product);
        schedule.product(Product {
            onto: Onto::Add,
            ..product
        });
        let arguments = args! { rows: c, leading: 2_usize, bias, width: 2_usize };
        schedule.launch(&ADD_BIAS, 3, arguments);
        // In words: 28 cleared; 12 + 8 read and 6 written, then 6 read too; 6 read and written, 2
        // read.
        let work = Work::of_all(&schedule);
        assert_eq!(work.bytes, 4.0 * f64::from(28 + 26 + 32 + 14));
        assert_eq!(work.flop, f64::from(2 * 2 * 3 * 2 * 4));
        let device = device();
        let mut program = Program::new(Sizes {
            latent: 2,
            node_width: 1,
            edge_width: 1,
        });
        program.add(&layers::PART);
        let mut loaded = device.load(&program, &plan, Precision::Full).expect("room");
        let mut found = profile(&mut *loaded, &schedule).expect("runs");
        let order: Vec<f64> = found.iter().map(|spent| spent.elapsed_ms).collect();
        assert!(order.is_sorted_by(|a, b| a >= b), "{order:?}");
        found.sort_by(|a, b| a.name.cmp(&b.name));
        let rows = found.iter().map(|s| (s.name.as_str(), s.commands, s.work));
        let of = |bytes: u32, flop: u32| Work {
            bytes: f64::from(bytes),
            flop: f64::from(flop),
        };
        let expected = [
            (ADD_BIAS.name, 1, of(56, 0)),
            ("clear", 4, of(112, 0)),
            ("product 3 × 2 × 4", 2, of(232, 96)),
        ];
        assert_eq!(rows.collect::<Vec<_>>(), expected);
    }
}
