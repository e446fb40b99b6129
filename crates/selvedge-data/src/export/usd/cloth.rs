//! The stage of a trajectory.

use glam::Vec3;

use super::super::obstacles::TakenObstacle;
use super::super::take::{Take, extent};
use super::stage::{Prim, Stage, Value};
use crate::UpAxis;

/// The colour of the cloth: the front of our pictures.
const COLOUR: Vec3 = Vec3::new(0.08, 0.13, 0.4);

/// The colour of obstacles.
const GREY: Vec3 = Vec3::splat(0.3);

/// Roughness of both, as in our glTF.
const ROUGHNESS: f32 = 0.9;

const BINDS: &str = "MaterialBindingAPI";

/// The stage of the frames taken.
pub(super) fn stage_of<'a>(take: &'a Take<'a>) -> Stage<'a> {
    let mut prims = vec![cloth(take)];
    prims.extend(obstacles(take));
    Stage {
        up: match take.up {
            UpAxis::Y => "Y",
            UpAxis::Z => "Z",
        },
        rate: take.trajectory.frame_rate(),
        made_by: &take.trajectory.provenance().made_by,
        codes: (0..take.len())
            .map(|number| take.frames_since_first(number))
            .collect(),
        prims,
    }
}

fn cloth<'a>(take: &'a Take<'a>) -> Prim<'a> {
    let mut root = Prim::new("cloth", "Xform");
    root.is_component = true;
    root.children.push(sheet(take));
    for handle in 0..take.trajectory.handles().vertices().len() {
        let mut node = Prim::new(format!("handle_{handle}"), "Xform");
        let place = Box::new(move |number| take.handle_positions(number)[handle]);
        node.add("double3", "xformOp:translate", Value::Places(place));
        let order = Value::Tokens(&["xformOp:translate"]);
        node.add_uniform("token[]", "xformOpOrder", order);
        root.children.push(node);
    }
    root.children.push(materials("/cloth", COLOUR));
    root
}

fn sheet<'a>(take: &'a Take<'a>) -> Prim<'a> {
    let cloth = take.trajectory.cloth();
    let faces = cloth.topology().face_indices();
    let mut mesh = mesh("sheet", &faces, COLOUR);
    bind(&mut mesh, "/cloth");
    if let Some(texture) = cloth.texture_points() {
        let (corners, how) = match texture.is_sewn() {
            true => (texture.faces().flatten().collect(), "faceVarying"),
            false => (texture.points().to_vec(), "vertex"),
        };
        mesh.add("texCoord2f[]", "primvars:st", Value::Pairs(corners))
            .interpolated(how);
    }
    let rest = Value::Triples(take.rest_positions());
    mesh.add("point3f[]", "primvars:rest", rest)
        .interpolated("vertex");
    let numbers = Value::Whole(take.handle_numbers());
    mesh.add("int[]", "primvars:handle", numbers)
        .interpolated("vertex");
    let points = Value::Frames {
        of: Box::new(|number| take.positions(number)),
        beats: true,
    };
    mesh.add("point3f[]", "points", points);
    let boxes = frames(|number| extent(&take.positions(number)).to_vec());
    mesh.add("float3[]", "extent", boxes);
    if take.velocities {
        let velocities = frames(|number| take.velocities(number));
        mesh.add("vector3f[]", "velocities", velocities);
    }
    if take.normals {
        let normals = frames(|number| take.normals_at(&take.positions(number)));
        mesh.add("normal3f[]", "normals", normals)
            .interpolated("vertex");
    }
    mesh
}

fn obstacles<'a>(take: &'a Take<'a>) -> Option<Prim<'a>> {
    let obstacles = take.obstacles();
    if obstacles.is_empty() {
        return None;
    }
    let mut root = Prim::new("obstacles", "Xform");
    root.children
        .extend(obstacles.iter().map(|body| obstacle(take, body)));
    root.children.push(materials("/obstacles", GREY));
    Some(root)
}

fn obstacle<'a>(take: &'a Take<'a>, body: &TakenObstacle<'a>) -> Prim<'a> {
    let mut mesh = mesh(&body.name, body.track.faces(), GREY);
    bind(&mut mesh, "/obstacles");
    if body.is_still() {
        let points = body.positions(take, 0);
        let corners = extent(&points).to_vec();
        mesh.add("point3f[]", "points", Value::Triples(points));
        mesh.add("float3[]", "extent", Value::Triples(corners));
        return mesh;
    }
    let track = body.track;
    let at = move |number| take.turned(&track.frame(take.frame(number)));
    mesh.add("point3f[]", "points", frames(at));
    let boxes = frames(move |number| extent(&at(number)).to_vec());
    mesh.add("float3[]", "extent", boxes);
    if take.velocities {
        let points = |frame| take.turned(&track.frame(frame));
        let velocities = frames(move |number| take.slopes(number, points));
        mesh.add("vector3f[]", "velocities", velocities);
    }
    mesh
}

/// A mesh that is seen from both sides, without points.
fn mesh<'a>(name: &str, faces: &[[u32; 3]], colour: Vec3) -> Prim<'a> {
    let mut mesh = Prim::new(name, "Mesh");
    mesh.add_uniform("bool", "doubleSided", Value::Flag(true));
    mesh.add_uniform("token", "orientation", Value::Token("rightHanded"));
    mesh.add_uniform("token", "subdivisionScheme", Value::Token("none"));
    let counts = Value::Whole(vec![3; faces.len()]);
    mesh.add("int[]", "faceVertexCounts", counts);
    let corners = faces.as_flattened().iter();
    let corners = corners.map(|&corner| corner.cast_signed()).collect();
    mesh.add("int[]", "faceVertexIndices", Value::Whole(corners));
    let colours = Value::Triples(vec![colour]);
    mesh.add("color3f[]", "primvars:displayColor", colours)
        .interpolated("constant");
    mesh
}

fn bind(mesh: &mut Prim<'_>, root: &str) {
    mesh.applies.push(BINDS);
    let target = Value::Target(format!("{root}/materials/matte"));
    mesh.add("", "material:binding", target);
}

/// The scope of a matte material of this colour, below the prim at `root`.
fn materials<'a>(root: &str, colour: Vec3) -> Prim<'a> {
    let mut shader = Prim::new("surface", "Shader");
    shader.add_uniform("token", "info:id", Value::Token("UsdPreviewSurface"));
    shader.add("color3f", "inputs:diffuseColor", Value::Triple(colour));
    shader.add("float", "inputs:metallic", Value::Number(0.0));
    shader.add("float", "inputs:roughness", Value::Number(ROUGHNESS));
    shader.add("token", "outputs:surface", Value::Nothing);
    let mut material = Prim::new("matte", "Material");
    let source = format!("{root}/materials/matte/surface.outputs:surface");
    material.add("token", "outputs:surface", Value::Source(source));
    material.children.push(shader);
    let mut scope = Prim::new("materials", "Scope");
    scope.children.push(material);
    scope
}

fn frames<'a>(of: impl Fn(usize) -> Vec<Vec3> + 'a) -> Value<'a> {
    Value::Frames {
        of: Box::new(of),
        beats: false,
    }
}
