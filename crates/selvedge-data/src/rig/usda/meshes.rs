//! The meshes of a USD stage: points, faces and texture coordinates, and the subsets of faces that
//! have a material of their own.
//!
//! Texture coordinates are `primvars:st`, or the only array of the type `texCoord2f`, with or
//! without indices, per corner of a face or per point; which of the two their number says.
//!
//! Format: the USD documentation, `UsdGeomMesh`, `UsdGeomPrimvar` and `UsdGeomSubset`.

use std::collections::HashSet;

use glam::{DVec2, DVec3};

use super::super::mesh::{Face, RigMesh};
use super::super::node::RigError;
use super::prim::{Absence, Prim};

pub(super) const POINTS: &str = "points";
const COUNTS: &str = "faceVertexCounts";
const INDICES: &str = "faceVertexIndices";
const SUBSET: &str = "indices";
const HOLES: &str = "holeIndices";
const TEXTURE: &str = "texture";
const TEXTURE_INDICES: &str = "texture indices";
const ORIENTED: &str = "st";

/// Types of prims that have a shape but no mesh.
const SHAPES: [&str; 10] = [
    "Sphere",
    "Cube",
    "Cylinder",
    "Cone",
    "Capsule",
    "Plane",
    "BasisCurves",
    "NurbsPatch",
    "TetMesh",
    "HermiteCurves",
];

/// The name under which a property of this type and name is kept; none if no mesh needs it.
pub(super) fn array_of(kind: &str, name: &str) -> Option<String> {
    if [POINTS, COUNTS, INDICES, SUBSET, HOLES].contains(&name) {
        return Some(name.to_owned());
    }
    let variable = name.strip_prefix("primvars:")?;
    match variable.strip_suffix(":indices") {
        Some(of) => Some(format!("{TEXTURE_INDICES} {of}")),
        None if variable == ORIENTED || kind.starts_with("texCoord2") => {
            Some(format!("{TEXTURE} {variable}"))
        }
        None => None,
    }
}

/// Returns true where a property of this name is of a skeleton or of blend shapes.
pub(super) fn is_of_skeleton(name: &str) -> bool {
    name.strip_prefix("primvars:")
        .unwrap_or(name)
        .starts_with("skel:")
}

/// The meshes of these prims that are seen; what is left out is said in `warnings`.
pub(super) fn meshes(
    prims: &[Prim],
    is_cloth: bool,
    warnings: &mut Vec<String>,
) -> Result<Vec<RigMesh>, RigError> {
    let absences = absences(prims);
    check_is_whole(prims, &absences)?;
    warnings.extend(left_out(prims, &absences));
    let is_seen = |&k: &usize| prims[k].kind == "Mesh" && absences[k].is_none();
    let seen: Vec<usize> = (0..prims.len()).filter(is_seen).collect();
    let (empty, mut whole): (Vec<usize>, Vec<usize>) =
        seen.iter().partition(|&&k| is_empty(&prims[k]));
    if whole.is_empty() {
        // Where all are empty, the error says which array the first lacks.
        whole = seen;
    } else {
        let what = "meshes have no points or no faces, or values of another type for them, and are left out";
        warnings.extend(warning(prims, what, &empty));
    }
    let made = whole.into_iter().map(|node| {
        let mut mesh = mesh(&prims[node], node, is_cloth, warnings)?;
        take_fabrics(&mut mesh, prims);
        cut_holes(&mut mesh, prims[node].array(HOLES).unwrap_or_default());
        Ok(mesh)
    });
    made.collect()
}

/// Checks that no prim that is seen brings meshes from elsewhere.
fn check_is_whole(prims: &[Prim], absences: &[Option<Absence>]) -> Result<(), RigError> {
    let seen = prims.iter().zip(absences).filter(|(_, why)| why.is_none());
    for (prim, _) in seen {
        let instancer = (prim.kind == "PointInstancer")
            .then_some("its instances are not read: export them as meshes");
        let is_of_looks = ["Material", "Shader", "NodeGraph"].contains(&prim.kind.as_str());
        let composed = prim.composed.as_deref().filter(|_| !is_of_looks);
        if let Some(problem) = composed.or(instancer) {
            return Err(RigError::node(&prim.name, problem));
        }
    }
    Ok(())
}

/// The warning that these prims are left out or read otherwise than meant; none of no prims.
fn warning(prims: &[Prim], what: &str, which: &[usize]) -> Option<String> {
    let first = &prims[*which.first()?].name;
    Some(format!("{} {what}, the first is {first:?}", which.len()))
}

