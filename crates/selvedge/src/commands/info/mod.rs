//! `selvedge info`: what a file or folder is, and what is in it; with a picture, what it looks
//! like. Everything is told as one JSON object, which people read as a list.
//!
//! What it is taken for follows from its name and from what it says itself: a folder by the files
//! in it, `.obj` is a mesh, `.npz` an exported run, `.glb` and `.usda` nodes that move; a
//! `.safetensors` file says whether it is a trajectory, a model, states or a checkpoint; a `.toml`
//! file is a data set's preset if it has a `setting`, a training configuration if it has a `batch`,
//! and a scene if it has neither; `.json` is a scene of ARCSim.

mod described;
mod listing;
mod picture;

use std::path::Path;

use anyhow::{Context, bail};
use selvedge_cloth::{Drape, Handles};
use selvedge_data::{
    DatasetPreset, LoadedScene, STATES_FORMAT, Split, StateRun, Trajectory, ending_of, metrics,
    read_file, shipped_presets, shipped_scenes,
};
use selvedge_lab::folder::FolderKind;
use selvedge_lab::report::training_log;
use selvedge_lab::{generation, physics};
use selvedge_model::{MODEL_FORMAT, Model, Network};
use selvedge_train::{CHECKPOINT_FORMAT, TrainConfig, files};
use serde_json::{Map, Value, json};

use self::described::{mesh_file, of_mesh, of_obstacle, size};
use self::picture::Picture;
use crate::cli::InfoArgs;
use crate::output::Answer;
use crate::progress::Progress;
use crate::{interrupt, place, scenes};

/// Says what a path is, and draws it where that is wanted.
pub(crate) fn run(args: &InfoArgs) -> anyhow::Result<Answer> {
    if let Some(to) = &args.picture {
        place::check_file(to, "--picture", &["png"])?;
    }
    let (mut report, picture) = look_at(&args.path)?;
    let Some(known) = report.as_object_mut() else {
        bail!("a report is an object");
    };
    known.insert("file".to_owned(), args.path.to_string_lossy().into());
    let answer = Answer::new(listing::listed(known), report);
    let Some(to) = &args.picture else {
        return Ok(answer);
    };
    picture.write(&args.path, to)?;
    Ok(answer.noting("picture", to))
}

/// A report, and what there is to draw of its subject.
type Seen = (Value, Picture);

/// A report of whose subject there is nothing to draw.
fn undrawn(report: Value) -> Seen {
    (report, Picture::Nothing)
}

/// One object with the keys of all; what comes later wins.
fn joined(objects: impl IntoIterator<Item = Value>) -> Value {
    let mut all = Map::new();
    for object in objects {
        if let Value::Object(own) = object {
            all.extend(own);
        }
    }
    all.into()
}

fn look_at(path: &Path) -> anyhow::Result<Seen> {
    let name = path.to_string_lossy();
    let is_in = |shipped: &[(&str, &str)]| shipped.iter().any(|thing| thing.0 == name);
    // A folder with nothing of the program's in it hides no scene.
    if !path.exists() || (path.is_dir() && FolderKind::of(path).is_none()) {
        if is_in(shipped_scenes()) {
            return scene(scenes::open(&name)?);
        }
        if is_in(shipped_presets()) {
            return Ok(undrawn(preset(&name)?));
        }
    }
    if path.is_dir() {
        return Ok(undrawn(of_folder(path)?));
    }
    if !path.exists() {
        bail!(
            "{name}: there is no such file or folder, and no scene or preset that ships has this name"
        );
    }
    match ending_of(path).as_str() {
        "safetensors" => container(path),
        "toml" => of_toml(path, &name),
        "json" => scene(scenes::open(&name)?),
        "obj" => mesh_file(path, false),
        "npz" => run_of(Trajectory::from_npz(&bytes_of(path)?).with_context(|| name.to_string())?),
        // The last two are refused, with what to export instead.
        "glb" | "usda" | "usdc" | "usdz" | "usd" | "abc" | "mdd" => mesh_file(path, true),
        _ => bail!(
            "{name}: not a kind of file that is known: trajectories and models end in .safetensors, scenes, presets and training configurations in .toml, scenes of ARCSim in .json, meshes in .obj, exported runs in .npz, meshes and nodes in .glb, .usda, .usdc, .usdz or .usd, and a data set and a training are folders"
        ),
    }
}

