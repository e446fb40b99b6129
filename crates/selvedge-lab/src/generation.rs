//! Data sets: simulates the motions of a preset, scenes side by side.
//!
//! The rest pose of a cloth serves all scenes that it is in. Each scene is the work
//! of one thread from its start to its end, and the index is sorted: the files do not depend on the
//! number of threads. A finished trajectory is in the index at once, so that an interrupted run
//! loses at most the scenes under way. A run that ends before the first leaves nothing behind: its
//! preset may be another the next time.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, anyhow};
use glam::DVec3;
use rayon::prelude::*;
use selvedge::Run;
use selvedge_cluster::Shard;
use selvedge_data::{Dataset, DatasetParts, DatasetPreset, DatasetWriter, LoadedScene, Split};
use selvedge_sim::{DividedFrames, Simulator, Threads};

use crate::event::{End, OnEvent, Reporter};
use crate::folder::{self, FolderKind};
use crate::{physics, workers};

/// A data set after [`generate`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Generated {
    /// The name of the preset.
    pub name: String,
    /// Trajectories to train on.
    pub train: usize,
    /// Trajectories to test on.
    pub test: usize,
    /// Samples of a complete data set; 0 of one that is not.
    pub samples: usize,
    /// Frames that were simulated now.
    pub frames_made: usize,
    /// Those of them that took more substeps than their scene asks for.
    pub divided: DividedFrames,
    /// Trajectories that were there already.
    pub kept: usize,
    /// Trajectories that are still to be made.
    pub missing: usize,
    /// The part of the data set that this is.
    pub part: Option<Shard>,
}

impl Generated {
    /// [`End::Interrupted`] where trajectories are missing.
    pub fn end(&self) -> End {
        match self.missing {
            0 => End::Complete,
            _ => End::Interrupted,
        }
    }
}

/// A trajectory that is still to be made.
struct Job {
    split: Split,
    motion: String,
    /// Its cloth, where it is not the setting's own.
    cloth: Option<String>,
    scene: LoadedScene,
    frames: usize,
}

/// A data set to be made.
#[derive(Clone, Copy)]
pub struct Order<'a> {
    /// Its preset.
    pub preset: &'a DatasetPreset,
    /// Its folder.
    pub folder: &'a Path,
    /// The part of it that is to be made; all without one.
    pub part: Option<Shard>,
}

/// Makes a data set or a part of one, or goes on with it, on `threads`, by default one per processor.
///
/// # Errors
/// What of a scene, the folder or a file went wrong.
pub fn generate(
    order: Order<'_>,
    threads: Option<usize>,
    on_event: &mut OnEvent<'_>,
) -> Result<Generated> {
    let Order {
        preset,
        folder,
        part,
    } = order;
    let reporter = &Reporter::new(on_event);
    let plan = preset.plan()?;
    let _claimed = folder::claim_folder(folder, FolderKind::DataSet)?;
    let mut writer = DatasetWriter::open_part(folder, plan, part)?;
    let planned = writer.motion_count();
    let (jobs, divided) = match make(preset, &mut writer, threads, reporter) {
        Ok(made) => made,
        Err(error) => {
            writer.withdraw();
            return Err(error);
        }
    };
    let [train, test] = [Split::Train, Split::Test].map(|split| preset.motions(split).len());
    let missing = writer.missing().len();
    let made = |job: &&Job| writer.written(job.split, &job.motion).is_some();
    let mut generated = Generated {
        name: preset.config().name.clone(),
        train,
        test,
        samples: 0,
        frames_made: jobs.iter().filter(made).map(|job| job.frames + 1).sum(),
        divided,
        kept: planned - jobs.len(),
        missing,
        part,
    };
    if missing > 0 {
        writer.withdraw();
    } else if part.is_none() {
        generated.samples = writer.finish()?.index().statistics.samples;
    }
    Ok(generated)
}

/// Makes what is missing, until an end is asked for, and says what that was.
fn make(
    preset: &DatasetPreset,
    writer: &mut DatasetWriter,
    threads: Option<usize>,
    reporter: &Reporter<'_>,
) -> Result<(Vec<Job>, DividedFrames)> {
    let jobs = jobs(preset, writer.missing())?;
    let rests = rest_poses(&jobs, reporter)?;
    let divided = simulate_all(&jobs, &rests, writer, threads, reporter)?;
    Ok((jobs, divided))
}

