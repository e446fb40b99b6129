//! A stepper of one's own: a cloth that follows its handles stiffly. It is recorded over a motion,
//! compared by the metrics with the same cloth standing still, and exported as an animation.
//!
//! `cargo run -p selvedge-data --example custom_stepper` writes `follower.usdc` to the system's
//! folder for temporary files.
#![allow(clippy::print_stdout, reason = "an example that prints its result")]

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

use glam::Vec3;
use selvedge_cloth::generate::square;
use selvedge_cloth::motion::named;
use selvedge_cloth::{Cloth, HandleError, HandleTargets, Handles, StepError, Stepper, Topology};
use selvedge_data::export::{ExportFormat, ExportOptions, export};
use selvedge_data::metrics::{Comparison, compare};
use selvedge_data::{Drive, Frames, Provenance, Trajectory, record};

/// A cloth in which every free vertex moves by the mean move of the handles.
pub(crate) struct Follower {
    cloth: Cloth,
    positions: Vec<Vec3>,
    frame: usize,
}

impl Follower {
    /// Starts in the rest pose of `cloth`.
    pub(crate) fn new(cloth: Cloth) -> Self {
        let positions = cloth.rest_positions().to_vec();
        Self {
            cloth,
            positions,
            frame: 0,
        }
    }
}

impl Stepper for Follower {
    fn topology(&self) -> &Topology {
        self.cloth.topology()
    }

    fn handles(&self) -> &Handles {
        self.cloth.handles()
    }

    fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let frame = self.frame + 1;
        let failed = |source| StepError::Handles { frame, source };
        let (expected, found) = (self.handles().len(), targets.handle_count());
        if expected != found {
            return Err(failed(HandleError::Count { expected, found }));
        }
        targets.require_all_hold().map_err(failed)?;
        let ends: Vec<Vec3> = targets.end().iter().map(|p| p.as_vec3()).collect();
        if let Some(handle) = ends.iter().position(|end| !end.is_finite()) {
            let vertex = self.handles().vertices()[handle];
            return Err(StepError::NonFinite { frame, vertex });
        }
        let moves = ends.iter().zip(self.handles().of(&self.positions));
        let sum: Vec3 = moves.map(|(end, now)| *end - now).sum();
        let mean = sum / expected.max(1) as f32;
        self.positions.iter_mut().for_each(|p| *p += mean);
        for (vertex, end) in self.cloth.handles().vertices().iter().zip(ends) {
            self.positions[vertex.index()] = end;
        }
        self.frame = frame;
        Ok(())
    }
}

/// A square of 100 vertices that is held by its upper corners.
pub(crate) fn cloth() -> Result<Cloth, Box<dyn Error>> {
    let sheet = square(100, 1.0, 1)?;
    let handles = Handles::new(sheet.label("upper-corners")?, 100)?;
    Ok(Cloth::of_mesh(&sheet.mesh, 0.2, handles)?)
}

/// Records two seconds, compares them with a cloth that stands still and writes them to `out`.
pub(crate) fn run(out: &Path) -> Result<Comparison, Box<dyn Error>> {
    let (cloth, frame_rate) = (cloth()?, 60.0);
    let mut stepper = Follower::new(cloth.clone());
    let start = cloth.handles().of(cloth.rest_positions());
    let start: Vec<_> = start.map(|p| p.as_dvec3()).collect();
    let motion = named::by_name("forward").ok_or("there is no such motion")?;
    let drive = Drive {
        path: &motion.bind(&start, frame_rate)?,
        samples_per_frame: 1,
    };
    let recording = record(&mut stepper, drive, 120, &mut |_| ControlFlow::Continue(()));
    let provenance = Provenance {
        frame_rate,
        scene: serde_json::Value::Null,
        made_by: "custom_stepper".to_owned(),
    };
    let still = cloth.rest_positions().repeat(121);
    let trajectory = Trajectory::new(cloth, recording.positions, provenance)?;
    let options = ExportOptions::plain(ExportFormat::Usdc);
    export(
        &trajectory,
        out,
        &options,
        &mut || ControlFlow::Continue(()),
    )?;
    let still = Frames::new(&still, trajectory.vertex_count())?;
    Ok(compare(trajectory.frames(), still, trajectory.topology())?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let out = std::env::temp_dir().join("follower.usdc");
    let measures = run(&out)?;
    println!(
        "{} frames in {}, on average {:.3} m from where they started",
        measures.frames,
        out.display(),
        measures.mean_vertex_error
    );
    Ok(())
}