fn bytes_of(path: &Path) -> anyhow::Result<Vec<u8>> {
    read_file(path).with_context(|| path.display().to_string())
}

fn text_of(path: &Path) -> anyhow::Result<String> {
    let text = selvedge_data::read_text(path);
    text.with_context(|| format!("{}: could not be read", path.display()))
}

fn of_toml(path: &Path, name: &str) -> anyhow::Result<Seen> {
    let text = text_of(path)?;
    // What is no TOML is a scene that says where it is wrong.
    let table: toml::Table = toml::from_str(&text).unwrap_or_default();
    if table.contains_key("setting") {
        return Ok(undrawn(preset(name)?));
    }
    if !table.contains_key("batch") {
        return scene(scenes::open(name)?);
    }
    let config = TrainConfig::parse(&text, path)?;
    Ok(undrawn(json!({
        "kind": "training",
        "name": config.name,
        "steps": config.steps,
        "parameters": Network::new(&config.model)?.parameter_count(),
        "model": config.model,
        "config": config,
    })))
}

/// What a preset will make, without simulating anything.
fn preset(name: &str) -> anyhow::Result<Value> {
    let preset = DatasetPreset::open(name)?;
    for warning in preset.warnings() {
        tracing::warn!("{name}: {warning}");
    }
    let (config, forecast) = (preset.config(), preset.forecast());
    Ok(json!({
        "kind": "preset",
        "name": config.name,
        "material": config.setting.material.name,
        "config": config,
        "frames": forecast.frames(),
        "positions": forecast.positions(),
        // Positions are three numbers of four bytes; all else is small beside them.
        "gigabytes": 12.0 * forecast.positions() as f64 / 1e9,
        "samples": forecast.samples(),
        "forecast": forecast,
    }))
}

fn of_folder(folder: &Path) -> anyhow::Result<Value> {
    match FolderKind::of(folder) {
        Some(FolderKind::DataSet) => data_set(folder),
        Some(FolderKind::Training) => training(folder),
        Some(kind) => bail!(
            "{}: holds {kind}, of which only the files are inspected: name one of them",
            folder.display()
        ),
        None => bail!(
            "{}: is no folder that Selvedge makes: a data set has an index.json, a training a {}",
            folder.display(),
            files::LOG
        ),
    }
}

/// A data set, of which every file is read and checked against its hash.
fn data_set(folder: &Path) -> anyhow::Result<Value> {
    let set = generation::open(folder)?;
    let entries = || Split::BOTH.into_iter().flat_map(|split| set.entries(split));
    let progress = Progress::new("reading", entries().count(), "trajectories");
    for entry in entries() {
        if interrupt::requested() {
            bail!("interrupted before every trajectory was read");
        }
        set.read(entry)?;
        progress.advance();
    }
    Ok(joined([
        serde_json::to_value(set.index())?,
        json!({ "kind": "dataset", "hashes": "all right" }),
    ]))
}

fn training(folder: &Path) -> anyhow::Result<Value> {
    let path = folder.join(files::CONFIG);
    let config = TrainConfig::parse(&text_of(&path)?, &path)?;
    let log = training_log(&folder.join(files::LOG))?;
    let [first, last] = [log.first(), log.last()];
    let is_there = |name: &&str| folder.join(name).exists();
    let there = [files::MODEL, files::CHECKPOINT]
        .into_iter()
        .filter(is_there);
    Ok(json!({
        "kind": "training-folder",
        "name": config.name,
        "steps": config.steps,
        "steps_logged": last.map_or(0, |row| row.step),
        "first_loss": first.map(|row| row.loss),
        "last_loss": last.map(|row| row.loss),
        "last_learning_rate": last.map(|row| row.learning_rate),
        "files": there.collect::<Vec<_>>(),
        "config": config,
    }))
}