fn jobs(preset: &DatasetPreset, missing: Vec<(Split, String)>) -> Result<Vec<Job>> {
    let mut jobs = Vec::with_capacity(missing.len());
    for (split, name) in missing {
        let motion = preset.motions(split).iter().find(|m| m.name == name);
        let motion = motion.ok_or_else(|| anyhow!("motion {name:?} is not in the preset"))?;
        let scene = preset.scene(motion)?;
        jobs.push(Job {
            split,
            motion: name,
            cloth: motion.cloth.clone(),
            frames: scene.scene.frame_count()?,
            scene,
        });
    }
    Ok(jobs)
}

/// Rest poses by cloth `[m]`, `[vertices]`.
type Rests = BTreeMap<Option<String>, Vec<DVec3>>;

/// The rest pose of every cloth that the jobs have, until an end is asked for.
fn rest_poses(jobs: &[Job], reporter: &Reporter<'_>) -> Result<Rests> {
    let mut rests = Rests::new();
    for job in jobs {
        if rests.contains_key(&job.cloth) {
            continue;
        }
        let rest = physics::rest_pose(&job.scene.scene, &mut reporter.listener());
        if reporter.is_stopped() {
            break;
        }
        rests.insert(job.cloth.clone(), rest?.positions);
    }
    Ok(rests)
}

/// Simulates the jobs from the rest poses of their cloths, until all are done or an end is asked
/// for. Gives the frames that were written and took more substeps than their scene asks for.
fn simulate_all(
    jobs: &[Job],
    rests: &Rests,
    writer: &mut DatasetWriter,
    threads: Option<usize>,
    reporter: &Reporter<'_>,
) -> Result<DividedFrames> {
    let frames = jobs.iter().map(|job| job.frames).sum();
    let task = reporter.count("simulating", frames, "frames");
    let writer = Mutex::new((writer, DividedFrames::default()));
    // One job at a time for each thread: blocks of them would leave threads idle at the end.
    let simulate = |job: &Job| -> Result<()> {
        let scene = &job.scene.scene;
        // There is none where an end was asked for before.
        let Some(rest) = rests.get(&job.cloth).filter(|_| !task.is_stopped()) else {
            return Ok(());
        };
        let mut run = Run::new(&selvedge::Scene::at(scene.clone(), rest.clone()))?;
        run.set_threads(Threads::One);
        let made = physics::simulate(&mut run, job.frames, false, &mut |_| task.advance());
        let (made, _) = made.whole()?;
        if made.end == End::Interrupted {
            return Ok(());
        }
        let trajectory = physics::trajectory(0, &job.scene.spec, scene, rest, made.positions)?;
        // `add` leaves the writer as it was where it fails, so that it is never half done.
        let mut writer = writer.lock().unwrap_or_else(PoisonError::into_inner);
        writer.0.add(job.split, &job.motion, &trajectory)?;
        let stats = run.solver().map(Simulator::stats).unwrap_or_default();
        writer.1 = writer.1.and(stats.divided);
        Ok(())
    };
    let jobs = jobs.par_iter().with_max_len(1);
    workers::pool(threads)?.install(|| jobs.try_for_each(simulate))?;
    let (_, divided) = writer.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(divided)
}

/// Makes the parts of a data set one, in `folder`; none where an end was asked for.
pub fn merge(
    parts: &DatasetParts,
    folder: &Path,
    on_event: &mut OnEvent<'_>,
) -> Result<Option<Dataset>> {
    let _claimed = folder::claim_folder(folder, FolderKind::DataSet)?;
    let reporter = Reporter::new(on_event);
    let task = reporter.count("merging", parts.trajectory_count(), "trajectories");
    Ok(parts.merge(folder, &mut || task.advance())?)
}

/// Opens a complete data set, and says of an incomplete one how to complete it.
pub fn open(folder: &Path) -> Result<Dataset> {
    let dataset = Dataset::open(folder);
    let has = |name: &str| folder.join(name).exists();
    if dataset.is_err() && has("index.partial.json") && !has("index.json") {
        return dataset.with_context(|| {
            format!(
                "{}: this data set is not complete: run again the command that began it, \
                 `selvedge data generate` or a call in Python; parts are joined by \
                 `selvedge data merge`",
                folder.display()
            )
        });
    }
    Ok(dataset?)
}
