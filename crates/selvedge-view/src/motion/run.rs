//! What is shown: the frames of a motion, borrowed and checked once, and a panel of them with a
//! label and a colouring; and what panels must share to stand side by side.

use glam::Vec3;
use selvedge_cloth::{Topology, VertexId};

use crate::{ScalarField, ViewError};

/// The motion of one cloth. Every frame has the mesh's vertices, and all of them are finite.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    topology: &'a Topology,
    frames: Vec<&'a [Vec3]>,
    handles: &'a [VertexId],
    frame_rate: f64,
}

impl<'a> Run<'a> {
    /// Frames of positions `[m]`, `[frames, vertices]`, at `frame_rate` `[1/s]`; `handles` are marked.
    ///
    /// # Errors
    /// [`ViewError::EmptyRun`], [`ViewError::VertexCount`], [`ViewError::NonFinite`],
    /// [`ViewError::Handle`] or [`ViewError::FrameRate`], with the first offending numbers.
    pub fn new(
        topology: &'a Topology,
        frames: impl IntoIterator<Item = &'a [Vec3]>,
        handles: &'a [VertexId],
        frame_rate: f64,
    ) -> Result<Self, ViewError> {
        let frames: Vec<&[Vec3]> = frames.into_iter().collect();
        let vertex_count = topology.vertex_count();
        if frames.is_empty() {
            return Err(ViewError::EmptyRun);
        }
        if !(frame_rate.is_finite() && frame_rate > 0.0) {
            return Err(ViewError::FrameRate { found: frame_rate });
        }
        if let Some(&vertex) = handles.iter().find(|v| v.index() >= vertex_count) {
            return Err(ViewError::Handle {
                vertex,
                vertex_count,
            });
        }
        for (frame, positions) in frames.iter().enumerate() {
            check_frame(frame, positions, vertex_count)?;
        }
        Ok(Self {
            topology,
            frames,
            handles,
            frame_rate,
        })
    }

    /// The connectivity.
    #[must_use]
    pub fn topology(&self) -> &'a Topology {
        self.topology
    }

    /// Positions in each frame `[m]`, `[frames, vertices]`.
    #[must_use]
    pub fn frames(&self) -> &[&'a [Vec3]] {
        &self.frames
    }

    /// The vertices that are marked as handles.
    #[must_use]
    pub fn handles(&self) -> &'a [VertexId] {
        self.handles
    }

    /// Frames per second.
    #[must_use]
    pub fn frame_rate(&self) -> f64 {
        self.frame_rate
    }

    /// Time of a frame since the first `[s]`.
    #[must_use]
    pub fn time(&self, frame: usize) -> f64 {
        frame as f64 / self.frame_rate
    }
}

fn check_frame(frame: usize, positions: &[Vec3], vertex_count: usize) -> Result<(), ViewError> {
    if positions.len() != vertex_count {
        return Err(ViewError::VertexCount {
            frame,
            expected: vertex_count,
            found: positions.len(),
        });
    }
    match positions.iter().position(|p| !p.is_finite()) {
        Some(vertex) => Err(ViewError::NonFinite {
            frame,
            vertex: VertexId(vertex as u32),
            position: positions[vertex],
        }),
        None => Ok(()),
    }
}

/// How the cloth is coloured.
#[derive(Clone, Copy, Debug, Default)]
pub enum Colouring<'a> {
    /// As cloth: indigo in front, ecru at the back.
    #[default]
    Plain,
    /// By a number per vertex.
    PerVertex(&'a ScalarField),
}

/// A run as it is shown.
#[derive(Clone, Copy, Debug)]
pub struct Panel<'a> {
    /// What stands above it where several panels are shown together; may be empty.
    pub label: &'a str,
    /// What moves.
    pub run: &'a Run<'a>,
    /// In which colours.
    pub colouring: Colouring<'a>,
}

impl<'a> Panel<'a> {
    /// The numbers that it is coloured by, if any.
    pub(crate) fn field(&self) -> Option<&'a ScalarField> {
        match self.colouring {
            Colouring::Plain => None,
            Colouring::PerVertex(field) => Some(field),
        }
    }
}

