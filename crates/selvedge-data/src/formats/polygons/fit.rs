//! Texture coordinates of any unit as material coordinates in metres: each panel's are stretched
//! along u and along v so that its edges become as long as they are at the start.
//!
//! Least squares over the panel's edges for a = s_u², b = s_v²: Σ (a Δu² + b Δv² - l²)² is
//! smallest, a linear problem that is met exactly by a panel that was rolled or folded out of its
//! texture without strain. A panel whose texture is mirrored is mirrored back.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::DVec2;
use selvedge_cloth::geometry::signed_area_2d;

use super::weld::{root, unite};
use super::{MeshFileError, Polygons};

/// Scales the corners' `coordinates`, `[polygons][corners]`, panel by panel.
pub(super) fn fit(
    polygons: &Polygons,
    coordinates: &mut [Vec<DVec2>],
) -> Result<(), MeshFileError> {
    let panels = panels(polygons, coordinates);
    let mut done: HashMap<usize, DVec2> = HashMap::new();
    for &panel in &panels {
        if let Entry::Vacant(entry) = done.entry(panel) {
            entry.insert(scale(polygons, coordinates, &panels, panel)?);
        }
    }
    for (corners, panel) in coordinates.iter_mut().zip(&panels) {
        corners.iter_mut().for_each(|corner| *corner *= done[panel]);
    }
    Ok(())
}

/// A polygon of each polygon's panel, the same for all of them: the first. Polygons are of one
/// panel if they share a vertex at the same coordinate.
fn panels(polygons: &Polygons, coordinates: &[Vec<DVec2>]) -> Vec<usize> {
    let mut parents: Vec<u32> = (0..coordinates.len() as u32).collect();
    let mut first: HashMap<(u32, [u64; 2]), u32> = HashMap::new();
    let each = polygons.polygons.iter().zip(coordinates);
    for (number, (polygon, places)) in (0_u32..).zip(each) {
        for (corner, place) in polygon.corners.iter().zip(places) {
            let bits = place.to_array().map(f64::to_bits);
            let known = *first.entry((corner.vertex, bits)).or_insert(number);
            unite(&mut parents, known, number);
        }
    }
    let each = 0..parents.len() as u32;
    each.map(|p| root(&mut parents, p) as usize).collect()
}

/// The factors along u (negative where the texture is mirrored) and v of one panel.
fn scale(
    polygons: &Polygons,
    coordinates: &[Vec<DVec2>],
    panels: &[usize],
    panel: usize,
) -> Result<DVec2, MeshFileError> {
    let (mut uu, mut uv, mut vv, mut lu, mut lv) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let mut area = 0.0;
    for (number, polygon) in polygons.polygons.iter().enumerate() {
        if panels[number] != panel {
            continue;
        }
        let (corners, places) = (&polygon.corners, &coordinates[number]);
        for from in 0..corners.len() {
            let to = (from + 1) % corners.len();
            let position = |k: usize| polygons.positions[corners[k].vertex as usize];
            let [u, v] = (places[to] - places[from]).powf(2.0).to_array();
            let length = position(to).distance_squared(position(from));
            uu += u * u;
            uv += u * v;
            vv += v * v;
            lu += length * u;
            lv += length * v;
            area += signed_area_2d(places[0], places[from], places[to]);
        }
    }
    let determinant = uu * vv - uv * uv;
    let along_u = (lu * vv - lv * uv) / determinant;
    let along_v = (lv * uu - lu * uv) / determinant;
    if !(along_u.is_finite() && along_u > 0.0 && along_v.is_finite() && along_v > 0.0) {
        let vertex = polygons.number(polygons.polygons[panel].corners[0].vertex);
        return Err(MeshFileError::content(format!(
            "the texture coordinates of the sheet of vertex {vertex} cannot be stretched along u and v to fit its shape: they need some extent along both; mend them, or take the rest shape from the form in space with mesh.pattern = \"shape\""
        )));
    }
    let mirror = if area < 0.0 { -1.0 } else { 1.0 };
    Ok(DVec2::new(mirror * along_u.sqrt(), along_v.sqrt()))
}
