//! The stage of a trajectory.

use glam::Vec3;

use super::super::take::{Body, Take, extent};
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

/// The cloth.
fn sheet<'a>(take: &'a Take<'a>) -> Prim<'a> {
    let body = take.sheet();
    let mut mesh = mesh(&body, COLOUR, "/cloth");
    if let Some(texture) = take.trajectory.cloth().texture_points() {
        let (corners, how) = if texture.is_sewn() {
            (texture.faces().flatten().collect(), "faceVarying")
        } else {
            (texture.points().to_vec(), "vertex")
        };
        mesh.add("texCoord2f[]", "primvars:st", Value::Pairs(corners))
            .interpolation = Some(how);
    }
    let rest = Value::Triples(take.rest_positions());
    mesh.add("point3f[]", "primvars:rest", rest).interpolation = Some("vertex");
    let numbers = Value::Whole(take.handle_numbers());
    mesh.add("int[]", "primvars:handle", numbers).interpolation = Some("vertex");
    add_points(take, &body, &mut mesh);
    if take.normals {
        let normals = frames(move |number| take.normals_at(&body.positions(number)));
        mesh.add("normal3f[]", "normals", normals).interpolation = Some("vertex");
    }
    mesh
}

fn obstacles<'a>(take: &'a Take<'a>) -> Option<Prim<'a>> {
    let obstacles = take.obstacles();
    if obstacles.is_empty() {
        return None;
    }
    let mut root = Prim::new("obstacles", "Xform");
    for body in obstacles {
        let mut mesh = mesh(&body, GREY, "/obstacles");
        add_points(take, &body, &mut mesh);
        root.children.push(mesh);
    }
    root.children.push(materials("/obstacles", GREY));
    Some(root)
}

/// Adds points, their extent and their velocities.
fn add_points<'a>(take: &'a Take<'a>, body: &Body<'a>, mesh: &mut Prim<'a>) {
    if body.is_still() {
        let points = body.positions(0);
        let corners = extent(&points).to_vec();
        mesh.add("point3f[]", "points", Value::Triples(points));
        mesh.add("float3[]", "extent", Value::Triples(corners));
        return;
    }
    let own = body.clone();
    let points = move |number| {
        let points = own.positions(number);
        if own.track.is_none() {
            (take.beat)()?;
        }
        Ok(points)
    };
    mesh.add("point3f[]", "points", Value::Frames(Box::new(points)));
    let own = body.clone();
    let boxes = frames(move |number| extent(&own.positions(number)).to_vec());
    mesh.add("float3[]", "extent", boxes);
    if body.has_velocities() {
        let own = body.clone();
        let velocities = frames(move |number| own.velocities(number));
        mesh.add("vector3f[]", "velocities", velocities);
    }
}

/// A mesh that is seen from both sides, without points, bound to the material below `root`.
fn mesh<'a>(body: &Body<'_>, colour: Vec3, root: &str) -> Prim<'a> {
    let faces = body.faces();
    let mut mesh = Prim::new(&*body.name, "Mesh");
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
        .interpolation = Some("constant");
    mesh.applies.push(BINDS);
    let target = Value::Target(format!("{root}/materials/matte"));
    mesh.add("", "material:binding", target);
    mesh
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
    Value::Frames(Box::new(move |number| Ok(of(number))))
}
