//! Start of the search for a rest pose: the scene in still air with the handles that hold at first,
//! and its mesh with a smooth bulge.

use glam::DVec3;
use selvedge_cloth::geometry::{area_vector, exp, extent};
use selvedge_cloth::{Handles, Scene, SceneError};

use super::SagError;

/// The scene at its start, in still air, without contact and the damping of its fabrics, with only the
/// handles that hold then. In a sheet without one, all vertices become handles.
pub(super) fn scene_at_start(scene: &Scene) -> Result<Scene, SagError> {
    let mut scene = scene.clone();
    scene.environment.wind = DVec3::ZERO;
    scene.environment.gust = None;
    scene.contact = None;
    scene.obstacles.clear();
    // Only the motion on the way to rest can be damped.
    scene.material.damping = 0.0;
    for fabric in scene.fabrics.values_mut() {
        fabric.damping = 0.0;
    }
    let released = scene
        .schedule
        .released(0, scene.frame_rate, scene.handles.len());
    scene.schedule.releases.clear();
    let holds: Vec<bool> = released.iter().map(|released| !released).collect();
    scene.handles = scene.handles.subset(&holds);
    if scene.handles.is_empty() {
        return Err(SagError::NoHandles);
    }
    let sheets = scene.mesh.topology().sheets();
    let mut is_held = vec![false; sheets.len()];
    for vertex in scene.handles.vertices() {
        is_held[sheets[vertex.index()] as usize] = true;
    }
    let free = (0_u32..)
        .zip(&sheets)
        .filter(|(_, sheet)| !is_held[**sheet as usize]);
    let mut held: Vec<u32> = scene.handles.vertices().iter().map(|v| v.0).collect();
    let handle_count = held.len();
    held.extend(free.map(|(vertex, _)| vertex));
    if held.len() > handle_count {
        scene.handles = Handles::new(&held, sheets.len()).map_err(SceneError::from)?;
    }
    Ok(scene)
}

/// Start positions with the bulge of the scene along the normals `[m]`, `[vertices]`.
pub(super) fn bulged(scene: &Scene) -> Vec<DVec3> {
    let mesh = &scene.mesh;
    let heights = bulge_profile(scene);
    let mut normals = vec![DVec3::ZERO; mesh.positions().len()];
    for face in mesh.topology().faces() {
        let [a, b, c] = face.map(|v| mesh.positions()[v.index()]);
        for vertex in face {
            normals[vertex.index()] += area_vector(a, b, c);
        }
    }
    mesh.positions()
        .iter()
        .zip(normals)
        .zip(heights)
        .map(|((position, normal), height)| {
            *position + normal.normalize_or_zero() * (height * scene.sag.bulge)
        })
        .collect()
}

/// Bump on each sheet around the middle of its handles, at most 1 and 0 at each handle; 0 on a
/// sheet whose vertices are all handles. `[vertices]`
fn bulge_profile(scene: &Scene) -> Vec<f64> {
    let sheets = scene.mesh.topology().sheets();
    let count = sheets.iter().max().map_or(0, |last| last + 1);
    let mut heights = vec![0.0; sheets.len()];
    for sheet in 0..count {
        let of_sheet = |v: &usize| sheets[*v] == sheet;
        let vertices: Vec<usize> = (0..sheets.len()).filter(of_sheet).collect();
        let handles = scene.handles.vertices().iter().map(|v| v.index());
        let handles: Vec<usize> = handles.filter(of_sheet).collect();
        if handles.len() < vertices.len() {
            for (v, height) in vertices.iter().zip(bump(scene, &vertices, &handles)) {
                heights[*v] = height;
            }
        }
    }
    heights
}

/// Bump of one sheet with these `vertices` and `handles`, `[vertices]`.
fn bump(scene: &Scene, vertices: &[usize], handles: &[usize]) -> Vec<f64> {
    let at = places_of(scene);
    let places: Vec<DVec3> = vertices.iter().map(|&v| at[v]).collect();
    let size = extent(&places).max_element();
    let handles: Vec<DVec3> = handles.iter().map(|&v| at[v]).collect();
    let middle = handles.iter().sum::<DVec3>() / handles.len() as f64;
    let mut heights: Vec<f64> = places
        .iter()
        .map(|place| {
            let bump = exp(-(place.distance(middle) / (0.6 * size)).powi(2));
            let clear =
                |handle: &DVec3| 1.0 - exp(-(place.distance(*handle) / (0.2 * size)).powi(2));
            bump * handles.iter().map(clear).product::<f64>()
        })
        .collect();
    let highest = heights.iter().copied().fold(0.0, f64::max);
    if highest > 0.0 {
        heights.iter_mut().for_each(|height| *height /= highest);
    }
    heights
}

/// Longest side of the mesh's box in material space, of a sewn one in the world `[m]`.
pub(super) fn sheet_size(scene: &Scene) -> f64 {
    extent(&places_of(scene)).max_element()
}

/// Places of the vertices in material space; of a sewn mesh, whose panels lie anywhere there, in
/// the world `[m]`, `[vertices]`.
fn places_of(scene: &Scene) -> Vec<DVec3> {
    let pattern = scene.mesh.pattern();
    if pattern.is_sewn() {
        return scene.mesh.positions().to_vec();
    }
    pattern.points().iter().map(|p| p.extend(0.0)).collect()
}
