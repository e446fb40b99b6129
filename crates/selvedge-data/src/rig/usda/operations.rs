//! From the `xformOp:` attributes of a prim and their order to operations.

use glam::{DMat4, DQuat, DVec3};

use super::super::node::{Change, Operation};
use super::super::track::{Joined, Track, Value};

/// Entry of an order: the parents of the prim do not move it.
pub(super) const RESET: &str = "!resetXformStack!";
/// Prefix of an entry of an order: the operation is undone.
const INVERSE: &str = "!invert!";

/// An attribute of a prim.
#[derive(Clone)]
pub(super) struct Attribute {
    /// Name without `.timeSamples`.
    pub(super) name: String,
    /// False for a constant.
    pub(super) is_timed: bool,
    /// Time codes and the numbers there; of a constant one, at 0.
    pub(super) samples: Samples,
    /// Line of the attribute; 0 where the file has no lines.
    pub(super) line: usize,
}

/// Numbers by time codes.
pub(super) type Samples = Vec<(f64, Vec<f64>)>;

/// The attribute of this name. Samples count where there is a constant too.
pub(super) fn named<'a>(attributes: &'a [Attribute], name: &str) -> Option<&'a Attribute> {
    let named = || attributes.iter().filter(|attribute| attribute.name == name);
    let timed = named().find(|attribute| attribute.is_timed);
    timed.or_else(|| named().next())
}

/// The operations of a prim from the outermost to the innermost.
pub(super) fn operations_of(
    attributes: &[Attribute],
    order: Option<&[String]>,
    rate: f64,
) -> Result<Vec<Operation>, String> {
    let mut operations = Vec::new();
    for entry in order.unwrap_or_default() {
        if entry == RESET {
            operations.clear();
            continue;
        }
        let undone = entry.strip_prefix(INVERSE);
        let (name, is_inverse) = (undone.unwrap_or(entry), undone.is_some());
        let attribute = named(attributes, name)
            .ok_or_else(|| format!("its xformOpOrder names {name:?}, which it does not have"))?;
        let change = change(attribute, rate).map_err(|problem| match attribute.line {
            0 => format!("{name} {problem}"),
            line => format!("{name} (line {line}) {problem}"),
        })?;
        operations.push(Operation { change, is_inverse });
    }
    Ok(operations)
}

fn change(attribute: &Attribute, rate: f64) -> Result<Change, String> {
    // xformOp:KIND or xformOp:KIND:NAME.
    let kind = attribute.name.split(':').nth(1).unwrap_or_default();
    let samples = &attribute.samples;
    let axes = kind.strip_prefix("rotate").unwrap_or_default().chars();
    let axes: Option<Vec<usize>> = axes.map(|axis| "XYZ".find(axis)).collect();
    let real_first = |q: &[f64]| DQuat::from_xyzw(q[1], q[2], q[3], q[0]);
    match (kind, axes.as_deref()) {
        ("translate", _) => track(samples, rate, 3, DVec3::from_slice).map(Change::Translation),
        ("scale", _) => track(samples, rate, 3, DVec3::from_slice).map(Change::Scale),
        ("orient", _) => track(samples, rate, 4, real_first).map(Change::Turn),
        ("transform", _) => track(samples, rate, 16, DMat4::from_cols_slice).map(Change::Matrix),
        (_, Some(&[axis])) => {
            let angle = |numbers: &[f64]| numbers[0] * DVec3::AXES[axis];
            Ok(Change::Angles(track(samples, rate, 1, angle)?, vec![axis]))
        }
        (_, Some(&[a, b, c])) if a != b && b != c && c != a => {
            let angles = track(samples, rate, 3, DVec3::from_slice)?;
            Ok(Change::Angles(angles, vec![a, b, c]))
        }
        _ => Err("is an operation that is not understood here".to_owned()),
    }
}

/// Values of `width` numbers over time; a time code is 1/`rate` s.
fn track<T: Value>(
    samples: &[(f64, Vec<f64>)],
    rate: f64,
    width: usize,
    value: impl Fn(&[f64]) -> T,
) -> Result<Track<T>, String> {
    let read = |numbers: &Vec<f64>| match numbers.len() {
        found if found == width => Ok(value(numbers)),
        found => Err(format!("has a value of {found} numbers, expected {width}")),
    };
    let times = samples.iter().map(|sample| sample.0 / rate).collect();
    let values: Result<Vec<T>, String> = samples.iter().map(|sample| read(&sample.1)).collect();
    Track::new(times, values?, Joined::Linearly).map_err(str::to_owned)
}