/// Warnings of what is not seen, and of what changes how a mesh that is seen looks.
fn left_out(prims: &[Prim], absences: &[Option<Absence>]) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut warn = |what: &str, is_meant: &dyn Fn(usize, &Prim) -> bool| {
        let which = (0..prims.len()).filter(|&k| is_meant(k, &prims[k]));
        warnings.extend(warning(prims, what, &which.collect::<Vec<_>>()));
    };
    let is_mesh = |prim: &Prim| prim.kind == "Mesh";
    for (whys, how) in [
        (
            [Absence::Invisible, Absence::StandsIn],
            "invisible, guides or proxies",
        ),
        ([Absence::Inactive; 2], "inactive (active = false)"),
        (
            [Absence::Undefined; 2],
            "in an over of what this file does not define",
        ),
    ] {
        warn(&format!("meshes are {how} and are left out"), &|k, prim| {
            is_mesh(prim) && absences[k].is_some_and(|why| whys.contains(&why))
        });
    }
    let is_seen = |k: usize| absences[k].is_none();
    warn(
        "prims are shapes without a mesh, which are not read: export meshes",
        &|k, prim| SHAPES.contains(&prim.kind.as_str()) && is_seen(k),
    );
    warn(
        "meshes have a skeleton or blend shapes, which are not read, and stand as their points are: bake them to points, or export .glb",
        &|k, prim| is_mesh(prim) && prim.is_skinned && is_seen(k),
    );
    warn(
        "meshes are subdivision surfaces and are read as their cages: apply the subdivision before the export, or write subdivisionScheme = \"none\"",
        &|k, prim| is_mesh(prim) && !prim.is_polygonal && is_seen(k),
    );
    let mut is_timed: Vec<bool> = Vec::with_capacity(prims.len());
    for prim in prims {
        is_timed.push(prim.is_timed || prim.parent.is_some_and(|parent| is_timed[parent]));
    }
    warn(
        "meshes have a visibility that changes in time, which is not read, and are there all the time",
        &|k, prim| is_mesh(prim) && is_seen(k) && is_timed[k],
    );
    warnings
}

/// Returns true where a prim has not all that makes a mesh.
fn is_empty(prim: &Prim) -> bool {
    let has = |name: &str| prim.array(name).is_some_and(|array| array.len() > 2);
    !(has(POINTS) && prim.array(COUNTS).is_some() && has(INDICES))
}

/// Gives faces the materials of the subsets that they belong to.
fn take_fabrics(mesh: &mut RigMesh, prims: &[Prim]) {
    let within = prims.iter().filter(|prim| prim.parent == Some(mesh.node));
    for subset in within.filter(|prim| prim.kind == "GeomSubset") {
        for &face in subset.array(SUBSET).unwrap_or_default() {
            if let Some(face) = mesh.faces.get_mut(face as usize) {
                face.fabric = Some(subset.name.clone());
            }
        }
    }
}

/// Leaves out the faces of these numbers.
fn cut_holes(mesh: &mut RigMesh, holes: &[f64]) {
    let holes: HashSet<usize> = holes.iter().map(|&hole| hole as usize).collect();
    let mut numbers = 0..;
    mesh.faces
        .retain(|_| numbers.next().is_none_or(|number| !holes.contains(&number)));
}

/// Reasons why prims are not seen, with all that is in them; no proxy is seen where there is what
/// is to be rendered in its place.
fn absences(prims: &[Prim]) -> Vec<Option<Absence>> {
    let mut found: Vec<Option<Absence>> = Vec::with_capacity(prims.len());
    let mut purposes: Vec<Option<&str>> = Vec::with_capacity(prims.len());
    // Parents come before their children.
    for prim in prims {
        let above = prim.parent.and_then(|parent| found[parent]);
        found.push(prim.absence.max(above));
        let own = prim.purpose.as_deref();
        purposes.push(own.or_else(|| purposes[prim.parent?]));
    }
    let has_renders = purposes.contains(&Some("render"));
    let stands_in =
        |purpose: Option<&str>| purpose == Some("guide") || has_renders && purpose == Some("proxy");
    let pairs = found.into_iter().zip(purposes);
    pairs
        .map(|(why, purpose)| why.max(stands_in(purpose).then_some(Absence::StandsIn)))
        .collect()
}

