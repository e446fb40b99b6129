//! Pictures of files: a cloth as a still or a contact sheet, a training as curves.

use std::borrow::Cow;
use std::path::Path;

use selvedge_cloth::{Mesh, Obstacle, VertexId};
use selvedge_data::{Trajectory, ending_of};
use selvedge_lab::physics;
use selvedge_lab::pictures::strain_sheet;
use selvedge_view::plot::LineChart;
use selvedge_view::{Body, Colouring, Panel, Run, still};

use crate::failure::wrong;
use crate::film::SIZE;
use crate::place;

/// What there is to draw of a file or folder.
pub(super) enum Picture {
    /// A run with its strain, under this name where its scene has none.
    Run(Box<Trajectory>, String),
    /// A mesh as it stands, with its held vertices and the bodies beside it.
    Still(Box<Mesh>, Vec<VertexId>, Vec<Obstacle>),
    Curves(LineChart),
    /// Nothing, and why.
    Nothing(anyhow::Error),
}

impl Picture {
    /// Draws it to the file `to` (.png; curves .svg).
    pub(super) fn write(self, to: &Path) -> anyhow::Result<()> {
        let is_svg = ending_of(to) == "svg";
        let remedy = match (&self, is_svg) {
            (Self::Nothing(_), _) | (Self::Curves(_), true) => None,
            (Self::Curves(_), false) => Some("curves are drawn as .svg: take that"),
            (_, true) => Some("only curves are drawn as .svg: take .png"),
            (_, false) => None,
        };
        if let Some(remedy) = remedy {
            return Err(wrong(format!("--picture {}: {remedy}", to.display())));
        }
        let bytes = match self {
            Self::Run(run, other) => {
                let name = run.provenance().scene["name"].as_str();
                strain_sheet(name.unwrap_or(&other), &run)?
            }
            Self::Still(mesh, handles, obstacles) => png_of(&mesh, &handles, &obstacles)?,
            Self::Curves(chart) => chart.to_svg()?.into_bytes(),
            Self::Nothing(why) => return Err(why),
        };
        place::write(to, &bytes)
    }
}

fn png_of(mesh: &Mesh, handles: &[VertexId], obstacles: &[Obstacle]) -> anyhow::Result<Vec<u8>> {
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
    Ok(still(&panel, 0, SIZE)?.to_png()?)
}
