//! Schedules followed without running them, to find faults that a GPU would not report: arguments
//! that are not those of a kernel, a region that ends before a kernel does, a value that is read
//! before it is written, an array that was overwritten by another.

use std::collections::BTreeMap;

use thiserror::Error;

use super::{Argument, Command, Epilogue, Launch, Matrix, Onto, Product, Schedule};
use crate::kernels::{Access, BLOCK_THREADS, Extent, Kind, Parameter, Shape, Sizes, WARP};
use crate::schedule::plan::{Element, Plan, Region};

/// A schedule that would do wrong on a device.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("schedule {schedule}, command {number} ({command}): {what}")]
pub struct ScheduleError {
    /// The name of the schedule.
    pub schedule: &'static str,
    /// The number of the command.
    pub number: usize,
    /// The command in short.
    pub command: String,
    /// The fault.
    pub what: String,
}

/// An arena whose contents are known by name, while schedules are followed without running them.
pub struct Trace<'a> {
    plan: &'a Plan,
    sizes: Sizes,
    /// The writer of the words from each key on: where its words end, and the number of its array.
    owners: BTreeMap<usize, (usize, usize)>,
    values: Values,
}

/// The knowledge that a trace has of the values in an arena.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Values {
    Followed,
    Unknown,
}

/// The fault of a command, in words.
struct Fault(String);

/// The size of a matrix as it lies in the arena.
#[derive(Clone, Copy)]
struct Size {
    rows: usize,
    columns: usize,
}

impl<'a> Trace<'a> {
    /// An arena in which nothing is written; `sizes` are those of the program.
    #[must_use]
    pub fn new(plan: &'a Plan, sizes: Sizes) -> Self {
        Self {
            plan,
            sizes,
            owners: BTreeMap::new(),
            values: Values::Followed,
        }
    }

    /// Checks the arguments and sizes of a schedule, whatever the values in the arena are.
    ///
    /// # Errors
    /// The first command whose arguments are not those of its kernel, or whose regions are too
    /// short.
    pub fn fits(plan: &'a Plan, sizes: Sizes, schedule: &Schedule) -> Result<(), ScheduleError> {
        let mut trace = Self::new(plan, sizes);
        trace.values = Values::Unknown;
        trace.follow(schedule)
    }

    /// Notes that a region is written from outside.
    pub fn give(&mut self, region: Region) {
        if self.values == Values::Unknown {
            return;
        }
        let place = self.plan.place(region);
        self.write(place.start, place.end, Plan::number_of(region));
    }

    /// True where all of a region has been written, and by no other array since.
    #[must_use]
    pub fn holds(&self, region: Region) -> bool {
        let place = self.plan.place(region);
        self.covers(place.start, place.end, Plan::number_of(region))
    }

    /// Follows a schedule.
    ///
    /// # Errors
    /// The first command that reads what was not written or was overwritten, whose arguments are
    /// not those of its kernel, or whose regions are too short.
    pub fn follow(&mut self, schedule: &Schedule) -> Result<(), ScheduleError> {
        for (number, command) in schedule.commands.iter().enumerate() {
            self.command(command).map_err(|Fault(what)| ScheduleError {
                schedule: schedule.name,
                number,
                command: describe(command),
                what,
            })?;
        }
        Ok(())
    }

    fn command(&mut self, command: &Command) -> Result<(), Fault> {
        match command {
            Command::Launch(launch) => self.launch(launch),
            Command::Product(product) => self.product(product),
            Command::Clear(region) => {
                self.expect(*region, Element::Float)?;
                self.give(*region);
                Ok(())
            }
            Command::Copy(from, to) => {
                let bytes = |region: &Region| region.count() * region.element().words();
                if bytes(from) != bytes(to) {
                    return Err(Fault(format!("{} words to {}", bytes(from), bytes(to))));
                }
                self.read(*from)?;
                self.give(*to);
                Ok(())
            }
        }
    }