/// Moves the points of a mesh by the samples of its prim; time codes are `rate` per second.
pub(super) fn move_points(mesh: &mut RigMesh, prim: &mut Prim, rate: f64) -> Result<(), RigError> {
    let samples = prim.take_samples(POINTS);
    if samples.is_empty() {
        return Ok(());
    }
    let wrong = |problem: String| RigError::node(&prim.name, problem);
    let expected = mesh.positions.len();
    let mut frames = Vec::with_capacity(samples.len());
    let mut times = Vec::with_capacity(samples.len());
    for (code, numbers) in samples {
        if numbers.len() != 3 * expected {
            return Err(wrong(format!(
                "it has {} points at time code {code} and {expected} at the first: their number must not change",
                numbers.len() / 3
            )));
        }
        times.push(code / rate);
        frames.push(numbers.chunks_exact(3).map(DVec3::from_slice).collect());
    }
    let sampled = mesh.sample(times, frames);
    sampled.map_err(|problem| wrong(format!("the samples of its points {problem}")))
}

fn mesh(
    prim: &Prim,
    node: usize,
    is_cloth: bool,
    warnings: &mut Vec<String>,
) -> Result<RigMesh, RigError> {
    let wrong = |problem: String| RigError::node(&prim.name, problem);
    let array = |name: &str| {
        let found = prim.array(name);
        found.ok_or_else(|| wrong(format!("its mesh has no {name}")))
    };
    let positions = array(POINTS)?.chunks_exact(3).map(DVec3::from_slice);
    let positions: Vec<DVec3> = positions.collect();
    let counts = array(COUNTS)?;
    let indices: Vec<u32> = array(INDICES)?.iter().map(|&v| v as u32).collect();
    let total: f64 = counts.iter().sum();
    if total != indices.len() as f64 {
        return Err(wrong(format!(
            "{COUNTS} sum to {total}, but {INDICES} has {}",
            indices.len()
        )));
    }
    let texture = match texture(prim, &indices, positions.len()) {
        Err(problem) if !is_cloth => {
            let problem = wrong(format!("{problem}: passed over, for a body needs none"));
            warnings.push(problem.to_string());
            Vec::new()
        }
        read => read.map_err(wrong)?,
    };
    let mut start = 0_usize;
    let faces = counts.iter().map(|&count| {
        let own = start..start.saturating_add(count as usize).min(indices.len());
        start = own.end;
        Face {
            corners: indices[own.clone()].to_vec(),
            texture: texture.get(own).unwrap_or_default().to_vec(),
            fabric: None,
        }
    });
    Ok(RigMesh {
        node,
        faces: faces.collect(),
        positions,
        ..RigMesh::default()
    })
}

/// Texture coordinates of `corners`; none where there are none.
fn texture(prim: &Prim, corners: &[u32], points: usize) -> Result<Vec<DVec2>, String> {
    let sets = prim.attributes.iter();
    let mut sets: Vec<&str> = sets
        .filter_map(|set| set.name.strip_prefix(TEXTURE)?.strip_prefix(' '))
        .filter(|name| !name.starts_with("indices "))
        .collect();
    sets.sort_by_key(|name| (*name != ORIENTED, *name));
    sets.dedup();
    let Some(&name) = sets.first() else {
        return Ok(Vec::new());
    };
    if sets.len() > 1 && name != ORIENTED {
        return Err(format!(
            "it has the texture coordinates [{}]: call those of the pattern st",
            sets.join(", ")
        ));
    }
    let values = prim.array(&format!("{TEXTURE} {name}")).unwrap_or_default();
    let values: Vec<DVec2> = values.chunks_exact(2).map(DVec2::from_slice).collect();
    let place = |number: f64| values.get(number as usize).copied();
    let values: Option<Vec<DVec2>> = match prim.array(&format!("{TEXTURE_INDICES} {name}")) {
        Some(indices) => indices.iter().map(|&number| place(number)).collect(),
        None => Some(values.clone()),
    };
    let values = values.ok_or("an index of its texture coordinates has no value")?;
    if values.len() == corners.len() {
        return Ok(values);
    }
    if values.len() != points {
        return Err(format!(
            "it has {} texture coordinates, for {} corners of faces and {points} points",
            values.len(),
            corners.len()
        ));
    }
    let at = |&v: &u32| values.get(v as usize).copied().unwrap_or_default();
    Ok(corners.iter().map(at).collect())
}
