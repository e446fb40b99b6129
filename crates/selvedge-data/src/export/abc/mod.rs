//! Alembic (.abc, Ogawa): `/cloth/sheet` is a `PolyMesh` whose positions, velocities and box are
//! sampled by the frame; `/handle_0` and so on are nodes that move as the handles do, and every
//! obstacle is a `PolyMesh` in a node of its own.
//!
//! One uniform time sampling begins at 0 s and says the time between two samples. Faces go
//! clockwise, as Alembic has them. Texture coordinates `[m]` are per corner of a face; `rest` is
//! the rest pose and `handle` the number of the handle that a vertex is, or -1. Alembic does not
//! say which axis is up; its readers take it to be y.
//!
//! Format: the sources of Alembic, `AbcCoreOgawa`, `AbcGeom::OPolyMesh` and `AbcGeom::OXform`.

mod archive;

use std::io;
use std::path::Path;

use self::archive::{Archive, BOUNDS, Form, Written};
use super::common::{le_floats, le_points, le_words};
use super::take::{Body, Take, extent};
use crate::formats::atomic::write_atomically;
use crate::formats::file_error::Problem;

const MESH: &str = "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1;schemaObjTitle=AbcGeom_PolyMesh_v1:.geom";
const MESH_SCHEMA: &str = "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1";
const NODE: &str = "schema=AbcGeom_Xform_v3;schemaObjTitle=AbcGeom_Xform_v3:.xform";
const NODE_SCHEMA: &str = "schema=AbcGeom_Xform_v3";

/// A translation, of all operations of a node.
const TRANSLATE: u8 = 1 << 4;

/// Writes the archive.
pub(super) fn write(take: &Take<'_>, path: &Path) -> Result<(), Problem> {
    Ok(write_atomically(path, |out| {
        let mut archive = Archive::new(out)?;
        let mut top = vec![cloth(take, &mut archive)?];
        for handle in 0..take.trajectory.handles().vertices().len() {
            top.push(self::handle(take, &mut archive, handle)?);
        }
        for obstacle in take.obstacles() {
            let properties = mesh(take, &mut archive, &obstacle)?;
            let shape = geometry(&mut archive, &format!("{}_mesh", obstacle.name), properties)?;
            top.push(node(&mut archive, &obstacle.name, None, vec![shape])?);
        }
        archive.finish(top, take)
    })?)
}

fn cloth(take: &Take<'_>, archive: &mut Archive<'_>) -> io::Result<Written> {
    let mut properties = mesh(take, archive, &take.sheet())?;
    properties.extend(texture(take, archive)?);
    properties.push(per_vertex(take, archive)?);
    let sheet = geometry(archive, "sheet", properties)?;
    node(archive, "cloth", None, vec![sheet])
}

/// A node that moves as a handle does.
fn handle(take: &Take<'_>, archive: &mut Archive<'_>, handle: usize) -> io::Result<Written> {
    let mut places = Vec::with_capacity(take.len());
    for number in 0..take.len() {
        let place = take.handle_positions(number)[handle].as_dvec3();
        places.push(archive.scalar(&doubles(&place.to_array()))?);
    }
    node(
        archive,
        &format!("handle_{handle}"),
        Some(places),
        Vec::new(),
    )
}

/// Properties of a body but its texture: its own box, positions, faces and what goes with them.
fn mesh(take: &Take<'_>, archive: &mut Archive<'_>, body: &Body<'_>) -> io::Result<Vec<Written>> {
    let (is_cloth, count) = (body.track.is_none(), body.frame_count());
    let has_normals = is_cloth && take.normals;
    let [mut boxes, mut points, mut velocities, mut normals] = [const { Vec::new() }; 4];
    for number in 0..count {
        let positions = body.positions(number);
        let [low, high] = extent(&positions).map(|corner| corner.as_dvec3().to_array());
        boxes.push(archive.scalar(&doubles(&[low, high].concat()))?);
        points.extend(archive.array(&le_points(&positions))?);
        if body.has_velocities() {
            velocities.extend(archive.array(&le_points(&body.velocities(number)))?);
        }
        if has_normals {
            normals.extend(archive.array(&le_points(&take.normals_at(&positions)))?);
        }
        if is_cloth {
            (take.beat)()?;
        }
    }
    let form = Form::array(10, 3, "geoScope=vtx;interpretation=point");
    let mut properties = vec![
        archive.property(".selfBnds", BOUNDS, count, &boxes)?,
        archive.property("P", form, count, &points)?,
    ];
    if body.has_velocities() {
        let form = Form::array(10, 3, "interpretation=vector");
        properties.push(archive.property(".velocities", form, count, &velocities)?);
    }
    let faces = body.faces();
    let corners = le_words(&clockwise(&faces));
    let form = Form::array(6, 1, "");
    properties.push(archive.constant(".faceIndices", form, &corners)?);
    let counts = le_words(&vec![3; faces.len()]);
    properties.push(archive.constant(".faceCounts", form, &counts)?);
    if has_normals {
        let form = Form::array(
            10,
            3,
            "arrayExtent=1;geoScope=vtx;interpretation=normal;isGeomParam=true;podExtent=3;podName=float32_t",
        );
        properties.push(archive.property("N", form, count, &normals)?);
    }
    Ok(properties)
}

