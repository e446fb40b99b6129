//! How large a mesh is, and how near its vertices may be and yet be two.

use glam::DVec3;
use selvedge_cloth::geometry;

/// Part of a mesh's extent up to which vertices of formats that split them coincide: single
/// precision at some ten roundings.
pub(crate) const COINCIDENT: f64 = 1e-6;

/// The remedy for something `size` m long that is to be of a person's size, by the transform that
/// `key` names.
pub(crate) fn unit_remedy(size: f64, key: &str) -> String {
    let (factor, from) = match size {
        400.0.. => (0.001, ", from millimetres"),
        1.0.. => (0.01, ", from centimetres"),
        0.03.. => (10.0, ""),
        0.003.. => (100.0, ""),
        _ => (1000.0, ""),
    };
    let made = size * factor;
    let made = if made < 0.01 { format!("{made:.1e}") } else { format!("{made:.2}") };
    format!("is its file in metres? {key} = {factor} makes it {made} m{from}")
}

/// Longest side of the box around `positions`.
pub(crate) fn extent(positions: &[DVec3]) -> f64 {
    geometry::extent(positions).max_element()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_brings_it_to_the_size_of_a_person() {
        for (size, words) in [
            (1720.0, "scale = 0.001 makes it 1.72 m, from millimetres"),
            (167.0, "scale = 0.01 makes it 1.67 m, from centimetres"),
            (39.6, "scale = 0.01 makes it 0.40 m, from centimetres"),
            (0.005, "scale = 100 makes it 0.50 m"),
            (0.0012, "scale = 1000 makes it 1.20 m"),
        ] {
            let text = unit_remedy(size, "scale");
            assert!(text.contains(words), "{text}");
        }
    }
}
