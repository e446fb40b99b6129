//! `selvedge info`: what a file or folder is, and what is in it; with a picture, what it looks
//! like.
//!
//! What it is taken for follows from its name and from what it says itself: a folder by the files
//! in it, `.obj` is a mesh, `.npz` an exported run, `.glb` and `.usda` nodes that move; a
//! `.safetensors` file says whether it is a trajectory, a model, states or a checkpoint; a `.toml`
//! file is a data set's preset if it has a `setting`, a training configuration if it has a `batch`,
//! and a scene if it has neither; `.json` is a scene of ARCSim.

mod dataset;
mod exported;
mod folders;
mod mesh;
mod obstacles;
mod picture;
mod plan;

use std::path::Path;

use anyhow::{Context, bail};
use glam::Vec3;
use selvedge_cloth::{Drape, Handles};
use selvedge_data::{
    LoadedScene, MeshFileError, MeshOptions, STATES_FORMAT, StateRun, Trajectory, ending_of,
    metrics, read_mesh, shipped_presets, shipped_scenes,
};
use selvedge_lab::folder::FolderKind;
use selvedge_lab::physics;
use selvedge_model::{MODEL_FORMAT, Model, Network};
use selvedge_train::{CHECKPOINT_FORMAT, TrainConfig};
use serde_json::{Value, json};

use self::picture::Picture;
use crate::cli::InfoArgs;
use crate::failure::wrong;
use crate::output::{Answer, Facts, folded, length, percent};
use crate::{place, scenes};

/// Says what a path is, and draws it where that is wanted.
pub(crate) fn run(args: &InfoArgs) -> anyhow::Result<Answer> {
    let Some(to) = &args.picture else {
        return Ok(look_at(&args.path)?.0);
    };
    if to.extension().is_none() {
        if FolderKind::of(&args.path) == Some(FolderKind::DataSet) {
            return dataset::run(&args.path, Some(to));
        }
        let problem = "--picture: only a data set is drawn into a folder: name a file (.png, .svg)";
        return Err(wrong(problem));
    }
    place::check_file(to, "--picture", &["png", "svg"])?;
    let (answer, picture) = look_at(&args.path)?;
    picture.write(to)?;
    Ok(answer.noting("picture", to))
}

/// An answer, and what there is to draw of its subject.
type Seen = (Answer, Picture);

/// An answer of whose subject there is nothing to draw, and why.
fn bare(answer: Answer, why: String) -> Seen {
    (answer, Picture::Nothing(anyhow::Error::msg(why)))
}

fn look_at(path: &Path) -> anyhow::Result<Seen> {
    let name = path.to_string_lossy();
    let is_shipped = || shipped_scenes().iter().any(|scene| scene.0 == name);
    // A folder with nothing of the program's in it hides no scene.
    let is_other = path.is_dir() && FolderKind::of(path).is_none();
    if (is_other || !path.exists()) && is_shipped() {
        return inspect_scene(scenes::open(&name)?, &name);
    }
    let is_preset = || shipped_presets().iter().any(|preset| preset.0 == name);
    if (is_other || !path.exists()) && is_preset() {
        return Ok(of_configuration(plan::run(&name)?, &name));
    }
    if path.is_dir() {
        return folders::inspect(path);
    }
    if !path.exists() {
        bail!(
            "{name}: there is no such file or folder, and no scene or preset that ships has this name"
        );
    }
    match ending_of(path).as_str() {
        "safetensors" => inspect_container(path),
        "toml" => inspect_toml(path, &name),
        "json" => inspect_scene(scenes::open(&name)?, &name),
        "obj" => mesh::inspect(read_mesh(path, MeshOptions::default())?, path, false),
        "npz" => inspect_trajectory(exported::read_npz(path)?, path),
        "glb" | "usda" | "usdc" | "usdz" | "usd" => {
            match read_mesh(path, MeshOptions::default()) {
                Ok(read) => mesh::inspect(read, path, true),
                Err(error) if matches!(error.source, MeshFileError::Read(_)) => Err(error.into()),
                // What has no mesh to read has nodes, for handles to follow.
                Err(error) => {
                    if !matches!(error.source, MeshFileError::NoMesh) {
                        tracing::warn!("no mesh can be read: {error}");
                    }
                    exported::inspect_rig(path)
                }
            }
        }
        // Refused, with what to export instead.
        "abc" | "mdd" => exported::inspect_rig(path),
        _ => bail!(
            "{name}: not a kind of file that is known: trajectories and models end in .safetensors, scenes, presets and training configurations in .toml, scenes of ARCSim in .json, meshes in .obj, exported runs in .npz, meshes and nodes in .glb, .usda, .usdc, .usdz or .usd, and a data set and a training are folders"
        ),
    }
}

