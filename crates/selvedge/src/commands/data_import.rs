//! `selvedge data import`: caches of other programs as a data set.
//!
//! Every trajectory is read, checked and written by itself, so that an import of many gigabytes
//! needs the memory of one trajectory, and an interrupted one goes on.

use std::collections::BTreeMap;
use std::time::Instant;

use anyhow::{Context, bail};
use selvedge_data::foreign::{ForeignSource, HandleSource};
use selvedge_data::{DatasetWriter, Trajectory, metrics};
use selvedge_lab::folder::{self, FolderKind};
use serde_json::json;

use super::data::{already_there, data_set, samples_or_missing};
use crate::cli::ImportArgs;
use crate::interrupt;
use crate::output::{Answer, End, folded};
use crate::progress::Progress;

/// Imports a folder of foreign data, or goes on with it.
pub(crate) fn run(args: &ImportArgs) -> anyhow::Result<Answer> {
    let started = Instant::now();
    let source = ForeignSource::open(&args.source, &args.options())?;
    let plan = source.plan();
    let (name, train, test) = (plan.name.clone(), plan.train.len(), plan.test.len());
    let _claimed = folder::claim_folder(&args.output, FolderKind::DataSet)?;
    let mut writer = DatasetWriter::open(&args.output, plan)?;
    let missing = writer.missing().len();
    let mut handles = match write(&source, &mut writer, args.max_strain) {
        Ok(handles) => handles,
        Err(error) => {
            writer.withdraw();
            return Err(error);
        }
    };
    if matches!(args.handles, HandleSource::Vertices(_)) {
        handles.clear();
    }
    let still_missing = writer.missing().len();
    let (samples, end) = if still_missing > 0 {
        writer.withdraw();
        (0, End::Interrupted)
    } else {
        (writer.finish()?.index().statistics.samples, End::Complete)
    };
    let kept = train + test - missing;
    let mut facts = data_set(&name, train, test);
    already_there(&mut facts, kept);
    let held = handles.iter();
    facts.add_all(
        "held",
        held.map(|(name, held)| format!("{name}: {}", folded(held))),
    );
    samples_or_missing(&mut facts, samples, still_missing);
    if still_missing < train + test {
        facts.add("wrote", args.output.display());
    }
    let report = json!({
        "name": name,
        "source": args.source,
        "out": args.output,
        "train": train,
        "test": test,
        "samples": samples,
        // Held vertices of each trajectory that was read, where the call did not number them.
        "handles": handles,
        "trajectories_kept": kept,
        "trajectories_missing": still_missing,
        "seconds": started.elapsed().as_secs_f64(),
    });
    Ok(facts.answer_at(end, report))
}

/// Reads and writes what is missing, one trajectory after another, until an end is asked for, and
/// gives the held vertices of each.
fn write(
    source: &ForeignSource,
    writer: &mut DatasetWriter,
    max_strain: f64,
) -> anyhow::Result<BTreeMap<String, Vec<u32>>> {
    let mut handles = BTreeMap::new();
    let progress = Progress::new("importing", writer.missing().len(), "trajectories");
    for run in source.runs() {
        if interrupt::requested() {
            break;
        }
        if writer.written(run.split, &run.name).is_some() {
            continue;
        }
        let trajectory = source.read(run)?;
        check_strain(&trajectory, max_strain)
            .with_context(|| format!("trajectory {}", run.name))?;
        writer.add(run.split, &run.name, &trajectory)?;
        let held = trajectory.handles().vertices().iter();
        handles.insert(run.name.clone(), held.map(|vertex| vertex.0).collect());
        progress.advance();
    }
    Ok(handles)
}

/// Checks that no edge is strained beyond what cloth can.
fn check_strain(trajectory: &Trajectory, bound: f64) -> anyhow::Result<()> {
    let lengths = trajectory.cloth().pattern().edge_lengths();
    let topology = trajectory.topology();
    let strains = metrics::largest_strain(trajectory.frames(), topology, &lengths)?;
    let beyond = strains.iter().position(|strain| *strain > bound);
    let Some(frame) = beyond else {
        return Ok(());
    };
    let most = strains.into_iter().fold(f64::NEG_INFINITY, f64::max);
    bail!(
        "from frame {frame} on an edge is strained beyond the bound of {bound}, by {most:.3} at most: cloth does not stretch so far; check the units and the rest pose (--rest, --flat), leave this trajectory out, or raise --max-strain"
    )
}
