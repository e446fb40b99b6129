//! Numbers of the laws of contact: f64, or with a derivative.

use selvedge_cloth::geometry::exp;
use selvedge_contact::number::{Dual, Number};

/// A number, whose comparisons choose one branch.
pub(super) trait Real: Number<Mask = bool> {
    /// e to the power of this.
    fn exp(self) -> Self;
}

impl Real for f64 {
    #[inline]
    fn exp(self) -> Self {
        exp(self)
    }
}

impl<const K: usize> Real for Dual<K> {
    #[inline]
    fn exp(self) -> Self {
        let value = exp(self.value);
        self.scaled(value, value)
    }
}