/// A configuration that is no scene.
fn of_configuration(answer: Answer, name: &str) -> Seen {
    let why = "only scenes, and no other configurations, can be drawn";
    bare(answer, format!("{name}: {why}"))
}

fn inspect_toml(path: &Path, name: &str) -> anyhow::Result<Seen> {
    let text =
        selvedge_data::read_text(path).with_context(|| format!("{name}: could not be read"))?;
    // What is no TOML is a scene that says where it is wrong.
    let table: toml::Table = toml::from_str(&text).unwrap_or_default();
    let answer = if table.contains_key("setting") {
        plan::run(name)?
    } else if table.contains_key("batch") {
        inspect_training(&TrainConfig::parse(&text, path)?, name)?
    } else {
        return inspect_scene(scenes::open(name)?, name);
    };
    Ok(of_configuration(answer, name))
}

fn inspect_training(cfg: &TrainConfig, name: &str) -> anyhow::Result<Answer> {
    let mut facts = Facts::new();
    facts.add("kind", "training configuration");
    facts.tell("file", name);
    facts.add("name", &cfg.name);
    facts.add("steps", cfg.steps);
    facts.add("samples per step", cfg.batch.samples);
    facts.add("parameters", Network::new(&cfg.model)?.parameter_count());
    facts.add("encoder", serde_json::to_string(&cfg.model.encoder)?);
    facts.add("latent", cfg.model.latent);
    facts.add("blocks", cfg.model.blocks);
    Ok(facts.answer(json!({ "kind": "training", "config": cfg })))
}

/// A trajectory, or what else the file says that it is.
fn inspect_container(path: &Path) -> anyhow::Result<Seen> {
    let context = || path.display().to_string();
    let bytes = selvedge_data::read_file(path).with_context(context)?;
    let format = format_of(&bytes);
    let answer = match format.as_str() {
        MODEL_FORMAT => inspect_model(&Model::from_bytes(&bytes).with_context(context)?, path)?,
        STATES_FORMAT => inspect_states(&bytes, path)?,
        CHECKPOINT_FORMAT => inspect_checkpoint(bytes.len(), path),
        _ => {
            let trajectory = Trajectory::from_bytes(&bytes).with_context(context)?;
            return inspect_trajectory(trajectory, path);
        }
    };
    let why = "there is nothing to draw of a file of the format";
    let hint = "the folder of a training has curves";
    Ok(bare(
        answer,
        format!("{}: {why} {format}; {hint}", path.display()),
    ))
}

/// The format that a container names in its metadata; empty where it names none.
fn format_of(bytes: &[u8]) -> String {
    let header = selvedge_data::read_header(bytes).ok();
    let format = header.and_then(|header| header.metadata().as_ref()?.get("format").cloned());
    format.unwrap_or_default()
}

/// A checkpoint is read whole only with the data that it was made on.
fn inspect_checkpoint(size: usize, path: &Path) -> Answer {
    let mut facts = Facts::new();
    facts.add("kind", "checkpoint of a training");
    facts.tell_path("file", path);
    facts.add("size", format!("{size} bytes"));
    facts.add("use", "selvedge train with --resume goes on from it");
    facts.answer(json!({ "kind": "checkpoint", "bytes": size }))
}

