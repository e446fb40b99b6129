//! Placement of an Alembic node: `.ops`, `.vals` and `.inherits` of the schema `.xform`.
//!
//! `.ops` has a byte per operation, its kind in the upper four bits, from the outermost operation
//! to the innermost; `.vals` has their numbers one after another. Angles are in degrees; a matrix
//! has its translation in the last row.

use glam::{DMat4, DQuat, DVec3};

use super::super::node::{Change, Operation};
use super::super::track::{Joined, Track};
use super::archive::{AbcFile, AbcObject, AbcProperty, U8};
use super::budget::Budget;
use super::geometry::reals;

/// A placement of a node.
pub(super) struct Placement {
    /// The transform over time; none where there is no operation.
    pub(super) operation: Option<Operation>,
    /// True where the node moves with its parent.
    pub(super) inherits: bool,
}

/// The placement of an object.
pub(super) fn of(
    file: &AbcFile<'_>,
    object: &AbcObject<'_>,
    budget: &Budget,
) -> Result<Placement, String> {
    let nothing = Placement {
        operation: None,
        inherits: true,
    };
    let Some(schema) = object.property(".xform") else {
        return Ok(nothing);
    };
    let schema = file.within(schema)?;
    let find = |name: &str| schema.iter().find(|property| property.name == name);
    let inherits = match find(".inherits") {
        Some(property) => property.sample(0)?.first() != Some(&0),
        None => true,
    };
    let (Some(kinds), Some(values)) = (find(".ops"), find(".vals")) else {
        return Ok(Placement {
            inherits,
            ..nothing
        });
    };
    if kinds.pod != U8 {
        return Err("its .ops are not bytes".to_owned());
    }
    let kinds: Vec<Kind> = kinds
        .sample(0)?
        .iter()
        .map(|code| Kind::of(code >> 4))
        .collect::<Result<_, _>>()?;
    let change = match kinds.as_slice() {
        [] => {
            return Ok(Placement {
                inherits,
                ..nothing
            });
        }
        [Kind::Translate] => {
            Change::Translation(track(file, values, budget, DVec3::from_slice, 3)?)
        }
        kinds => {
            let width = kinds.iter().map(|kind| kind.width()).sum();
            let product = |numbers: &[f64]| product(kinds, numbers);
            Change::Matrix(track(file, values, budget, product, width)?)
        }
    };
    Ok(Placement {
        operation: Some(Operation::new(change)),
        inherits,
    })
}

/// Values of `width` numbers over time.
fn track<T: super::super::track::Value>(
    file: &AbcFile<'_>,
    property: &AbcProperty<'_>,
    budget: &Budget,
    value: impl Fn(&[f64]) -> T,
    width: usize,
) -> Result<Track<T>, String> {
    let (mut times, mut values) = (Vec::new(), Vec::new());
    for key in property.keys()? {
        let numbers = reals(property, key, property.extent.max(1), budget)?;
        if numbers.len() != width {
            return Err(format!(
                "its operations need {width} numbers, and it has {}",
                numbers.len()
            ));
        }
        times.push(file.time(property, key)?);
        values.push(value(&numbers));
    }
    Track::new(times, values, Joined::Linearly)
        .map_err(|problem| format!("the samples of its .vals {problem}"))
}

/// A kind of operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Scale,
    Translate,
    /// About an axis, by an angle.
    Turn,
    Matrix,
    /// About x, y or z.
    TurnAbout(usize),
}

impl Kind {
    fn of(code: u8) -> Result<Self, String> {
        Ok(match code {
            0 => Self::Scale,
            1 => Self::Translate,
            2 => Self::Turn,
            3 => Self::Matrix,
            4..=6 => Self::TurnAbout(usize::from(code) - 4),
            _ => return Err(format!("its operation {code} is not understood here")),
        })
    }

    /// Number of its numbers.
    fn width(self) -> usize {
        match self {
            Self::Scale | Self::Translate => 3,
            Self::Turn => 4,
            Self::Matrix => 16,
            Self::TurnAbout(_) => 1,
        }
    }

    fn matrix(self, numbers: &[f64]) -> DMat4 {
        let turn = |axis: DVec3, degrees: f64| {
            let axis = axis.try_normalize().unwrap_or(DVec3::X);
            DMat4::from_quat(DQuat::from_axis_angle(axis, degrees.to_radians()))
        };
        match self {
            Self::Scale => DMat4::from_scale(DVec3::from_slice(numbers)),
            Self::Translate => DMat4::from_translation(DVec3::from_slice(numbers)),
            Self::Turn => turn(DVec3::from_slice(numbers), numbers[3]),
            Self::Matrix => DMat4::from_cols_slice(numbers),
            Self::TurnAbout(axis) => turn(DVec3::AXES[axis], numbers[0]),
        }
    }
}

fn product(kinds: &[Kind], numbers: &[f64]) -> DMat4 {
    let mut rest = numbers;
    let mut product = DMat4::IDENTITY;
    for kind in kinds {
        let (own, after) = rest.split_at(kind.width());
        product *= kind.matrix(own);
        rest = after;
    }
    product
}
