//! Texture coordinates of any unit as material coordinates in metres: each sheet's are stretched
//! along u and along v so that its edges become as long as they are at the start.
//!
//! Least squares over the sheet's edges for a = s_u², b = s_v²: Σ (a Δu² + b Δv² - l²)² is
//! smallest, a linear problem that is met exactly by a sheet that was rolled or folded out of its
//! texture without strain. A sheet whose texture is mirrored is mirrored back.

use glam::DVec2;
use selvedge_cloth::geometry::signed_area_2d;

use super::error::ObjError;
use super::parse::Statements;

/// Scales `coordinates`, `[vertices]`, sheet by sheet.
pub(super) fn fit(statements: &Statements, coordinates: &mut [DVec2]) -> Result<(), ObjError> {
    let sheets = sheets(statements);
    for sheet in 0..sheets.len() {
        if sheets[sheet] != sheet {
            continue;
        }
        let scale = scale(statements, coordinates, &sheets, sheet)?;
        for (coordinate, of) in coordinates.iter_mut().zip(&sheets) {
            if *of == sheet {
                *coordinate *= scale;
            }
        }
    }
    Ok(())
}

/// A vertex of each vertex's sheet, the same for all of them: the smallest.
fn sheets(statements: &Statements) -> Vec<usize> {
    let mut parents: Vec<usize> = (0..statements.positions.len()).collect();
    fn root(parents: &mut [usize], mut vertex: usize) -> usize {
        while parents[vertex] != vertex {
            parents[vertex] = parents[parents[vertex]];
            vertex = parents[vertex];
        }
        vertex
    }
    for polygon in &statements.polygons {
        for corner in &polygon.corners[1..] {
            let first = root(&mut parents, polygon.corners[0].vertex as usize);
            let second = root(&mut parents, corner.vertex as usize);
            let (low, high) = (first.min(second), first.max(second));
            parents[high] = low;
        }
    }
    (0..parents.len()).map(|v| root(&mut parents, v)).collect()
}

/// The factors along u (negative where the texture is mirrored) and v of one sheet.
fn scale(
    statements: &Statements,
    coordinates: &[DVec2],
    sheets: &[usize],
    sheet: usize,
) -> Result<DVec2, ObjError> {
    let (mut uu, mut uv, mut vv, mut lu, mut lv) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let mut area = 0.0;
    for polygon in &statements.polygons {
        let corners = &polygon.corners;
        if sheets[corners[0].vertex as usize] != sheet {
            continue;
        }
        let place = |k: usize| corners[k % corners.len()].vertex as usize;
        for k in 0..corners.len() {
            let (from, to) = (place(k), place(k + 1));
            let [u, v] = (coordinates[to] - coordinates[from]).powf(2.0).to_array();
            let length = statements.positions[to].distance_squared(statements.positions[from]);
            uu += u * u;
            uv += u * v;
            vv += v * v;
            lu += length * u;
            lv += length * v;
            area += signed_area_2d(coordinates[place(0)], coordinates[from], coordinates[to]);
        }
    }
    let determinant = uu * vv - uv * uv;
    let along_u = (lu * vv - lv * uv) / determinant;
    let along_v = (lv * uu - lu * uv) / determinant;
    if !(along_u.is_finite() && along_u > 0.0 && along_v.is_finite() && along_v > 0.0) {
        return Err(ObjError::Fit { vertex: sheet + 1 });
    }
    let mirror = if area < 0.0 { -1.0 } else { 1.0 };
    Ok(DVec2::new(mirror * along_u.sqrt(), along_v.sqrt()))
}
