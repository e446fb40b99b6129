//! Fields that are smoothed by the matrix of the last solve, as that smoothed the motion.

use glam::DVec3;

/// Workspaces.
#[derive(Default)]
pub(super) struct Smoothing {
    /// M times the field, `[vertices]`.
    weighted: Vec<DVec3>,
    /// A⁻¹ times that, `[vertices]`.
    smoothed: Vec<DVec3>,
}

impl Smoothing {
    /// Replaces `field`, `[vertices]`, by A⁻¹ M `field` `[eq:smoothed-differences]`.
    ///
    /// M is the `mass` of the vertices `[kg]`. `solve` takes a right side to A⁻¹ times it, which
    /// begins as 0. Returns false, and leaves the field, where that does.
    pub(super) fn smooth(
        &mut self,
        field: &mut [DVec3],
        mass: &[f64],
        solve: impl FnOnce(&[DVec3], &mut [DVec3]) -> bool,
    ) -> bool {
        let Self { weighted, smoothed } = self;
        weighted.clear();
        weighted.extend(field.iter().zip(mass).map(|(value, mass)| *value * *mass));
        smoothed.clear();
        smoothed.resize(field.len(), DVec3::ZERO);
        let is_done = solve(weighted, smoothed);
        if is_done {
            field.copy_from_slice(smoothed);
        }
        is_done
    }
}
