//! Pictures of files: a cloth as a still or a contact sheet, a training as curves, a model as a
//! histogram of its weights.

use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, bail};
use selvedge_cloth::{Mesh, Obstacle, VertexId};
use selvedge_data::{
    MeshOptions, STATES_FORMAT, StateRun, Trajectory, TrajectoryFileError, read_mesh,
    write_atomically,
};
use selvedge_lab::folder_kind::FolderKind;
use selvedge_lab::physics;
use selvedge_lab::report::{TrainingLog, training_chart};
use selvedge_model::{MODEL_FORMAT, Model};
use selvedge_train::files;
use selvedge_view::plot::{Axis, HistogramPlot, Line, LineChart, Role, Scale, histogram_page};
use selvedge_view::{Body, Colouring, Image, Panel, Run, still};

use super::dataset;
use super::exported::read_npz;
use super::folders;
use crate::failure::WrongUsage;
use crate::film::SIZE;
use crate::{pictures, scenes};

/// Draws what `path` is to the file `to` (.png; curves .svg).
pub(super) fn draw(path: &Path, to: &Path) -> anyhow::Result<()> {
    let name = path.to_string_lossy();
    if path.is_dir() {
        return match FolderKind::of(path) {
            Some(FolderKind::DataSet) => write_image(to, &dataset::histograms(path)?),
            Some(FolderKind::Training) => {
                let cfg = folders::config_in(path)?;
                let log = TrainingLog::read(&path.join(files::LOG))?;
                write_chart(to, &training_chart(&cfg.name, &log))
            }
            Some(FolderKind::Study) => {
                bail!(
                    "{name}: a study has its plots in the folder report, and each training its own"
                )
            }
            other => Err(folders::unknown(path, other)),
        };
    }
    match path.extension().and_then(|e| e.to_str()) {
        Some("safetensors") => draw_container(path, to),
        Some("npz") => draw_run(&read_npz(path)?, path, to),
        Some("obj" | "glb" | "usda" | "usdc" | "usdz" | "usd" | "abc") => {
            let read = read_mesh(path, MeshOptions::default())?;
            draw_mesh(&read.sheet.mesh, &[], &[], to)
        }
        Some("toml" | "json") | None => {
            let loaded = scenes::open(&name).with_context(|| {
                format!("{name}: only scenes, and no other configurations, can be drawn")
            })?;
            let scene = &loaded.scene;
            draw_mesh(&scene.mesh, scene.handles.vertices(), &scene.obstacles, to)
        }
        _ => bail!("{name}: there is nothing to draw of such a file"),
    }
}

fn draw_container(path: &Path, to: &Path) -> anyhow::Result<()> {
    let bytes = selvedge_data::read_file(path).with_context(|| path.display().to_string())?;
    let format = match Trajectory::from_bytes(&bytes) {
        Ok(trajectory) => return draw_run(&trajectory, path, to),
        Err(TrajectoryFileError::Metadata { name, found, .. }) if name == "format" => found,
        Err(error) => return Err(error).with_context(|| path.display().to_string()),
    };
    match format.as_str() {
        MODEL_FORMAT => {
            let model = Model::from_bytes(&bytes).with_context(|| path.display().to_string())?;
            write_image(to, &weights_page(model.weights(), path)?)
        }
        STATES_FORMAT => {
            let run = StateRun::from_bytes(&bytes).with_context(|| path.display().to_string())?;
            write_chart(to, &speed_chart(&run, path))
        }
        other => bail!(
            "{}: there is nothing to draw of a file of the format {other}; the folder of a training has curves",
            path.display()
        ),
    }
}

fn draw_run(trajectory: &Trajectory, path: &Path, to: &Path) -> anyhow::Result<()> {
    only_png(to)?;
    let name = trajectory.provenance().scene["name"].as_str();
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    pictures::write_strain_sheet(to, name.unwrap_or(&stem), trajectory)
}

fn draw_mesh(
    mesh: &Mesh,
    handles: &[VertexId],
    obstacles: &[Obstacle],
    to: &Path,
) -> anyhow::Result<()> {
    only_png(to)?;
    let positions = physics::rounded(mesh.positions());
    let run = Run::new(mesh.topology(), [positions.as_slice()], handles, 1.0)?;
    let bodies = obstacles.iter().map(|obstacle| {
        let points = obstacle.positions_at(0.0).map(|p| p.as_vec3()).collect();
        Body::new(obstacle.faces(), [Cow::Owned(points)])
    });
    let run = run.with_bodies(bodies.collect());
    let panel = Panel {
        label: "",
        run: &run,
        colouring: Colouring::Plain,
    };
    write_image(to, &still(&panel, 0, SIZE)?)
}

/// Draws a histogram of the weights of a model, in equal bins around zero.
fn weights_page(weights: &[f32], path: &Path) -> anyhow::Result<Image> {
    const BINS: usize = 96;
    let largest = weights
        .iter()
        .fold(0.0_f64, |a, w| a.max(f64::from(*w).abs()));
    // A range that reads well.
    let largest = (10.0 * largest).ceil().max(1.0) / 10.0;
    let mut counts = vec![0_u64; BINS];
    for weight in weights {
        let share = (f64::from(*weight) / largest).midpoint(1.0);
        counts[((share * BINS as f64) as usize).min(BINS - 1)] += 1;
    }
    let range = [-largest, largest];
    let plot = HistogramPlot {
        title: "weights",
        unit: "no unit",
        range,
        counts: &counts,
    };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok(histogram_page(&stem, &[plot])?)
}

/// Mean and largest speed by frame.
fn speed_chart(run: &StateRun, path: &Path) -> LineChart {
    let line = |name: &str, of: fn(&[f64]) -> f64| Line {
        name: name.to_owned(),
        role: Role::Subject,
        points: run
            .states
            .iter()
            .map(|state| {
                let speeds: Vec<f64> = state.velocities.iter().map(|v| v.length()).collect();
                [state.frame as f64, of(&speeds)]
            })
            .collect(),
    };
    let axis = |label: &str| Axis {
        label: label.to_owned(),
        scale: Scale::Linear,
    };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    LineChart {
        title: format!("Speeds of {stem}"),
        x: axis("frame"),
        y: axis("speed of a vertex (m/s)"),
        lines: vec![
            line("largest", |s| s.iter().copied().fold(0.0, f64::max)),
            line("mean", |s| s.iter().sum::<f64>() / s.len() as f64),
        ],
    }
}

fn only_png(to: &Path) -> anyhow::Result<()> {
    if to.extension().is_some_and(|extension| extension == "svg") {
        let problem = format!(
            "--picture {}: only curves are drawn as .svg: take .png",
            to.display()
        );
        return Err(WrongUsage::new(problem).into());
    }
    Ok(())
}

fn write_image(to: &Path, image: &Image) -> anyhow::Result<()> {
    only_png(to)?;
    let png = image.to_png()?;
    Ok(write_atomically(to, |out| out.write_all(&png))?)
}

fn write_chart(to: &Path, chart: &LineChart) -> anyhow::Result<()> {
    if to.extension().is_none_or(|extension| extension != "svg") {
        let problem = format!(
            "--picture {}: curves are drawn as .svg: take that",
            to.display()
        );
        return Err(WrongUsage::new(problem).into());
    }
    let svg = chart.to_svg()?;
    Ok(write_atomically(to, |out| out.write_all(svg.as_bytes()))?)
}
