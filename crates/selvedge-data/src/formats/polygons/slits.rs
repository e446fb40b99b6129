//! Where a sheet looks joined and is not: vertices that lie on an edge without belonging to it, and
//! pieces that have vertices at the same places.

use std::collections::BTreeSet;

use super::Polygons;
use super::border::open_edges;
use super::weld::{owners, root, unite};
use crate::formats::extent::{COINCIDENT, extent};

/// Distance from an edge up to which a vertex lies on it, in units of the edge.
const ON_EDGE: f64 = 1e-3;

/// Warns of vertices of borders that lie on an open edge, or at vertices of other pieces.
pub(super) fn warn_of_slits(polygons: &mut Polygons) {
    let edges: Vec<[u32; 2]> = open_edges(polygons).into_keys().collect();
    let border: BTreeSet<u32> = edges.iter().flatten().copied().collect();
    let border: Vec<u32> = border.into_iter().collect();
    let slits = on_edges(polygons, &edges, &border);
    if let Some((vertex, [a, b])) = slits.first() {
        let [vertex, a, b] = [vertex, a, b].map(|v| polygons.number(*v));
        polygons.warnings.push(format!(
            "{} vertices lie on an edge that they do not belong to, where the sheet opens; the first is {vertex}, between {a} and {b}: give the face at that edge the vertex as a corner",
            slits.len()
        ));
    }
    let pieces = touching_pieces(polygons, &border);
    if pieces > 0 {
        let weld = COINCIDENT * extent(&polygons.positions);
        polygons.warnings.push(format!(
            "{pieces} pieces have vertices at the places of others and are not joined there: mesh.weld = {weld:.1e} joins them"
        ));
    }
}

/// The vertices of `border` that lie between the ends of one of `edges`, each with the first.
fn on_edges(polygons: &Polygons, edges: &[[u32; 2]], border: &[u32]) -> Vec<(u32, [u32; 2])> {
    let at = |v: u32| polygons.positions[v as usize];
    let sorted = [0, 1, 2].map(|axis: usize| {
        let mut sorted: Vec<u32> = border.to_vec();
        sorted.sort_by(|a, b| at(*a)[axis].total_cmp(&at(*b)[axis]));
        sorted
    });
    let mut found = BTreeSet::new();
    let mut slits = Vec::new();
    for &[a, b] in edges {
        let along = at(b) - at(a);
        let reach = ON_EDGE * along.length();
        // Of the vertices beside the edge, by the axis that leaves the fewest.
        let beside = [0, 1, 2].map(|axis: usize| {
            let (low, high) = (at(a)[axis].min(at(b)[axis]), at(a)[axis].max(at(b)[axis]));
            let first = sorted[axis].partition_point(|v| at(*v)[axis] < low - reach);
            let last = sorted[axis].partition_point(|v| at(*v)[axis] <= high + reach);
            &sorted[axis][first.min(last)..last]
        });
        let Some(beside) = beside.into_iter().min_by_key(|beside| beside.len()) else {
            continue;
        };
        for &vertex in beside {
            let from = at(vertex) - at(a);
            let share = from.dot(along) / along.length_squared();
            let is_between = (ON_EDGE..=1.0 - ON_EDGE).contains(&share);
            if is_between
                && from.distance(share * along) <= reach
                && ![a, b].contains(&vertex)
                && found.insert(vertex)
            {
                slits.push((vertex, [a, b]));
            }
        }
    }
    slits
}

/// Number of pieces that have a vertex of the border where another piece has one.
fn touching_pieces(polygons: &Polygons, border: &[u32]) -> usize {
    let mut pieces: Vec<u32> = (0..polygons.positions.len() as u32).collect();
    for polygon in &polygons.polygons {
        for [a, b] in polygon.sides() {
            unite(&mut pieces, a, b);
        }
    }
    let places = border.iter().map(|v| polygons.positions[*v as usize]);
    let places: Vec<_> = places.collect();
    let mut touching = BTreeSet::new();
    for (own, first) in owners(&places, 0.0).into_iter().enumerate() {
        let both = [own, first as usize].map(|k| root(&mut pieces, border[k]));
        if both[0] != both[1] {
            touching.extend(both);
        }
    }
    touching.len()
}
