//! From statements to a mesh: one texture coordinate per vertex (cut open along seams, where that
//! is wanted), polygons split into triangles.

use glam::DVec2;
use selvedge_cloth::Mesh;
use selvedge_cloth::generate::Sheet;
use selvedge_cloth::geometry::signed_area_2d;

use super::error::ObjError;
use super::fit::fit;
use super::flat::planar_coordinates;
use super::options::{ObjOptions, Seams, TextureUnit};
use super::parse::{Polygon, Statements};

pub(super) fn assemble(mut statements: Statements, options: ObjOptions) -> Result<Sheet, ObjError> {
    if statements.polygons.is_empty() {
        return Err(ObjError::NoFaces);
    }
    check_corners(&statements.polygons)?;
    let mut corners = statements.polygons.iter().flat_map(|p| &p.corners);
    let coordinates = if corners.any(|corner| corner.texture.is_some()) {
        if options.seams == Seams::Cut {
            cut(&mut statements);
        }
        let mut coordinates = texture_coordinates(&statements)?;
        if options.texture == TextureUnit::Fit {
            fit(&statements, &mut coordinates)?;
        }
        coordinates
    } else {
        planar_coordinates(&statements)?
    };
    let mut faces = Vec::with_capacity(statements.polygons.len());
    for polygon in &statements.polygons {
        split(polygon, &coordinates, &mut faces)?;
    }
    let labels = statements
        .labels
        .iter()
        .map(|(name, vertices)| (name.clone(), vertices.iter().copied().collect()))
        .collect();
    Ok(Sheet {
        mesh: Mesh::new(&faces, coordinates, statements.positions)?,
        labels,
    })
}

/// Checks that no face names a vertex twice: it would have no area, whatever else is wrong.
fn check_corners(polygons: &[Polygon]) -> Result<(), ObjError> {
    for polygon in polygons {
        let mut vertices: Vec<u32> = polygon.corners.iter().map(|c| c.vertex).collect();
        vertices.sort_unstable();
        if let Some(pair) = vertices.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(ObjError::RepeatedVertex {
                line: polygon.line,
                vertex: pair[0] as usize + 1,
            });
        }
    }
    Ok(())
}

/// Gives every further texture coordinate of a vertex a vertex of its own at the same place, with
/// the same labels.
fn cut(statements: &mut Statements) {
    // What stands for vertex v with a coordinate: v itself for the first, then the copies.
    let mut versions: Vec<Vec<(DVec2, u32)>> = vec![Vec::new(); statements.positions.len()];
    for corner in statements.polygons.iter_mut().flat_map(|p| &mut p.corners) {
        let Some(texture) = corner.texture else {
            continue;
        };
        let value = statements.texture[texture];
        let known = &mut versions[corner.vertex as usize];
        if let Some((_, version)) = known.iter().find(|(other, _)| *other == value) {
            corner.vertex = *version;
            continue;
        }
        let original = corner.vertex;
        if !known.is_empty() {
            corner.vertex = statements.positions.len() as u32;
            statements
                .positions
                .push(statements.positions[original as usize]);
            for label in statements.labels.values_mut() {
                if label.contains(&original) {
                    label.insert(corner.vertex);
                }
            }
        }
        known.push((value, corner.vertex));
    }
}

/// The texture coordinate of each vertex, on which all its faces must agree; zero for a vertex
/// without a face, which is an error of the mesh later.
fn texture_coordinates(statements: &Statements) -> Result<Vec<DVec2>, ObjError> {
    let mut found: Vec<Option<DVec2>> = vec![None; statements.positions.len()];
    for polygon in &statements.polygons {
        for corner in &polygon.corners {
            let Some(texture) = corner.texture else {
                return Err(ObjError::MissingTexture { line: polygon.line });
            };
            let value = statements.texture[texture];
            let first = *found[corner.vertex as usize].get_or_insert(value);
            if first != value {
                return Err(ObjError::Seam {
                    vertex: corner.vertex as usize + 1,
                    first: first.to_string(),
                    second: value.to_string(),
                });
            }
        }
    }
    Ok(found.into_iter().map(Option::unwrap_or_default).collect())
}

/// Splits a polygon into a fan from the corner whose smallest triangle is largest in material
/// space, so that quads get their better diagonal.
fn split(
    polygon: &Polygon,
    coordinates: &[DVec2],
    faces: &mut Vec<[u32; 3]>,
) -> Result<(), ObjError> {
    let vertices: Vec<u32> = polygon.corners.iter().map(|c| c.vertex).collect();
    let count = vertices.len();
    let fan = |center: usize| {
        let vertices = &vertices;
        (1..count - 1).map(move |k| [0, k, k + 1].map(|j| vertices[(center + j) % count]))
    };
    let smallest = |center: usize| {
        fan(center)
            .map(|face| {
                let [a, b, c] = face.map(|v| coordinates[v as usize]);
                signed_area_2d(a, b, c)
            })
            .fold(f64::INFINITY, f64::min)
    };
    // A triangle has no choice; what is wrong with it the mesh says better.
    let mut best = 0;
    if count > 3 {
        best = (0..count).fold(0, |best, center| {
            if smallest(center) > smallest(best) {
                center
            } else {
                best
            }
        });
        if smallest(best) <= 0.0 {
            return Err(ObjError::Polygon {
                line: polygon.line,
                corners: count,
            });
        }
    }
    faces.extend(fan(best));
    Ok(())
}