/// Checks that there are panels, that they run at one clock, and that their values fit.
pub(crate) fn check_panels(panels: &[Panel<'_>]) -> Result<(), ViewError> {
    let first = panels.first().ok_or(ViewError::NoPanels)?;
    for panel in panels {
        check_clock(first, panel)?;
        if let Some(field) = panel.field() {
            field.check_fits(panel.run)?;
        }
    }
    Ok(())
}

fn check_clock(first: &Panel<'_>, panel: &Panel<'_>) -> Result<(), ViewError> {
    let frames = [first, panel].map(|p| p.run.frames.len());
    if frames[0] != frames[1] {
        return Err(differ(first, panel, "frames", frames));
    }
    let rates = [first, panel].map(|p| p.run.frame_rate);
    if rates[0] != rates[1] {
        return Err(differ(first, panel, "frames per second", rates));
    }
    Ok(())
}

/// Checks that two panels have the same clock and number of vertices.
pub(crate) fn check_match(first: &Panel<'_>, panel: &Panel<'_>) -> Result<(), ViewError> {
    check_clock(first, panel)?;
    let vertices = [first, panel].map(|p| p.run.topology.vertex_count());
    if vertices[0] != vertices[1] {
        return Err(differ(first, panel, "vertices", vertices));
    }
    Ok(())
}

fn differ<T: ToString>(
    first: &Panel<'_>,
    panel: &Panel<'_>,
    what: &'static str,
    [expected, found]: [T; 2],
) -> ViewError {
    ViewError::PanelsDiffer {
        first: first.label.to_owned(),
        label: panel.label.to_owned(),
        what,
        expected: expected.to_string(),
        found: found.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Topology {
        Topology::new(3, &[[0, 1, 2]]).unwrap()
    }

    #[test]
    fn each_defect_of_a_run_has_its_message() {
        let topology = triangle();
        let good = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let bad = [Vec3::ZERO, Vec3::new(1.0, f32::NAN, 0.0), Vec3::Y];
        let run = |frames: &[&'static [Vec3]], handles: &'static [VertexId], rate| {
            Run::new(&topology, frames.to_vec(), handles, rate)
                .map(|_| ())
                .unwrap_err()
                .to_string()
        };
        let good: &'static [Vec3] = good.to_vec().leak();
        let bad: &'static [Vec3] = bad.to_vec().leak();
        assert_eq!(
            run(&[], &[], 60.0),
            "the run has no frames: there is nothing to show"
        );
        assert_eq!(
            run(&[good, &good[..2]], &[], 60.0),
            "frame 1 has 2 vertices, but the mesh has 3"
        );
        assert_eq!(
            run(&[good, bad], &[], 60.0),
            "frame 1: the position of vertex 1 is not finite: [1, NaN, 0]"
        );
        assert_eq!(
            run(&[good], &[VertexId(3)], 60.0),
            "handle vertex 3 is out of range: the mesh has 3 vertices"
        );
        assert!(run(&[good], &[], 0.0).contains("found 0 frames per second"));
    }

    #[test]
    fn panels_side_by_side_must_match() {
        let topology = triangle();
        let still = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let short = Run::new(&topology, [&still[..]], &[], 60.0).unwrap();
        let long = Run::new(&topology, [&still[..], &still[..]], &[], 60.0).unwrap();
        let field = ScalarField::new("error", vec![vec![0.0; 2]; 2]).unwrap();
        let panel = |label, run, colouring| Panel {
            label,
            run,
            colouring,
        };
        let plain = Colouring::Plain;
        assert!(matches!(check_panels(&[]), Err(ViewError::NoPanels)));
        let message = check_panels(&[panel("a", &short, plain), panel("b", &long, plain)])
            .unwrap_err()
            .to_string();
        assert_eq!(
            message,
            "panel \"b\" has 2 frames, but panel \"a\" has 1: panels side by side must match"
        );
        let message = check_panels(&[panel("b", &long, Colouring::PerVertex(&field))])
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("2 vertices, but the run has 3"),
            "{message}"
        );
    }
}
