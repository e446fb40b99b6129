//! Schedules: lists of commands for a device, as plain data. A schedule is made once for a spec,
//! the shapes of a graph and a purpose, and run as often as wanted.
//!
//! No command changes from run to run. Positions, weights and a learning rate lie in the arena, so
//! that a device may record a schedule once and replay it. [`Trace`] follows schedules without
//! running them.

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
    /// A null pointer, where the kernel allows one.
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

impl From<u32> for Argument {
    fn from(count: u32) -> Self {
        Self::Count(count)
    }
}

impl From<usize> for Argument {
    /// Every count of a launch is below 2^32: it counts elements of an arena on a device.
    fn from(count: usize) -> Self {
        Self::Count(count as u32)
    }
}

impl From<f32> for Argument {
    fn from(number: f32) -> Self {
        Self::Number(number)
    }
}

/// An argument with the name of its parameter.
pub type NamedArgument = (&'static str, Argument);

/// Arguments of a launch by the names of their parameters, in any order: `args! { x, bias: region
/// }`. Lists that several launches share come first: `args! { ..frames.ring(), steps: 4 }`.
macro_rules! args {
    (.. $first:expr, $(.. $list:expr,)* $($name:ident $(: $value:expr)?),* $(,)?) => {{
        let mut all: Vec<$crate::schedule::NamedArgument> = $first;
        $(all.extend($list);)*
        all.extend($crate::schedule::args! { $($name $(: $value)?),* });
        all
    }};
    ($($name:ident $(: $value:expr)?),* $(,)?) => {
        vec![$((stringify!($name), $crate::schedule::args!(@ $name $($value)?))),*]
    };
    (@ $name:ident) => { $crate::schedule::Argument::from($name) };
    (@ $name:ident $value:expr) => { $crate::schedule::Argument::from($value) };
}
pub(crate) use args;

/// A kernel on a number of elements, rows or blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Launch {
    /// The kernel.
    pub kernel: &'static Kernel,
    /// Elements, rows or blocks, as the kernel's shape says.
    pub count: usize,
    arguments: Vec<NamedArgument>,
}

impl Launch {
    /// A launch with its arguments in any order.
    #[must_use]
    pub fn new(kernel: &'static Kernel, count: usize, mut arguments: Vec<NamedArgument>) -> Self {
        let place = |name: &str| {
            let parameters = kernel.parameters().iter();
            let mut names = parameters.map(|parameter| parameter.name);
            names.position(|known| known == name).unwrap_or(usize::MAX)
        };
        arguments.sort_by_key(|(name, _)| place(name));
        Self {
            kernel,
            count,
            arguments,
        }
    }

    /// The arguments in the order of the kernel's parameters. Arguments without a parameter come
    /// last; no device takes a launch with one.
    #[must_use]
    pub fn arguments(&self) -> &[NamedArgument] {
        &self.arguments
    }
}

/// A matrix in the arena: row `i` begins `i * leading` elements after the region does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix {
    /// The part of an array from its first element to its last or beyond.
    pub region: Region,
    /// Elements from the beginning of one row to that of the next.
    pub leading: usize,
    /// True where the operand of a product is its transpose.
    pub transposed: bool,
}

impl Matrix {
    /// A matrix of rows of `width` elements.
    #[must_use]
    pub fn new(region: Region, width: usize) -> Self {
        Self {
            region,
            leading: width,
            transposed: false,
        }
    }

    /// The columns from number `first` on.
    #[must_use]
    pub fn from_column(self, first: usize) -> Self {
        let region = self.region.part(first..self.region.count());
        Self { region, ..self }
    }

    /// The transpose, as an operand of a product.
    #[must_use]
    pub fn transpose(self) -> Self {
        Self {
            transposed: !self.transposed,
            ..self
        }
    }
}

/// The use of the old values of a product's result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Onto {
    /// They are replaced.
    Set,
    /// The product is added to them.
    Add,
}

/// The last operation on the sums of a product before they are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Epilogue {
    /// Nothing.
    Nothing,
    /// A bias per column is added.
    Bias(Region),
    /// A bias per column is added, then what is negative becomes zero.
    BiasRelu(Region),
}

/// c = a b (or c += a b), with a `[m, k]`, b `[k, n]`, c `[m, n]`; then its epilogue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Product {
    /// The sizes m, n, k.
    pub size: [usize; 3],
    /// The left operand.
    pub a: Matrix,
    /// The right operand.
    pub b: Matrix,
    /// The result, not transposed.
    pub c: Matrix,
    /// The use of the old values of c.
    pub onto: Onto,
    /// The last operation.
    pub epilogue: Epilogue,
}

/// One operation of a device.
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

/// Commands that run one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Schedule {
    /// A name for messages.
    pub name: &'static str,
    /// The commands, in order.
    pub commands: Vec<Command>,
}

impl Schedule {
    /// A schedule without commands.
    #[must_use]
    pub fn new(name: &'static str) -> Self {
        Self {
            name,
            commands: Vec::new(),
        }
    }

    /// Adds a launch of a kernel on `count` elements, rows or blocks. Whether the arguments are
    /// those of the kernel is found when the schedule is prepared or traced.
    pub fn launch(&mut self, kernel: &'static Kernel, count: usize, arguments: Vec<NamedArgument>) {
        self.commands
            .push(Command::Launch(Launch::new(kernel, count, arguments)));
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

    /// The number of commands.
    #[must_use]
    pub fn len(&self) -> usize {
        self.commands.len()
    }

    /// True where there are no commands.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.commands.is_empty()
    }
}