fn inspect_states(bytes: &[u8], path: &Path) -> anyhow::Result<Answer> {
    let run = StateRun::from_bytes(bytes).with_context(|| path.display().to_string())?;
    let states = &run.states;
    let vertices = states.first().map_or(0, |state| state.positions.len());
    let mut facts = Facts::new();
    facts.add("kind", "states of a run");
    facts.tell_path("file", path);
    facts.tell("vertices", vertices);
    facts.add("states", states.len());
    if let (Some(first), Some(last)) = (states.first(), states.last()) {
        facts.add("frames", format!("{} to {}", first.frame, last.frame));
    }
    let velocities = states.iter().flat_map(|state| &state.velocities);
    let speeds = velocities.map(|v| v.length());
    let fastest = speeds.fold(0.0, f64::max);
    facts.tell_as("largest speed", format!("{fastest:.3} m/s"), fastest);
    let report = json!({
        "kind": "states",
        "frames": states.iter().map(|state| state.frame).collect::<Vec<_>>(),
    });
    Ok(facts.answer(report))
}

fn inspect_trajectory(trajectory: Trajectory, path: &Path) -> anyhow::Result<Seen> {
    let provenance = trajectory.provenance();
    let frames = trajectory.frames();
    let speeds = metrics::speeds(frames, provenance.frame_rate)?;
    let edge = metrics::mean_edge_length(frames, trajectory.topology())?;
    let strain = physics::largest_strain(&trajectory)?;
    let handles = numbers_of(trajectory.handles());
    let duration = (trajectory.frame_count() - 1) as f64 / provenance.frame_rate;
    let scene = provenance.scene["name"].as_str().unwrap_or("none");
    let mut facts = Facts::new();
    facts.tell("kind", "trajectory");
    facts.tell_path("file", path);
    facts.tell_as("scene", scene, &provenance.scene);
    facts.tell("made by", &provenance.made_by);
    facts.add(
        "frames",
        format!(
            "{} at {} per second: {duration:.2} s",
            trajectory.frame_count(),
            provenance.frame_rate
        ),
    );
    facts.tell("vertices", trajectory.vertex_count());
    facts.tell("faces", trajectory.topology().faces().len());
    facts.tell("edges", trajectory.topology().edges().len());
    facts.tell_as("handles", folded(&handles), &handles);
    corners(&mut facts, box_of(trajectory.positions()));
    facts.add(
        "speed",
        format!("mean {:.3} m/s, largest {:.3} m/s", speeds.mean, speeds.max),
    );
    facts.add("mean edge", length(edge));
    facts.tell_as("largest strain", percent(strain), strain);
    let last = trajectory.frame(trajectory.frame_count() - 1);
    let drape = Drape::of(trajectory.cloth(), last);
    if let Some(drape) = &drape {
        let [mean, least, largest] = drape.radius.map(|r| 1e3 * r);
        let text = format!(
            "coefficient {:.3}, {} nodes; radius {mean:.1} mm, {least:.1} to {largest:.1}",
            drape.coefficient, drape.nodes
        );
        facts.tell_as("drape", text, drape);
    }
    obstacles::run_facts(&mut facts, trajectory.obstacles());
    let report = json!({
        "frames": trajectory.frame_count(),
        "frame_rate": provenance.frame_rate,
        "mean_speed": speeds.mean,
        "max_speed": speeds.max,
        "mean_edge_length": edge,
    });
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let picture = Picture::Run(Box::new(trajectory), stem.into_owned());
    Ok((facts.answer(report), picture))
}

