//! A warning for a cloth that starts far from its material size, by the median over its edges of
//! l/l₀ at the start. Far from 1, its texture coordinates are in another unit, or its start is no
//! start of this cloth.

use glam::DVec3;
use selvedge_cloth::Mesh;

/// Medians beyond these are warned of: no fabric hangs so, no start is folded so by intent.
const SMALLEST: f64 = 0.8;
const LARGEST: f64 = 1.25;

/// A warning for a cloth that starts at `positions` `[m]`, `[vertices]`, far from its material
/// size; `remedy` says how its file can be mended.
pub(super) fn warning(mesh: &Mesh, positions: &[DVec3], remedy: &str) -> Option<String> {
    let median = median_stretch(mesh, positions);
    if (SMALLEST..=LARGEST).contains(&median) {
        return None;
    }
    Some(format!(
        "mesh: half of the edges start at {median:.3} × their material length or {}, a strain of {:.0} %: texture coordinates are material coordinates in metres; {remedy}",
        if median > 1.0 { "more" } else { "less" },
        100.0 * (median - 1.0)
    ))
}

/// The median over the edges of their length over that in the material.
fn median_stretch(mesh: &Mesh, positions: &[DVec3]) -> f64 {
    let uv = mesh.material_coordinates();
    let edges = mesh.topology().edges().iter();
    let mut stretches: Vec<f64> = edges
        .map(|edge| {
            let [a, b] = edge.vertices.map(|v| v.index());
            positions[a].distance(positions[b]) / uv[a].distance(uv[b])
        })
        .collect();
    stretches.sort_by(f64::total_cmp);
    stretches[stretches.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use selvedge_cloth::generate::{SquareSpec, square};

    #[test]
    fn what_starts_far_from_its_size_is_warned_of() {
        let spec = SquareSpec {
            vertices: 40,
            size: 1.0,
            seed: 3,
        };
        let mesh = square(&spec).unwrap().mesh;
        let scaled = |by: f64| -> Vec<DVec3> { mesh.positions().iter().map(|p| *p * by).collect() };
        for by in [1.0, 0.81, 1.24] {
            assert_eq!(warning(&mesh, &scaled(by), "mend it"), None, "{by}");
        }
        for (by, words) in [
            (0.79, ["0.790 × their material length or less", "-21 %"]),
            (2.0, ["2.000 × their material length or more", "100 %"]),
        ] {
            let text = warning(&mesh, &scaled(by), "mend it").unwrap();
            assert!(words.iter().all(|word| text.contains(word)), "{text}");
            assert!(text.ends_with("in metres; mend it"), "{text}");
        }
    }
}
