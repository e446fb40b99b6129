//! A small cloth that moves, for tests of files.

use glam::{Vec2, Vec3};

use super::Trajectory;
use crate::test_help::{provenance, sheet};

/// A square of two triangles that moves and bends for five frames, held by its vertices 3 and 2.
pub(crate) fn moving_square(frame_rate: f64) -> Trajectory {
    let flat = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let at = |frame: usize| {
        let t = frame as f32;
        flat.map(|c| Vec3::new(c.x + 0.1 * t, c.y * (1.0 - 0.01 * t), 0.05 * t * t * c.x))
    };
    let cloth = sheet(&at(0), &flat, &[[0, 1, 2], [0, 2, 3]], &[3, 2]);
    let provenance = provenance(frame_rate, "tests; of = caches");
    Trajectory::new(cloth, (0..5).flat_map(at).collect(), provenance).unwrap()
}
