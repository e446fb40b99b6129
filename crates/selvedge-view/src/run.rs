//! What is shown: the frames of a motion, borrowed and checked once; numbers per vertex to colour
//! them by; and both together as a panel.

use glam::Vec3;
use selvedge_cloth::{Topology, VertexId};

use crate::{ColourMap, ViewError};

/// The motion of one cloth. Every frame has the mesh's vertices, and all of them are finite.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    topology: &'a Topology,
    frames: Vec<&'a [Vec3]>,
    handles: &'a [VertexId],
    frame_rate: f64,
}

impl<'a> Run<'a> {
    /// Frames of positions [m], `[frames, vertices]`, at `frame_rate` [1/s]; `handles` are marked.
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

    /// Positions in each frame [m], `[frames, vertices]`.
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

    /// Time of a frame since the first [s].
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

/// One number per vertex and frame, the range that the colours span, and the map.
#[derive(Clone, Debug, PartialEq)]
pub struct ScalarField {
    name: String,
    values: Vec<Vec<f32>>,
    range: [f32; 2],
    map: ColourMap,
}

impl ScalarField {
    /// `values`, `[frames, vertices]`, under a `name` with its unit, as "error [mm]". The colours
    /// span 0 to the largest value, rounded up to a number that reads well.
    ///
    /// # Errors
    /// [`ViewError::EmptyRun`] or [`ViewError::NonFiniteValue`].
    pub fn new(name: impl Into<String>, values: Vec<Vec<f32>>) -> Result<Self, ViewError> {
        let name = name.into();
        if values.is_empty() {
            return Err(ViewError::EmptyRun);
        }
        for (frame, of_frame) in values.iter().enumerate() {
            if let Some(vertex) = of_frame.iter().position(|value| !value.is_finite()) {
                return Err(ViewError::NonFiniteValue {
                    name,
                    frame,
                    vertex: VertexId(vertex as u32),
                    value: of_frame[vertex],
                });
            }
        }
        let largest = values.iter().flatten().fold(0.0_f32, |a, &b| a.max(b));
        Ok(Self {
            name,
            values,
            range: [0.0, round_up(largest)],
            map: ColourMap::default(),
        })
    }

    /// The distance of each vertex of `prediction` from the same vertex of `truth` [mm].
    ///
    /// # Errors
    /// [`ViewError::PanelsDiffer`] when the runs differ in frames or vertices.
    pub fn distance(truth: &Run<'_>, prediction: &Run<'_>) -> Result<Self, ViewError> {
        let panel = |label, run| Panel {
            label,
            run,
            colouring: Colouring::Plain,
        };
        check_match(&panel("truth", truth), &panel("prediction", prediction))?;
        let values = truth
            .frames
            .iter()
            .zip(&prediction.frames)
            .map(|(a, b)| {
                a.iter()
                    .zip(*b)
                    .map(|(p, q)| 1e3 * p.distance(*q))
                    .collect()
            })
            .collect();
        Self::new("distance from truth [mm]", values)
    }

    /// The same values with colours that span `low` to `high`.
    ///
    /// # Errors
    /// [`ViewError::Range`] unless both are finite and `low` < `high`.
    pub fn with_range(self, low: f32, high: f32) -> Result<Self, ViewError> {
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err(ViewError::Range {
                name: self.name,
                low,
                high,
            });
        }
        Ok(Self {
            range: [low, high],
            ..self
        })
    }

    /// The same values in the colours of another map.
    #[must_use]
    pub fn with_map(self, map: ColourMap) -> Self {
        Self { map, ..self }
    }

    /// What the numbers are, with the unit.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The values, `[frames, vertices]`.
    #[must_use]
    pub fn values(&self) -> &[Vec<f32>] {
        &self.values
    }

    /// The values at both ends of the colours.
    #[must_use]
    pub fn range(&self) -> [f32; 2] {
        self.range
    }

    /// The map from value to colour.
    #[must_use]
    pub fn map(&self) -> ColourMap {
        self.map
    }

    fn check_fits(&self, run: &Run<'_>) -> Result<(), ViewError> {
        let error = |what, expected, found| ViewError::ValueCount {
            name: self.name.clone(),
            what,
            expected,
            found,
        };
        if self.values.len() != run.frames.len() {
            return Err(error("frames", run.frames.len(), self.values.len()));
        }
        let expected = run.topology.vertex_count();
        match self.values.iter().find(|v| v.len() != expected) {
            Some(bad) => Err(error("vertices", expected, bad.len())),
            None => Ok(()),
        }
    }
}

/// The smallest of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten that is not below `value`; 1 for 0.
fn round_up(value: f32) -> f32 {
    if value <= 0.0 {
        return 1.0;
    }
    let power = 10.0_f64.powf(f64::from(value).log10().floor());
    let steps = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let rounded = steps
        .into_iter()
        .map(|step| (step * power) as f32)
        .find(|&candidate| candidate >= value);
    rounded.unwrap_or(value)
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
    /// What stands above it; may be empty.
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

fn check_match(first: &Panel<'_>, panel: &Panel<'_>) -> Result<(), ViewError> {
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
    fn distance_is_in_millimetres_and_its_range_reads_well() {
        let topology = triangle();
        let truth = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let moved = truth.map(|p| p + Vec3::new(0.003, 0.0, 0.004));
        let a = Run::new(&topology, [&truth[..]], &[], 60.0).unwrap();
        let b = Run::new(&topology, [&moved[..]], &[], 60.0).unwrap();
        let field = ScalarField::distance(&a, &b).unwrap();
        for value in &field.values()[0] {
            // 3-4-5; positions near 1 m carry 6e-8 m of rounding, that is 1e-4 mm.
            assert!((value - 5.0).abs() < 2e-4, "{value}");
        }
        assert!(field.range()[1] >= 4.999 && field.range()[1] <= 6.0);
        assert_eq!(
            [0.0, 0.9, 1.0, 1.2, 7.0, 450.0].map(round_up),
            [1.0, 1.0, 1.0, 1.5, 8.0, 500.0]
        );
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
        assert!(field.with_range(2.0, 2.0).is_err());
    }
}
