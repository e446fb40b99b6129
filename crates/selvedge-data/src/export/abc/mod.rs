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
mod property;

use std::io;
use std::path::Path;

use glam::Vec3;

use self::archive::{Archive, Object, Sampling};
use self::property::{BOUNDS, Form, Property};
use super::obstacles::TakenObstacle;
use super::outcome::{ExportError, Pulse};
use super::take::{Take, extent};
use crate::formats::atomic::write_atomically;

const MESH: &str = "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1;schemaObjTitle=AbcGeom_PolyMesh_v1:.geom";
const MESH_SCHEMA: &str = "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1";
const NODE: &str = "schema=AbcGeom_Xform_v3;schemaObjTitle=AbcGeom_Xform_v3:.xform";
const NODE_SCHEMA: &str = "schema=AbcGeom_Xform_v3";

/// A translation, of all operations of a node.
const TRANSLATE: u8 = 1 << 4;

/// Writes the archive.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    Ok(write_atomically(path, |out| {
        let mut archive = Archive::new(out)?;
        let mut top = vec![cloth(take, &mut archive, pulse)?];
        for handle in 0..take.trajectory.handles().vertices().len() {
            top.push(self::handle(take, &mut archive, handle)?);
        }
        for obstacle in take.obstacles() {
            top.push(body(take, &mut archive, &obstacle)?);
        }
        archive.finish(top, &Sampling::of(take))
    })?)
}

/// Samples of a mesh in every frame, as children of the groups of its properties.
#[derive(Default)]
struct Samples {
    boxes: Vec<u64>,
    points: Vec<u64>,
    velocities: Vec<u64>,
    normals: Vec<u64>,
}

impl Samples {
    fn add(
        &mut self,
        archive: &mut Archive<'_>,
        points: &[Vec3],
        velocities: Option<Vec<Vec3>>,
    ) -> io::Result<()> {
        let [low, high] = extent(points).map(|corner| corner.as_dvec3().to_array());
        let corners = [low, high].concat();
        self.boxes.push(archive.scalar(&doubles(&corners))?);
        self.points.extend(archive.array(&floats(points))?);
        if let Some(velocities) = velocities {
            let velocities = archive.array(&floats(&velocities))?;
            self.velocities.extend(velocities);
        }
        Ok(())
    }
}

fn cloth(take: &Take<'_>, archive: &mut Archive<'_>, pulse: &mut Pulse<'_>) -> io::Result<Object> {
    let mut samples = Samples::default();
    for number in 0..take.len() {
        let points = take.positions(number);
        let velocities = take.velocities.then(|| take.velocities(number));
        samples.add(archive, &points, velocities)?;
        if take.normals {
            let normals = take.normals_at(&points);
            samples.normals.extend(archive.array(&floats(&normals))?);
        }
        pulse.beat()?;
    }
    let cloth = take.trajectory.cloth();
    let faces = cloth.topology().face_indices();
    let mut properties = mesh(archive, samples, take.len(), &faces)?;
    properties.extend(texture(take, archive, &faces)?);
    properties.push(per_vertex(take, archive)?);
    let sheet = geometry(archive, "sheet", properties)?;
    node(archive, "cloth", None, vec![sheet])
}

/// A body beside the cloth, in a node of its own.
fn body(
    take: &Take<'_>,
    archive: &mut Archive<'_>,
    body: &TakenObstacle<'_>,
) -> io::Result<Object> {
    let count = body.frame_count(take);
    let mut samples = Samples::default();
    for number in 0..count {
        let is_moving = take.velocities && count > 1;
        let velocities = is_moving.then(|| body.velocities(take, number));
        samples.add(archive, &body.positions(take, number), velocities)?;
    }
    let properties = mesh(archive, samples, count, body.track.faces())?;
    let shape = geometry(archive, &format!("{}_mesh", body.name), properties)?;
    node(archive, &body.name, None, vec![shape])
}