/// Texture coordinates by the corners of faces, if there are some.
fn texture(take: &Take<'_>, archive: &mut Archive<'_>) -> io::Result<Option<Written>> {
    const FORM: &str = "arrayExtent=1;geoScope=fvr;interpretation=vector;isGeomParam=true;podExtent=2;podName=float32_t";
    let cloth = take.trajectory.cloth();
    let Some(pattern) = cloth.texture_points() else {
        return Ok(None);
    };
    let faces = cloth.topology().face_indices();
    let (values, numbers): (Vec<_>, _) = if pattern.is_sewn() {
        let own = (0..faces.len() as u32).map(|face| [0, 1, 2].map(|k| 3 * face + k));
        let own: Vec<[u32; 3]> = own.collect();
        (pattern.faces().flatten().collect(), clockwise(&own))
    } else {
        (pattern.points().to_vec(), clockwise(&faces))
    };
    let values = le_floats(values.iter().flat_map(|c| c.to_array()));
    let [values, numbers] = [archive.array(&values)?, archive.array(&le_words(&numbers))?];
    let properties = vec![
        archive.property(".vals", Form::array(10, 2, FORM), 1, &values)?,
        archive.property(".indices", Form::array(5, 1, ""), 1, &numbers)?,
    ];
    archive.compound("uv", FORM, properties).map(Some)
}

/// The rest pose and the numbers of handles.
fn per_vertex(take: &Take<'_>, archive: &mut Archive<'_>) -> io::Result<Written> {
    let numbers = take.handle_numbers().into_iter();
    let numbers: Vec<u8> = numbers.flat_map(i32::to_le_bytes).collect();
    let rest = archive.array(&le_points(&take.rest_positions()))?;
    let numbers = archive.array(&numbers)?;
    let rest_form = Form::array(
        10,
        3,
        "arrayExtent=1;geoScope=vtx;interpretation=point;isGeomParam=true;podExtent=3;podName=float32_t",
    );
    let handle_form = Form::array(
        6,
        1,
        "arrayExtent=1;geoScope=vtx;isGeomParam=true;podExtent=1;podName=int32_t",
    );
    let properties = vec![
        archive.property("rest", rest_form, 1, &rest)?,
        archive.property("handle", handle_form, 1, &numbers)?,
    ];
    archive.compound(".arbGeomParams", "", properties)
}

fn geometry(
    archive: &mut Archive<'_>,
    name: &str,
    properties: Vec<Written>,
) -> io::Result<Written> {
    let schema = archive.compound(".geom", MESH_SCHEMA, properties)?;
    archive.object(name, MESH, vec![schema], Vec::new())
}

/// A node at these samples of a place, or at the origin.
fn node(
    archive: &mut Archive<'_>,
    name: &str,
    places: Option<Vec<u64>>,
    children: Vec<Written>,
) -> io::Result<Written> {
    let yes = archive.scalar(&[1])?;
    let mut properties = vec![archive.property(".inherits", Form::scalar(0, 1), 1, &[yes])?];
    if let Some(places) = places {
        let operation = archive.scalar(&[TRANSLATE])?;
        properties.push(archive.property(".ops", Form::scalar(1, 1), 1, &[operation])?);
        let count = places.len();
        properties.push(archive.property(".vals", Form::scalar(11, 3), count, &places)?);
        let form = Form::scalar(0, 1);
        properties.push(archive.property("isNotConstantIdentity", form, 1, &[yes])?);
        if count > 1 {
            let form = Form::array(5, 1, "");
            properties.push(archive.constant(".animChans", form, &le_words(&[0, 1, 2]))?);
        }
    }
    let schema = archive.compound(".xform", NODE_SCHEMA, properties)?;
    archive.object(name, NODE, vec![schema], children)
}

/// Corners of faces, the other way round.
fn clockwise(faces: &[[u32; 3]]) -> Vec<u32> {
    faces.iter().flat_map(|&[a, b, c]| [c, b, a]).collect()
}

fn doubles(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}
