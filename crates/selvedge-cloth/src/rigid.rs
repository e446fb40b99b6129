//! Rigid motions: of bodies that are led, and of a cloth that is set elsewhere.

use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

use serde::{Deserialize, Serialize};

use crate::HandleError;

/// The rigid motion x → `turn` x + `by`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rigid {
    /// Rotation about the origin, of length 1.
    pub turn: DQuat,
    /// Translation after it `[m]`.
    pub by: DVec3,
}

impl Rigid {
    /// The motion that turns about `pivot` `[m]` and then goes `by` `[m]`.
    pub fn about(pivot: DVec3, turn: DQuat, by: DVec3) -> Self {
        let by = pivot - turn * pivot + by;
        Self { turn, by }
    }

    /// Where a point `[m]` goes.
    pub fn of(&self, point: DVec3) -> DVec3 {
        self.turn * point + self.by
    }

    /// This motion after another one.
    pub fn after(&self, first: &Self) -> Self {
        Self {
            turn: (self.turn * first.turn).normalize(),
            by: self.of(first.by),
        }
    }
}

/// What a body receives: momentum, and angular momentum about the origin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impulse {
    /// `[N s]`
    pub linear: DVec3,
    /// About the origin, not the middle of the body `[N m s]`.
    pub angular: DVec3,
}

impl Impulse {
    /// Nothing.
    pub const ZERO: Self = Self {
        linear: DVec3::ZERO,
        angular: DVec3::ZERO,
    };

    /// The momentum `linear` `[N s]`, received at `place` `[m]`.
    pub fn at(place: DVec3, linear: DVec3) -> Self {
        Self {
            linear,
            angular: place.cross(linear),
        }
    }

    /// The angular momentum about `place` `[m]` `[N m s]`.
    pub fn about(&self, place: DVec3) -> DVec3 {
        self.angular - place.cross(self.linear)
    }
}

impl std::ops::AddAssign for Impulse {
    fn add_assign(&mut self, other: Self) {
        self.linear += other.linear;
        self.angular += other.angular;
    }
}

/// That of a 4×4 matrix, whose 16 numbers come by columns.
impl TryFrom<&[f64]> for Rigid {
    type Error = HandleError;

    fn try_from(columns: &[f64]) -> Result<Self, HandleError> {
        let numbers = <[f64; 16]>::try_from(columns).ok();
        let matrix = numbers.as_ref().map(DMat4::from_cols_array);
        let is_rigid = |matrix: &DMat4| {
            let turn = DMat3::from_mat4(*matrix);
            let apart = turn.transpose() * turn - DMat3::IDENTITY;
            let is_turn = apart.abs_diff_eq(DMat3::ZERO, 1e-4) && turn.determinant() > 0.0;
            is_turn && matrix.row(3).abs_diff_eq(DVec4::W, 1e-6) && matrix.is_finite()
        };
        let Some(matrix) = matrix.filter(is_rigid) else {
            let transposed = numbers.map(|all| DMat4::from_cols_array(&all).transpose());
            let found = match transposed {
                None => format!("found {} numbers", columns.len()),
                Some(other) if is_rigid(&other) => "found its transpose".to_owned(),
                Some(other) => format!("found the rows {:?}", other.to_cols_array_2d()),
            };
            return Err(HandleError::Unusable(format!(
                "no rigid motion: write a 4×4 matrix whose upper left 3×3 numbers rotate without scale, mirror or shear, whose last column is the way in metres and 1, and whose last row is 0 0 0 1; {found}"
            )));
        };
        let turn = DQuat::from_mat4(&matrix).normalize();
        let by = matrix.w_axis.truncate();
        Ok(Self { turn, by })
    }
}

impl From<DVec3> for Rigid {
    fn from(by: DVec3) -> Self {
        let turn = DQuat::IDENTITY;
        Self { turn, by }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_follow_each_other_and_come_as_matrices() {
        let turn = DQuat::from_rotation_y(2.5);
        let to = Rigid::about(DVec3::X, turn, DVec3::new(1.0, 2.0, 3.0));
        assert!(to.of(DVec3::X).distance(DVec3::new(2.0, 2.0, 3.0)) < 1e-15);
        let twice = to.after(&to).of(DVec3::ONE);
        assert!(twice.distance(to.of(to.of(DVec3::ONE))) < 1e-14);
        let columns = DMat4::from_rotation_translation(to.turn, to.by).to_cols_array();
        let read = Rigid::try_from(&columns[..]).unwrap();
        assert!(read.of(DVec3::ONE).distance(to.of(DVec3::ONE)) < 1e-14);
        let refused = |columns: &[f64]| Rigid::try_from(columns).unwrap_err().to_string();
        assert!(refused(&columns[..12]).contains("found 12 numbers"));
        let rows = DMat4::from_cols_array(&columns).transpose();
        assert!(refused(&rows.to_cols_array()).contains("found its transpose"));
        let mut wrong = columns;
        wrong[0] = 2.0;
        assert!(refused(&wrong).contains("without scale"));
        assert!(
            refused(&wrong).contains("found the rows [[2.0, "),
            "{}",
            refused(&wrong)
        );
        wrong = columns;
        wrong[13] = f64::NAN;
        assert!(refused(&wrong).contains("without scale"));
    }
}