    fn launch(&mut self, launch: &Launch) -> Result<(), Fault> {
        check_names(launch)?;
        // Kernels count their threads with 32 bits.
        let threads = match launch.kernel.shape {
            Shape::Element => launch.count,
            Shape::Row => launch.count * WARP as usize,
        };
        if threads > (u32::MAX - BLOCK_THREADS) as usize {
            return Err(Fault(format!(
                "{} are too many for one launch",
                launch.count
            )));
        }
        let (mut read, mut written) = (Vec::new(), Vec::new());
        let parameters = launch.kernel.parameters().iter();
        for (parameter, (_, argument)) in parameters.zip(launch.arguments()) {
            let Some((region, access)) = self.array(launch, parameter, argument)? else {
                continue;
            };
            if access.reads() {
                self.read(region)?;
            }
            if access.writes() {
                written.push(region);
            } else {
                read.push(region);
            }
        }
        self.check_overlaps(&read, &written)?;
        written.into_iter().for_each(|region| self.give(region));
        Ok(())
    }

    /// The region of an argument and the use that is made of it, if it is of the type and the size
    /// of its parameter; none for a value.
    fn array(
        &self,
        launch: &Launch,
        parameter: &Parameter,
        argument: &Argument,
    ) -> Result<Option<(Region, Access)>, Fault> {
        let wrong = |what: String| Err(Fault(format!("{}: {what}", parameter.name)));
        let (region, access, extent) = match (parameter.kind, argument) {
            (Kind::Count, Argument::Count(_))
            | (Kind::Number, Argument::Number(_))
            | (Kind::Array { optional: true, .. }, Argument::Nothing) => return Ok(None),
            (
                Kind::Array {
                    element,
                    access,
                    extent,
                    ..
                },
                Argument::Region(region),
            ) if element == region.element() => (*region, access, extent),
            (kind, argument) => return wrong(format!("{argument:?} for {kind:?}")),
        };
        let count = |name: &str| {
            let found = launch.arguments().iter().find(|(known, _)| *known == name);
            match found {
                Some((_, Argument::Count(count))) => Some(*count as usize),
                _ => None,
            }
        };
        let (width, times) = match extent {
            Extent::PerCount(width) => (width, launch.count),
            Extent::Fixed(width) => (width, 1),
            Extent::Any => return Ok(Some((region, access))),
        };
        match width.of(self.sizes, count).map(|width| width * times) {
            Some(expected) if expected == region.count() => Ok(Some((region, access))),
            Some(expected) => wrong(format!("{} elements, expected {expected}", region.count())),
            None => wrong("a count of its size is missing".to_owned()),
        }
    }

    /// Checks that no array is written in two ways, or written while another one is read in its
    /// place; the very same region may be read and written.
    fn check_overlaps(&self, read: &[Region], written: &[Region]) -> Result<(), Fault> {
        for (number, &region) in written.iter().enumerate() {
            let place = self.plan.place(region);
            let overlaps = |other: &Region| {
                let other = self.plan.place(*other);
                place.start < other.end && other.start < place.end
            };
            let same = |other: &Region| self.plan.place(*other) == place;
            if written[number + 1..].iter().any(overlaps)
                || read.iter().any(|other| !same(other) && overlaps(other))
            {
                return Err(Fault(format!(
                    "{} overlaps another argument",
                    self.name(region)
                )));
            }
        }
        Ok(())
    }

    fn product(&mut self, product: &Product) -> Result<(), Fault> {
        let [m, n, k] = product.size;
        let transposed = |matrix: Matrix, rows, columns| {
            if matrix.transposed {
                Size {
                    rows: columns,
                    columns: rows,
                }
            } else {
                Size { rows, columns }
            }
        };
        let of_c = Size {
            rows: m,
            columns: n,
        };
        self.rows(product.a, transposed(product.a, m, k), Self::read)?;
        self.rows(product.b, transposed(product.b, k, n), Self::read)?;
        if product.c.transposed {
            return Err(Fault("a transposed result".to_owned()));
        }
        if product.onto == Onto::Add {
            self.rows(product.c, of_c, Self::read)?;
        }
        if let Epilogue::Bias(bias) | Epilogue::BiasRelu(bias) = product.epilogue {
            if bias.count() != n {
                return Err(Fault(format!("a bias of {}, expected {n}", bias.count())));
            }
            self.read(bias)?;
        }
        self.rows(product.c, of_c, |trace, region| {
            trace.give(region);
            Ok(())
        })
    }

