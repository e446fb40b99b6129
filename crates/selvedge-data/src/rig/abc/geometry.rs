//! Meshes of Alembic: `P`, `.faceIndices`, `.faceCounts` and `uv` of the schema `.geom`.
//!
//! The faces are those of the first sample; the number of points must not change. Texture
//! coordinates are per corner of a face or per point, which of the two their number says.

use glam::{DVec2, DVec3};

use super::super::moving_mesh::MovingMesh;
use super::super::node_mesh::{Corners, NodeMesh, texture_by_corner};
use super::archive::{AbcFile, AbcObject, AbcProperty, F32, F64, I32, U32};
use super::budget::Budget;

/// A mesh as its points move.
pub(super) fn moving(
    file: &AbcFile<'_>,
    object: &AbcObject<'_>,
    node: usize,
    budget: &Budget,
) -> Result<MovingMesh, String> {
    let schema = schema(file, object)?;
    let mesh = mesh(file, &schema, node, budget)?;
    let points = find(&schema, "P")?;
    let keys = points.keys()?;
    let (mut times, mut frames) = (Vec::new(), Vec::new());
    if keys.len() > 1 {
        for key in keys {
            let frame = positions(points, key, budget)?;
            if frame.len() != mesh.positions.len() {
                return Err(format!(
                    "it has {} points in sample {key} and {} in the first: their number must not change",
                    frame.len(),
                    mesh.positions.len()
                ));
            }
            times.push(file.time(points, key)?);
            frames.push(frame);
        }
    }
    MovingMesh::sampled(mesh, times, frames)
        .map_err(|problem| format!("the samples of its points {problem}"))
}

/// A mesh as it is in its first sample.
pub(super) fn still(
    file: &AbcFile<'_>,
    object: &AbcObject<'_>,
    node: usize,
    budget: &Budget,
) -> Result<NodeMesh, String> {
    mesh(file, &schema(file, object)?, node, budget)
}

fn schema<'a>(file: &AbcFile<'a>, object: &AbcObject<'a>) -> Result<Vec<AbcProperty<'a>>, String> {
    let schema = object.property(".geom").ok_or("its mesh has no .geom")?;
    file.within(schema)
}

fn find<'p, 'a>(
    properties: &'p [AbcProperty<'a>],
    name: &str,
) -> Result<&'p AbcProperty<'a>, String> {
    let mut all = properties.iter();
    all.find(|property| property.name == name)
        .ok_or_else(|| format!("its mesh has no {name}"))
}

fn mesh(
    file: &AbcFile<'_>,
    schema: &[AbcProperty<'_>],
    node: usize,
    budget: &Budget,
) -> Result<NodeMesh, String> {
    let positions = positions(find(schema, "P")?, 0, budget)?;
    let counts = whole(find(schema, ".faceCounts")?, budget)?;
    let corners = whole(find(schema, ".faceIndices")?, budget)?;
    let total: u64 = counts.iter().map(|&count| u64::from(count)).sum();
    if total != corners.len() as u64 {
        return Err(format!(
            "its .faceCounts sum to {total}, but .faceIndices has {}",
            corners.len()
        ));
    }
    let mut rest = corners.into_iter();
    let faces: Vec<Vec<u32>> = counts
        .iter()
        .map(|&count| {
            let mut face: Vec<u32> = rest.by_ref().take(count as usize).collect();
            face.reverse();
            face
        })
        .collect();
    Ok(NodeMesh {
        node,
        texture: texture(file, schema, &faces, positions.len(), budget)?,
        fabrics: vec![None; faces.len()],
        positions,
        faces,
    })
}

/// Texture coordinates of the faces' corners.
fn texture(
    file: &AbcFile<'_>,
    schema: &[AbcProperty<'_>],
    faces: &[Vec<u32>],
    points: usize,
    budget: &Budget,
) -> Result<Option<Vec<Vec<DVec2>>>, String> {
    let Ok(property) = find(schema, "uv") else {
        return Ok(None);
    };
    let within = file.within(property);
    let (values, indices) = match &within {
        Ok(within) => (find(within, ".vals")?, find(within, ".indices").ok()),
        Err(_) => (property, None),
    };
    let values: Vec<DVec2> = reals(values, 0, 2, budget)?
        .chunks_exact(2)
        .map(DVec2::from_slice)
        .collect();
    let values: Vec<DVec2> = match indices {
        None => values,
        Some(indices) => {
            let place = |&number: &u32| values.get(number as usize).copied();
            let indices = whole(indices, budget)?;
            let found: Option<Vec<DVec2>> = indices.iter().map(place).collect();
            found.ok_or("an index of its texture coordinates has no value")?
        }
    };
    texture_by_corner(&values, faces, points, Corners::Reversed).map(Some)
}

fn positions(
    property: &AbcProperty<'_>,
    sample: usize,
    budget: &Budget,
) -> Result<Vec<DVec3>, String> {
    let numbers = reals(property, sample, 3, budget)?;
    let points: Vec<DVec3> = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
    match points.iter().position(|point| !point.is_finite()) {
        None => Ok(points),
        Some(point) => Err(format!("point {point} is not finite in sample {sample}")),
    }
}

/// Numbers of a sample, `extent` of which are an element.
pub(super) fn reals(
    property: &AbcProperty<'_>,
    sample: usize,
    extent: usize,
    budget: &Budget,
) -> Result<Vec<f64>, String> {
    let bytes = property.sample(sample)?;
    let width = match property.pod {
        F32 => 4,
        F64 => 8,
        _ => return Err(format!("its {} is not of real numbers", property.name)),
    };
    if property.extent != extent || bytes.len() % (width * extent) != 0 {
        return Err(format!(
            "its {} has elements of {} numbers in {} bytes, expected elements of {extent}",
            property.name,
            property.extent,
            bytes.len()
        ));
    }
    budget.take(bytes.len() / width)?;
    Ok(match width {
        4 => bytes
            .chunks_exact(4)
            .map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])))
            .collect(),
        _ => bytes
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]))
            .collect(),
    })
}

/// Whole numbers of the first sample.
fn whole(property: &AbcProperty<'_>, budget: &Budget) -> Result<Vec<u32>, String> {
    let bytes = property.sample(0)?;
    if ![I32, U32].contains(&property.pod) || property.extent != 1 || bytes.len() % 4 != 0 {
        return Err(format!("its {} is not of whole numbers", property.name));
    }
    budget.take(bytes.len() / 4)?;
    Ok(bytes
        .chunks_exact(4)
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect())
}
