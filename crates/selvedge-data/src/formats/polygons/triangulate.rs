//! Cutting polygons into triangles.

use glam::{DVec2, DVec3};
use selvedge_cloth::geometry::{area_vector, signed_area_2d};

use super::shape::in_own_plane;

/// Triangles of a polygon in space, cut in the plane of its mean normal; none if it has less than
/// three corners, crosses itself or has no area.
pub(super) fn triangles_in_space(corners: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    triangulate(&in_own_plane(corners))
}

/// Triangles of a face of a body: as [`triangles_in_space`] or, where that has none, from the corner
/// whose smallest triangle is largest.
pub(crate) fn triangles_of_body(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let count = corners.len();
    let area = |[a, b, c]: [usize; 3]| area_vector(corners[a], corners[b], corners[c]).length();
    match (count, triangles_in_space(corners)) {
        (_, Some(triangles)) => triangles,
        (0..3, None) => Vec::new(),
        (_, None) => fan(best_center(count, &area), count).collect(),
    }
}

/// The triangles of `count` corners from one of them.
fn fan(center: usize, count: usize) -> impl Iterator<Item = [usize; 3]> {
    (1..count - 1).map(move |k| [0, k, k + 1].map(|j| (center + j) % count))
}

/// The corner of `count` from which the smallest triangle is largest; the first of several.
fn best_center(count: usize, area: &impl Fn([usize; 3]) -> f64) -> usize {
    let smallest = |center: usize| fan(center, count).map(area).fold(f64::INFINITY, f64::min);
    let mut best = (0, smallest(0));
    for center in 1..count {
        let own = smallest(center);
        if own > best.1 {
            best = (center, own);
        }
    }
    best.0
}

/// Triangles of a polygon with these `corners`, which run either way round, as numbers of its
/// corners; none if it crosses itself or has no area.
///
/// A fan from the corner whose smallest triangle is largest, so that quads get their better
/// diagonal; where no fan is inside, ears are cut off (Meisters 1975), the fattest first.
pub(super) fn triangulate(corners: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let count = corners.len();
    if count < 3 {
        return None;
    }
    if count == 3 {
        // No choice; what is wrong with a triangle the mesh says better.
        return Some(vec![[0, 1, 2]]);
    }
    let whole = (1..count - 1).map(|k| signed_area_2d(corners[0], corners[k], corners[k + 1]));
    let whole: f64 = whole.sum();
    let sense = whole.signum();
    let area = |[a, b, c]: [usize; 3]| sense * signed_area_2d(corners[a], corners[b], corners[c]);
    let best = best_center(count, &area);
    if fan(best, count).all(|triangle| area(triangle) > 0.0) {
        return Some(fan(best, count).collect());
    }
    ears(corners, area)
}

fn ears(corners: &[DVec2], area: impl Fn([usize; 3]) -> f64) -> Option<Vec<[usize; 3]>> {
    let mut open: Vec<usize> = (0..corners.len()).collect();
    let mut triangles = Vec::with_capacity(corners.len() - 2);
    while open.len() > 3 {
        let count = open.len();
        let ear = |k: usize| [(k + count - 1) % count, k, (k + 1) % count].map(|k| open[k]);
        let is_clear = |triangle: [usize; 3]| {
            let others = open.iter().filter(|corner| !triangle.contains(corner));
            others
                .copied()
                .all(|corner| !is_inside(triangle, corner, &area))
        };
        let quality = |triangle: [usize; 3]| {
            let [a, b, c] = triangle.map(|k| corners[k]);
            let longest = a
                .distance_squared(b)
                .max(b.distance_squared(c))
                .max(c.distance_squared(a));
            area(triangle) / longest
        };
        let candidates = (0..count).filter(|&k| area(ear(k)) > 0.0 && is_clear(ear(k)));
        let best = candidates.max_by(|&a, &b| quality(ear(a)).total_cmp(&quality(ear(b))))?;
        triangles.push(ear(best));
        open.remove(best);
    }
    let last = [open[0], open[1], open[2]];
    triangles.push(last);
    (area(last) > 0.0).then_some(triangles)
}

/// Returns true if the corner lies in the triangle, its sides included.
fn is_inside(triangle: [usize; 3], corner: usize, area: &impl Fn([usize; 3]) -> f64) -> bool {
    let [a, b, c] = triangle;
    [[a, b], [b, c], [c, a]]
        .iter()
        .all(|&[from, to]| area([from, to, corner]) >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quad_gets_the_diagonal_with_the_larger_smallest_triangle() {
        let dart = [(0.0, 0.0), (2.0, 0.0), (0.5, 0.5), (0.0, 2.0)].map(DVec2::from);
        assert_eq!(triangulate(&dart).unwrap(), [[0, 1, 2], [0, 2, 3]]);
        // Of fewer than three corners there are none.
        for count in 0..3 {
            assert_eq!(triangulate(&dart[..count]), None);
        }
    }
}
