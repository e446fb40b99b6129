//! Schedules followed without running them: finds what a GPU would not say. A region that ends before a
//! kernel does, a value that is read before it is written, an array that was overwritten by another.

use std::collections::BTreeMap;

use thiserror::Error;

use super::{Argument, Command, Finish, Launch, Matrix, Onto, Product, Schedule};
use crate::kernels::{Access, BLOCK_THREADS, Extent, Shape, Sizes, WARP};
use crate::schedule::plan::{Element, Plan, Region};

/// A schedule that would do wrong on a device.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("schedule {schedule}, command {number} ({command}): {what}")]
pub struct ScheduleError {
    /// Its name.
    pub schedule: &'static str,
    /// Which of its commands.
    pub number: usize,
    /// What the command is.
    pub command: String,
    /// What is wrong with it.
    pub what: String,
}

/// What lies in the arena while schedules are followed without running them.
pub struct Trace<'a> {
    plan: &'a Plan,
    sizes: Sizes,
    /// Words from each key up to the value's first part were last written as part of the array of the
    /// value's second part.
    owners: BTreeMap<usize, (usize, usize)>,
    values: Values,
}

/// What a trace knows of the values in an arena.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Values {
    Followed,
    Unknown,
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

    /// Checks arguments and sizes of a schedule, whatever lies in the arena.
    ///
    /// # Errors
    /// The first command whose arguments are not those of its kernel, or whose regions are too short.
    pub fn fits(plan: &'a Plan, sizes: Sizes, schedule: &Schedule) -> Result<(), ScheduleError> {
        let mut trace = Self::new(plan, sizes);
        trace.values = Values::Unknown;
        trace.follow(schedule)
    }

    /// Something is written from outside.
    pub fn give(&mut self, region: Region) {
        if self.values == Values::Unknown {
            return;
        }
        let place = self.plan.place(region);
        self.write(place.start, place.end, Plan::number_of(region));
    }

    /// Whether all of a region has been written, and by no other array since.
    #[must_use]
    pub fn holds(&self, region: Region) -> bool {
        let place = self.plan.place(region);
        self.covers(place.start, place.end, Plan::number_of(region))
    }

    /// Follows a schedule.
    ///
    /// # Errors
    /// The first command that reads what was not written or was overwritten, whose arguments are not
    /// those of its kernel, or whose regions are too short.
    pub fn follow(&mut self, schedule: &Schedule) -> Result<(), ScheduleError> {
        for (number, command) in schedule.commands.iter().enumerate() {
            self.command(command).map_err(|what| ScheduleError {
                schedule: schedule.name,
                number,
                command: describe(command),
                what,
            })?;
        }
        Ok(())
    }

    fn command(&mut self, command: &Command) -> Result<(), String> {
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
                    return Err(format!("{} words to {}", bytes(from), bytes(to)));
                }
                self.read(*from)?;
                self.give(*to);
                Ok(())
            }
        }
    }

    fn launch(&mut self, launch: &Launch) -> Result<(), String> {
        let (kernel, found) = (launch.kernel, launch.arguments.len());
        if kernel.parameters.len() != found {
            let expected = kernel.parameters.len();
            return Err(format!("{found} arguments, expected {expected}"));
        }
        // Kernels count their threads with 32 bits.
        let threads = match kernel.shape {
            Shape::Element | Shape::Block => launch.count,
            Shape::Row => launch.count * WARP as usize,
        };
        if threads > (u32::MAX - BLOCK_THREADS) as usize {
            return Err(format!("{} are too many for one launch", launch.count));
        }
        let (mut read, mut written) = (Vec::new(), Vec::new());
        for (parameter, argument) in kernel.parameters.iter().zip(&launch.arguments) {
            let wrong = |what: String| Err(format!("{}: {what}", parameter.name));
            let region = match (parameter.access, argument) {
                (Access::Count, Argument::Count(_)) | (Access::Number, Argument::Number(_)) => {
                    continue;
                }
                (access, Argument::Nothing) if access.may_be_nothing() => continue,
                (access, Argument::Region(region))
                    if access.element() == Some(region.element()) =>
                {
                    *region
                }
                (access, argument) => return wrong(format!("{argument:?} for {access:?}")),
            };
            let expected = match parameter.extent {
                Extent::PerCount(width) => Some(launch.count * width.of(self.sizes)),
                Extent::Fixed(width) => Some(width.of(self.sizes)),
                Extent::Any => None,
            };
            if let Some(expected) = expected.filter(|&expected| expected != region.count()) {
                return wrong(format!("{} elements, expected {expected}", region.count()));
            }
            if parameter.access.reads() {
                self.read(region)?;
            }
            if parameter.access.writes() {
                written.push(region);
            } else {
                read.push(region);
            }
        }
        for (number, &region) in written.iter().enumerate() {
            let others = written[number + 1..].iter().map(|&other| (other, false));
            let overlaps = |(other, may_be_same): (Region, bool)| {
                let [a, b] = [region, other].map(|r| self.plan.place(r));
                let same = may_be_same && a == b;
                !same && a.start < b.end && b.start < a.end
            };
            if others
                .chain(read.iter().map(|&other| (other, true)))
                .any(overlaps)
            {
                return Err(format!("{} overlaps another argument", self.name(region)));
            }
        }
        written.into_iter().for_each(|region| self.give(region));
        Ok(())
    }

    fn product(&mut self, product: &Product) -> Result<(), String> {
        let [m, n, k] = product.size;
        let transposed = |matrix: Matrix, rows, columns| {
            if matrix.transposed {
                [columns, rows]
            } else {
                [rows, columns]
            }
        };
        self.rows(product.a, transposed(product.a, m, k), Self::read)?;
        self.rows(product.b, transposed(product.b, k, n), Self::read)?;
        if product.c.transposed {
            return Err("a transposed result".to_owned());
        }
        if product.onto == Onto::Add {
            self.rows(product.c, [m, n], Self::read)?;
        }
        if let Finish::Bias(bias) | Finish::BiasRelu(bias) = product.finish {
            if bias.count() != n {
                return Err(format!("a bias of {}, expected {n}", bias.count()));
            }
            self.read(bias)?;
        }
        self.rows(product.c, [m, n], |trace, region| {
            trace.give(region);
            Ok(())
        })
    }

    /// Does something with every row of a matrix, or with all at once where they lie side by side.
    fn rows(
        &mut self,
        matrix: Matrix,
        [rows, columns]: [usize; 2],
        mut each: impl FnMut(&mut Self, Region) -> Result<(), String>,
    ) -> Result<(), String> {
        self.expect(matrix.region, Element::Float)?;
        let (leading, count) = (matrix.leading, matrix.region.count());
        let needed = rows.saturating_sub(1) * leading + columns;
        if columns > leading || needed > count {
            return Err(format!(
                "a matrix of {rows} by {columns}, {leading} apart, in {count} elements"
            ));
        }
        if leading == columns {
            return each(self, matrix.region.part(0..rows * columns));
        }
        (0..rows).try_for_each(|row| {
            let first = row * leading;
            each(self, matrix.region.part(first..first + columns))
        })
    }

    fn expect(&self, region: Region, element: Element) -> Result<(), String> {
        if region.element() == element {
            Ok(())
        } else {
            Err(format!("{} is not of {element:?}", self.name(region)))
        }
    }

    fn read(&mut self, region: Region) -> Result<(), String> {
        if self.values == Values::Unknown || self.holds(region) {
            Ok(())
        } else {
            Err(format!(
                "reads {}, which was not written, or was overwritten",
                self.name(region)
            ))
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
