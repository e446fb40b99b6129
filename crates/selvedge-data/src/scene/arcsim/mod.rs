//! Scenes of ARCSim (Narain et al. 2012, 2013) as they are: its JSON, in which `//` comments are
//! allowed.
//!
//! Read are one cloth (mesh, transform, material), the held nodes and their motions, obstacles and
//! what contact with them needs, gravity, wind, and the times. Such a scene is run as ARCSim runs
//! it: from where the mesh stands, in its mode of the physics. A key that has no counterpart here
//! is named in a warning, as is a part of ARCSim that the scene does not disable and that Selvedge
//! lacks; a wrong value is an error that names its key. Files are looked for beside the scene and
//! then in the working directory.

mod cloth;
mod contact;
mod drive;
mod object;
mod parts;
mod shared;

use self::object::{Object, parse_json};
use self::parts::Parts;
use self::shared::Times;
use super::file::moving_mesh;
use super::loaded::LoadedScene;
use super::mesh_spec::BuiltMesh;
use super::problem::SceneProblem;
use super::spec::{SceneSpec, SceneSpecError, Setting};
use super::start::StartSpec;
use selvedge_cloth::{Environment, Motion, SagSettings};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;

/// Seconds that a scene lasts that does not say how long.
const DEFAULT_SECONDS: f64 = 10.0;

/// Frame times `[s]` and solves per frame that can be run.
const FRAME_TIMES: RangeInclusive<f64> = 1e-5..=1.0;

const MOST_STEPS: u32 = 1000;

/// Largest gravity `[m/s²]` and wind `[m/s]`, and the ranges of air density and drag.
const STRONGEST_GRAVITY: f64 = 1e6;

const FASTEST_WIND: f64 = 1e3;

const AIR: RangeInclusive<f64> = 0.0..=1e6;

/// Reads a scene from the text of its file; paths in it are relative to `folder`.
///
/// # Errors
/// [`SceneProblem`] names the key and what is wrong.
pub(super) fn parse_arcsim(
    text: &str,
    folder: &Path,
    name: &str,
) -> Result<LoadedScene, SceneProblem> {
    let json = parse_json(text)?;
    let mut warnings = Vec::new();
    let mut scene = Object::new(&json, String::new())?;
    let parts = Parts::of(&mut scene, &mut warnings)?;
    let cloth = cloth::read(&mut scene, folder, &parts, &mut warnings)?;
    let times = read_times(&mut scene, &mut warnings)?;
    let drive = drive::read(&mut scene, &times, &mut warnings)?;
    let contact = contact::read(&mut scene, folder, &parts, &times, &mut warnings)?;
    let setting = Setting {
        mesh: cloth.mesh.clone(),
        handles: drive.vertices,
        schedule: drive.schedule,
        material: cloth.material.clone(),
        fabrics: BTreeMap::new(),
        environment: read_environment(&mut scene, &mut warnings)?,
        physics: times.physics(),
        sag: SagSettings::default(),
        frame_rate: 1.0 / times.frame_time,
        contact: contact.settings,
        obstacles: contact.obstacles,
    };
    parts.finish(&mut scene, &mut warnings)?;
    scene.finish(&mut warnings);
    let mut spec = SceneSpec {
        name: name.to_owned(),
        setting,
        motion: Motion::Splines(drive.motion),
        start: StartSpec::Mesh,
    };
    let mut files = spec.files(folder);
    files.extend_from_slice(&cloth.material_files);
    let BuiltMesh {
        sheet,
        velocities,
        warnings: mended,
        ..
    } = spec
        .setting
        .mesh
        .read(folder)
        .map_err(SceneSpecError::from)?;
    warnings.extend(mended);
    spec.setting.fabrics = cloth.fabrics(&sheet.mesh.fabrics().names, &mut warnings);
    let state = moving_mesh(&spec.start, &sheet.mesh, velocities);
    let scene = spec.with_mesh(sheet.mesh, folder)?;
    let loaded = LoadedScene {
        state,
        warnings,
        files,
        ..LoadedScene::new(spec, scene)
    };
    Ok(loaded.looked_over("scale the texture coordinates of the mesh's file"))
}

fn read_times(scene: &mut Object<'_>, warnings: &mut Vec<String>) -> Result<Times, SceneProblem> {
    let frame_time = scene
        .number_within("frame_time", &FRAME_TIMES)?
        .ok_or_else(|| scene.missing("frame_time"))?;
    let steps = scene.whole("frame_steps")?.unwrap_or(1);
    let substeps = match u32::try_from(steps) {
        Ok(steps @ 1..=MOST_STEPS) => steps,
        _ => return Err(scene.wrong("frame_steps", "must be 1 to 1000", &steps)),
    };
    let end = scene.whole("end_frame")?.map(|n| n as f64 * frame_time);
    let ends = [
        scene.number("end_time")?,
        end,
        // Old scenes of ARCSim say it so.
        scene.number("duration")?,
    ];
    let duration = match ends.into_iter().flatten().reduce(f64::min) {
        Some(duration) => duration,
        None => {
            warnings.push(format!(
                "neither end_time nor end_frame says how long the scene lasts: {DEFAULT_SECONDS} s are taken"
            ));
            DEFAULT_SECONDS
        }
    };
    Ok(Times {
        frame_time,
        substeps,
        duration,
    })
}

fn read_environment(
    scene: &mut Object<'_>,
    warnings: &mut Vec<String>,
) -> Result<Environment, SceneProblem> {
    let mut environment = Environment {
        gravity: scene
            .vector_up_to("gravity", STRONGEST_GRAVITY)?
            .unwrap_or_default(),
        ..Environment::default()
    };
    if let Some(mut wind) = scene.child("wind")? {
        let velocity = wind.vector_up_to("velocity", FASTEST_WIND)?;
        environment.wind = velocity.unwrap_or_default();
        environment.air_density = wind.number_within("density", &AIR)?.unwrap_or(1.0);
        environment.air_drag = wind.number_within("drag", &AIR)?.unwrap_or(0.0);
        wind.finish(warnings);
    }
    Ok(environment)
}

#[cfg(test)]
mod tests;