/// A trajectory, or what else the file says that it is.
fn container(path: &Path) -> anyhow::Result<Seen> {
    let context = || path.display().to_string();
    let bytes = bytes_of(path)?;
    let header = selvedge_data::read_header(&bytes).ok();
    let format = header.and_then(|header| header.metadata().as_ref()?.get("format").cloned());
    let report = match format.unwrap_or_default().as_str() {
        MODEL_FORMAT => model(&Model::from_bytes(&bytes).with_context(context)?),
        STATES_FORMAT => states(&StateRun::from_bytes(&bytes).with_context(context)?),
        // It is read whole only with the data that it was made on.
        CHECKPOINT_FORMAT => json!({
            "kind": "checkpoint",
            "bytes": bytes.len(),
            "use": "selvedge train with --resume goes on from it",
        }),
        _ => return run_of(Trajectory::from_bytes(&bytes).with_context(context)?),
    };
    Ok(undrawn(report))
}

fn states(run: &StateRun) -> Value {
    let velocities = run.states.iter().flat_map(|state| &state.velocities);
    json!({
        "kind": "states",
        "vertices": run.states.first().map_or(0, |state| state.positions.len()),
        "frames": run.states.iter().map(|state| state.frame).collect::<Vec<_>>(),
        "largest_speed": velocities.map(|v| v.length()).fold(0.0, f64::max),
    })
}

fn run_of(trajectory: Trajectory) -> anyhow::Result<Seen> {
    let provenance = trajectory.provenance();
    let frames = trajectory.frames();
    let speeds = metrics::speeds(frames, provenance.frame_rate)?;
    let topology = trajectory.topology();
    let last = trajectory.frame(trajectory.frame_count() - 1);
    let obstacles = trajectory.obstacles().iter().map(|obstacle| {
        json!({
            "name": obstacle.name(),
            "points": obstacle.point_count(),
            "faces": obstacle.faces().len(),
            "motion": if obstacle.is_still() { "still" } else { "moves" },
        })
    });
    let own = json!({
        "kind": "trajectory",
        "name": provenance.scene["name"],
        "scene": provenance.scene,
        "made_by": provenance.made_by,
        "frames": trajectory.frame_count(),
        "frame_rate": provenance.frame_rate,
        "seconds": (trajectory.frame_count() - 1) as f64 / provenance.frame_rate,
        "vertices": trajectory.vertex_count(),
        "faces": topology.faces().len(),
        "edges": topology.edges().len(),
        "handles": numbers_of(trajectory.handles()),
        "mean_speed": speeds.mean,
        "max_speed": speeds.max,
        "mean_edge_length": metrics::mean_edge_length(frames, topology)?,
        "largest_strain": physics::largest_strain(&trajectory)?,
        "drape": Drape::of(trajectory.cloth(), last),
        "obstacles": obstacles.collect::<Vec<_>>(),
    });
    let points = trajectory.positions().iter().map(|p| p.as_dvec3());
    let points: Vec<_> = points.collect();
    let mut size = size(&points, std::iter::empty());
    size["edge_lengths"] = Value::Null;
    let report = joined([own, size]);
    Ok((report, Picture::Run(Box::new(trajectory))))
}

fn model(model: &Model) -> Value {
    let text = || Value::String(model.training.clone());
    let training = serde_json::from_str(&model.training).unwrap_or_else(|_| text());
    let weights = model.weights();
    json!({
        "kind": "model",
        "parameters": weights.len(),
        "largest_weight": weights.iter().fold(0.0_f32, |a, w| a.max(w.abs())),
        "spec": model.spec(),
        "training": training,
    })
}

fn scene(loaded: LoadedScene) -> anyhow::Result<Seen> {
    let scene = loaded.scene;
    let own = json!({
        "kind": "scene",
        "name": scene.name,
        "handles": numbers_of(&scene.handles),
        "material": scene.material.name,
        "density": scene.material.density,
        "frames": scene.frame_count()?,
        "frame_rate": scene.frame_rate,
        "substeps": scene.physics.substeps,
        "contact": scene.contact,
        "obstacles": scene.obstacles.iter().map(of_obstacle).collect::<Vec<_>>(),
        "warnings": loaded.warnings,
        "scene": loaded.spec.to_json()?,
    });
    let report = joined([of_mesh(&scene.mesh, loaded.is_own_shape), own]);
    let held = scene.handles.vertices().to_vec();
    Ok((
        report,
        Picture::Still(Box::new(scene.mesh), held, scene.obstacles),
    ))
}

/// Numbers of the held vertices.
fn numbers_of(handles: &Handles) -> Vec<u32> {
    handles.vertices().iter().map(|vertex| vertex.0).collect()
}