    /// Calls `each` for every row of a matrix, or once for all rows where they lie side by side.
    fn rows(
        &mut self,
        matrix: Matrix,
        size: Size,
        mut each: impl FnMut(&mut Self, Region) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        self.expect(matrix.region, Element::Float)?;
        let Size { rows, columns } = size;
        let (leading, count) = (matrix.leading, matrix.region.count());
        let needed = rows.saturating_sub(1) * leading + columns;
        if columns > leading || needed > count {
            return Err(Fault(format!(
                "a matrix of {rows} by {columns}, {leading} apart, in {count} elements"
            )));
        }
        if leading == columns {
            return each(self, matrix.region.part(0..rows * columns));
        }
        (0..rows).try_for_each(|row| {
            let first = row * leading;
            each(self, matrix.region.part(first..first + columns))
        })
    }

    fn expect(&self, region: Region, element: Element) -> Result<(), Fault> {
        if region.element() == element {
            Ok(())
        } else {
            Err(Fault(format!(
                "{} is not of {element:?}",
                self.name(region)
            )))
        }
    }

    fn read(&mut self, region: Region) -> Result<(), Fault> {
        if self.values == Values::Unknown || self.holds(region) {
            Ok(())
        } else {
            Err(Fault(format!(
                "reads {}, which was not written, or was overwritten",
                self.name(region)
            )))
        }
    }

    fn name(&self, region: Region) -> &str {
        &self.plan.array_of(region).name
    }

    fn write(&mut self, start: usize, end: usize, array: usize) {
        if start == end {
            return;
        }
        let overlapping: Vec<_> = self
            .owners
            .range(..end)
            .rev()
            .take_while(|(_, (stop, _))| *stop > start)
            .map(|(&first, &(stop, owner))| (first, stop, owner))
            .collect();
        for (first, stop, owner) in overlapping {
            self.owners.remove(&first);
            if first < start {
                self.owners.insert(first, (start, owner));
            }
            if stop > end {
                self.owners.insert(end, (stop, owner));
            }
        }
        let (mut start, mut end) = (start, end);
        if let Some((&first, &(stop, owner))) = self.owners.range(..start).next_back()
            && stop == start
            && owner == array
        {
            self.owners.remove(&first);
            start = first;
        }
        if let Some(&(stop, owner)) = self.owners.get(&end)
            && owner == array
        {
            self.owners.remove(&end);
            end = stop;
        }
        self.owners.insert(start, (end, array));
    }

    fn covers(&self, start: usize, end: usize, array: usize) -> bool {
        if start == end {
            return true;
        }
        let found = self.owners.range(..=start).next_back();
        found.is_some_and(|(_, &(stop, owner))| stop >= end && owner == array)
    }
}

/// Checks that a launch has one argument for each parameter of its kernel, and no other.
fn check_names(launch: &Launch) -> Result<(), Fault> {
    let expected = launch.kernel.parameters();
    let arguments = launch.arguments();
    for Parameter { name, .. } in expected {
        let given = arguments.iter().filter(|(found, _)| found == name).count();
        match given {
            0 => return Err(Fault(format!("there is no argument {name}"))),
            1 => {}
            _ => return Err(Fault(format!("there are {given} arguments {name}"))),
        }
    }
    match arguments.get(expected.len()) {
        Some((name, _)) => Err(Fault(format!("it has no parameter {name}"))),
        None => Ok(()),
    }
}

fn describe(command: &Command) -> String {
    match command {
        Command::Launch(launch) => format!("{} of {}", launch.kernel.name, launch.count),
        Command::Product(product) => {
            let [m, n, k] = product.size;
            format!("product {m} by {n} by {k}")
        }
        Command::Clear(_) => "clear".to_owned(),
        Command::Copy(..) => "copy".to_owned(),
    }
}

#[cfg(test)]
mod tests;
