//! Pictures of files: a run as a contact sheet, a cloth as a still.

use std::borrow::Cow;
use std::path::Path;

use anyhow::bail;
use selvedge_cloth::{Mesh, Obstacle, VertexId};
use selvedge_data::Trajectory;
use selvedge_lab::physics;
use selvedge_lab::pictures::strain_sheet;
use selvedge_view::{Body, Panel, Run, still};

use crate::film::SIZE;
use crate::place;

/// What there is to draw of a file.
pub(super) enum Picture {
    /// A run with its strain.
    Run(Box<Trajectory>),
    /// A mesh as it stands, with its held vertices and the bodies beside it.
    Still(Box<Mesh>, Vec<VertexId>, Vec<Obstacle>),
    Nothing,
}

impl Picture {
    /// Draws what is in the file at `path` to the file `to` (.png).
    pub(super) fn write(self, path: &Path, to: &Path) -> anyhow::Result<()> {
        let bytes = match self {
            Self::Run(run) => {
                let name = run.provenance().scene["name"].as_str();
                let stem = || path.file_stem().unwrap_or_default().to_string_lossy();
                strain_sheet(&name.map_or_else(stem, Cow::Borrowed), &run)?
            }
            Self::Still(mesh, handles, obstacles) => png_of(&mesh, &handles, &obstacles)?,
            Self::Nothing => bail!(
                "--picture: {} is no run, mesh or scene: there is nothing to draw of it",
                path.display()
            ),
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
    Ok(still(&Panel::of(&run), 0, SIZE)?.to_png()?)
}
