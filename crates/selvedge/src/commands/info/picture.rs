//! Pictures of files: a cloth as a still or a contact sheet, a training as curves.

use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, bail};
use selvedge_cloth::{Mesh, Obstacle, VertexId};
use selvedge_data::{MeshOptions, TRAJECTORY_FORMAT, Trajectory, read_mesh, write_atomically};
use selvedge_lab::folder::FolderKind;
use selvedge_lab::physics;
use selvedge_lab::report::{TrainingLog, training_chart};
use selvedge_train::files;
use selvedge_view::plot::LineChart;
use selvedge_view::{Body, Colouring, Image, Panel, Run, still};

use super::exported::read_npz;
use super::{folders, format_of};
use crate::failure::wrong;
use crate::film::SIZE;
use crate::{pictures, scenes};

/// Draws what `path` is to the file `to` (.png; curves .svg).
pub(super) fn draw(path: &Path, to: &Path) -> anyhow::Result<()> {
    let name = path.to_string_lossy();
    if path.is_dir() {
        return match FolderKind::of(path) {
            Some(FolderKind::DataSet) => {
                let problem = "--picture: a data set is drawn into a folder: name one";
                Err(wrong(problem))
            }
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
    match format_of(&bytes).as_str() {
        "" | TRAJECTORY_FORMAT => {
            let trajectory = Trajectory::from_bytes(&bytes);
            draw_run(
                &trajectory.with_context(|| path.display().to_string())?,
                path,
                to,
            )
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

fn only_png(to: &Path) -> anyhow::Result<()> {
    if to.extension().is_some_and(|extension| extension == "svg") {
        let problem = format!(
            "--picture {}: only curves are drawn as .svg: take .png",
            to.display()
        );
        return Err(wrong(problem));
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
        return Err(wrong(problem));
    }
    let svg = chart.to_svg()?;
    Ok(write_atomically(to, |out| out.write_all(svg.as_bytes()))?)
}
