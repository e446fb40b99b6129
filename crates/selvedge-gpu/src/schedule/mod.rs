//! What a device does, as a list of commands: plain data, made once for a spec, the shapes of a graph
//! and a purpose, and run as often as wanted.
//!
//! Nothing in a command changes from run to run: what does (positions, weights, a learning rate) lies
//! in the arena. So a device may record a schedule once and replay it. [`Trace`] follows schedules
//! without running them.

pub mod plan;
mod trace;

use crate::kernels::Kernel;
use crate::schedule::plan::Region;

pub use trace::{ScheduleError, Trace};

/// An argument of a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Argument {
    /// Part of an array.
    Region(Region),
    /// A null pointer, where the kernel allows one: what it would write is not wanted.
    Nothing,
    /// A `u32`.
    Count(u32),
    /// An `f32`.
    Number(f32),
}

impl From<Region> for Argument {
    fn from(region: Region) -> Self {
        Self::Region(region)
    }
}

impl From<Option<Region>> for Argument {
    fn from(region: Option<Region>) -> Self {
        region.map_or(Self::Nothing, Self::Region)
    }
}

/// A kernel on so many elements, rows or blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Launch {
    /// Which.
    pub kernel: &'static Kernel,
    /// Elements, rows or blocks, as the kernel's shape says.
    pub count: usize,
    /// In the order of the kernel's parameters.
    pub arguments: Vec<Argument>,
}

/// A matrix in the arena: row `i` begins `i * leading` elements after the region does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix {
    /// From its first element to at least its last.
    pub region: Region,
    /// From the beginning of a row to that of the next.
    pub leading: usize,
    /// Whether the operand of a product is its transpose.
    pub transposed: bool,
}

impl Matrix {
    /// Rows of `width` elements.
    #[must_use]
    pub fn new(region: Region, width: usize) -> Self {
        Self {
            region,
            leading: width,
            transposed: false,
        }
    }

    /// Its columns from number `first` on.
    #[must_use]
    pub fn from_column(self, first: usize) -> Self {
        let region = self.region.part(first..self.region.count());
        Self { region, ..self }
    }

    /// Its transpose, as an operand of a product.
    #[must_use]
    pub fn transpose(self) -> Self {
        Self {
            transposed: !self.transposed,
            ..self
        }
    }
}

/// What a product does to what lies in its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Onto {
    /// It takes its place.
    Set,
    /// It is added.
    Add,
}

/// What happens to the sums of a product before they are left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finish {
    /// Nothing.
    Nothing,
    /// A bias per column is added.
    Bias(Region),
    /// A bias per column is added, then what is negative becomes zero.
    BiasRelu(Region),
}

/// c = a b (or c += a b), with a `[m, k]`, b `[k, n]`, c `[m, n]`; then its finish.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Product {
    /// m, n, k.
    pub size: [usize; 3],
    /// The left operand.
    pub a: Matrix,
    /// The right operand.
    pub b: Matrix,
    /// The result, not transposed.
    pub c: Matrix,
    /// Set or added.
    pub onto: Onto,
    /// What follows.
    pub finish: Finish,
}

/// One thing to do.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Runs a kernel.
    Launch(Launch),
    /// Multiplies matrices.
    Product(Product),
    /// Sets every element of an array of `f32` to zero.
    Clear(Region),
    /// Copies from the first region to the second.
    Copy(Region, Region),
}

/// Commands, done one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Schedule {
    /// What it is, for messages.
    pub name: &'static str,
    /// In order.
    pub commands: Vec<Command>,
}

impl Schedule {
    /// No commands yet.
    #[must_use]
    pub fn new(name: &'static str) -> Self {
        Self {
            name,
            commands: Vec::new(),
        }
    }

    /// Adds a launch of a kernel on `count` elements, rows or blocks.
    pub fn launch(&mut self, kernel: &'static Kernel, count: usize, arguments: &[Argument]) {
        self.commands.push(Command::Launch(Launch {
            kernel,
            count,
            arguments: arguments.to_vec(),
        }));
    }

    /// Adds a product.
    pub fn product(&mut self, product: Product) {
        self.commands.push(Command::Product(product));
    }

    /// Adds the setting of a region to zero.
    pub fn clear(&mut self, region: Region) {
        self.commands.push(Command::Clear(region));
    }

    /// Adds a copy.
    pub fn copy(&mut self, from: Region, to: Region) {
        self.commands.push(Command::Copy(from, to));
    }

    /// Kernels, products, clears and copies in it.
    #[must_use]
    pub fn len(&self) -> usize {
        self.commands.len()
    }

    /// Whether it does nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.commands.is_empty()
    }
}