fn inspect_model(model: &Model, path: &Path) -> anyhow::Result<Answer> {
    let spec = model.spec();
    let training: Value = serde_json::from_str(&model.training)
        .unwrap_or_else(|_| Value::String(model.training.clone()));
    let weights = model.weights();
    let largest = weights.iter().fold(0.0_f32, |a, w| a.max(w.abs()));
    let mut facts = Facts::new();
    facts.tell("kind", "model");
    facts.tell_path("file", path);
    facts.tell("parameters", weights.len());
    facts.tell_as("largest weight", format!("{largest:.3}"), largest);
    facts.add("encoder", serde_json::to_string(&spec.encoder)?);
    facts.add("latent", spec.latent);
    facts.add("blocks", spec.blocks);
    facts.add(
        "vertex features",
        serde_json::to_string(&spec.node_features)?,
    );
    facts.add("edge features", serde_json::to_string(&spec.edge_features)?);
    facts.tell("training", &training);
    Ok(facts.answer(json!({ "spec": spec })))
}

fn inspect_scene(loaded: LoadedScene, name: &str) -> anyhow::Result<Seen> {
    let scene = &loaded.scene;
    let frames = scene.frame_count()?;
    let handles = numbers_of(&scene.handles);
    let topology = scene.mesh.topology();
    let mut facts = Facts::new();
    facts.tell("kind", "scene");
    facts.tell("file", name);
    facts.add("name", &scene.name);
    facts.tell("vertices", topology.vertex_count());
    facts.tell("faces", topology.faces().len());
    mesh::size(&mut facts, &scene.mesh);
    mesh::facts(&mut facts, &scene.mesh, !loaded.is_own_shape);
    facts.add("handles", folded(&handles));
    facts.add(
        "material",
        format!("{}, {} kg/m²", scene.material.name, scene.material.density),
    );
    facts.add(
        "motion",
        format!(
            "{frames} frames at {} per second: {:.2} s",
            scene.frame_rate,
            frames as f64 / scene.frame_rate
        ),
    );
    facts.add(
        "physics",
        format!("{} substeps per frame", scene.physics.substeps),
    );
    let contact = scene.contact.as_ref();
    obstacles::scene_facts(&mut facts, contact, &scene.obstacles);
    let report = json!({
        "frames": frames,
        "warnings": loaded.warnings,
        "scene": loaded.spec.to_json()?,
    });
    let held = scene.handles.vertices().to_vec();
    let picture = Picture::Still(Box::new(scene.mesh.clone()), held, scene.obstacles.clone());
    Ok((facts.answer(report), picture))
}

/// Adds the lowest and the highest corner of a box.
fn corners(facts: &mut Facts, (low, high): (Vec3, Vec3)) {
    facts.add("from", format!("{low} m"));
    facts.add("to", format!("{high} m"));
    facts.note("lowest_corner", low.to_array());
    facts.note("highest_corner", high.to_array());
}

/// The sides of a box along x, y and z, in words.
fn sides(low: Vec3, high: Vec3) -> String {
    let sides = (high - low).to_array().map(|side| length(side.into()));
    sides.join(" × ")
}

/// The shortest, the mean and the longest of some lengths `[m]`, in words.
fn shortest_mean_longest(lengths: impl Iterator<Item = f64>) -> String {
    let (mut count, mut sum) = (0.0, 0.0);
    let (mut shortest, mut longest) = (f64::INFINITY, 0.0_f64);
    for length in lengths {
        (count, sum) = (count + 1.0, sum + length);
        (shortest, longest) = (shortest.min(length), longest.max(length));
    }
    format!(
        "{} at least, {} on average, {} at most",
        length(shortest),
        length(sum / count),
        length(longest)
    )
}

/// Numbers of the held vertices.
fn numbers_of(handles: &Handles) -> Vec<u32> {
    handles.vertices().iter().map(|vertex| vertex.0).collect()
}

/// The smallest box with sides along the axes that holds `positions`.
fn box_of(positions: &[Vec3]) -> (Vec3, Vec3) {
    let first = positions.first().copied().unwrap_or_default();
    positions
        .iter()
        .fold((first, first), |(low, high), p| (low.min(*p), high.max(*p)))
}