/// A node that moves as a handle does.
fn handle(take: &Take<'_>, archive: &mut Archive<'_>, handle: usize) -> io::Result<Object> {
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

/// Properties of a mesh but its texture: its own box, positions, faces and what goes with them.
fn mesh(
    archive: &mut Archive<'_>,
    samples: Samples,
    count: usize,
    faces: &[[u32; 3]],
) -> io::Result<Vec<Property>> {
    let mut properties = vec![
        archive.property(".selfBnds", BOUNDS, count, &samples.boxes)?,
        archive.property(
            "P",
            Form::array(10, 3, "geoScope=vtx;interpretation=point"),
            count,
            &samples.points,
        )?,
    ];
    if !samples.velocities.is_empty() {
        let form = Form::array(10, 3, "interpretation=vector");
        properties.push(archive.property(".velocities", form, count, &samples.velocities)?);
    }
    let corners: Vec<u32> = clockwise(faces).collect();
    let corners = archive.array(&words(&corners))?;
    properties.push(archive.property(".faceIndices", Form::array(6, 1, ""), 1, &corners)?);
    let counts = archive.array(&words(&vec![3; faces.len()]))?;
    properties.push(archive.property(".faceCounts", Form::array(6, 1, ""), 1, &counts)?);
    if !samples.normals.is_empty() {
        let form = Form::array(
            10,
            3,
            "arrayExtent=1;geoScope=vtx;interpretation=normal;isGeomParam=true;podExtent=3;podName=float32_t",
        );
        properties.push(archive.property("N", form, count, &samples.normals)?);
    }
    Ok(properties)
}

/// Texture coordinates by the corners of faces, if there are some.
fn texture(
    take: &Take<'_>,
    archive: &mut Archive<'_>,
    faces: &[[u32; 3]],
) -> io::Result<Option<Property>> {
    const FORM: &str = "arrayExtent=1;geoScope=fvr;interpretation=vector;isGeomParam=true;podExtent=2;podName=float32_t";
    let Some(pattern) = take.trajectory.cloth().texture_points() else {
        return Ok(None);
    };
    let (values, numbers): (Vec<_>, Vec<u32>) = match pattern.is_sewn() {
        true => {
            let values: Vec<_> = pattern.faces().flatten().collect();
            let own: Vec<[u32; 3]> = (0..faces.len() as u32)
                .map(|face| [0, 1, 2].map(|corner| 3 * face + corner))
                .collect();
            (values, clockwise(&own).collect())
        }
        false => (pattern.points().to_vec(), clockwise(faces).collect()),
    };
    let values: Vec<u8> = values
        .iter()
        .flat_map(|c| c.to_array())
        .flat_map(f32::to_le_bytes)
        .collect();
    let values = archive.array(&values)?;
    let numbers = archive.array(&words(&numbers))?;
    let properties = vec![
        archive.property(".vals", Form::array(10, 2, FORM), 1, &values)?,
        archive.property(".indices", Form::array(5, 1, ""), 1, &numbers)?,
    ];
    archive.compound("uv", FORM, properties).map(Some)
}

/// The rest pose and the numbers of handles.
fn per_vertex(take: &Take<'_>, archive: &mut Archive<'_>) -> io::Result<Property> {
    let rest = archive.array(&floats(&take.rest_positions()))?;
    let numbers: Vec<u8> = take
        .handle_numbers()
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect();
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
    properties: Vec<Property>,
) -> io::Result<Object> {
    let schema = archive.compound(".geom", MESH_SCHEMA, properties)?;
    archive.object(name, MESH, vec![schema], Vec::new())
}

/// A node at these samples of a place, or at the origin.
fn node(
    archive: &mut Archive<'_>,
    name: &str,
    places: Option<Vec<u64>>,
    children: Vec<Object>,
) -> io::Result<Object> {
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
            let moving = archive.array(&words(&[0, 1, 2]))?;
            properties.push(archive.property(".animChans", Form::array(5, 1, ""), 1, &moving)?);
        }
    }
    let schema = archive.compound(".xform", NODE_SCHEMA, properties)?;
    archive.object(name, NODE, vec![schema], children)
}

/// Corners of faces, the other way round.
fn clockwise(faces: &[[u32; 3]]) -> impl Iterator<Item = u32> {
    faces.iter().flat_map(|&[a, b, c]| [c, b, a])
}

fn floats(points: &[Vec3]) -> Vec<u8> {
    let numbers = points.iter().flat_map(|p| p.to_array());
    numbers.flat_map(f32::to_le_bytes).collect()
}

fn doubles(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

fn words(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}
