//! What contact did in a run, and what it left in the frames that are written.

use selvedge::{LetThrough, let_through};
use selvedge_cloth::Scene;
use selvedge_data::Trajectory;
use selvedge_sim::{ContactCounts, ContactGauge, YieldedContact};
use serde::Serialize;

use crate::output::Facts;
use crate::progress::Progress;

/// Contact in a run.
#[derive(Clone, Serialize)]
pub(super) struct Touched {
    /// Pairs of faces that meet, exactly, over all frames at their written positions, but for what
    /// was let through; none where not all frames were looked at.
    intersections: Option<usize>,
    /// Smallest gap of a frame that was looked at `[m]`; none where all are above the thickness.
    smallest_gap: Option<f64>,
    /// The frame of it, counted from the start of the motion.
    smallest_gap_frame: Option<usize>,
    /// Solves with contact.
    solves: u64,
    /// Solves that were repeated.
    repeated: u64,
    /// Substeps that were divided.
    divisions: u64,
    /// Rounds in which vertices were held back.
    held_back: u64,
    /// Frames in which the cloth rested, and nothing was solved.
    resting: u64,
    /// Bodies that were let through the cloth, which they left no room.
    let_through: Vec<LetThrough>,
}

/// Measures the frames of a run that began after `passed` frames; none without contact. Stops
/// early where the user asks for it.
pub(super) fn measure(
    scene: &Scene,
    trajectory: &Trajectory,
    passed: usize,
    counts: ContactCounts,
    yielded: &[YieldedContact],
) -> Option<Touched> {
    let count = trajectory.frame_count();
    let progress = Progress::new("looking for intersections", count, "frames");
    let on_frame = || progress.step();
    let frames =
        ContactGauge::measure_run(scene, yielded, passed, trajectory.positions(), &on_frame)?;
    let intersections = frames.iter().map(|(_, found)| found.intersections);
    let gaps = frames
        .iter()
        .filter_map(|(frame, found)| Some((*frame, found.smallest_gap?)));
    let smallest = gaps.min_by(|a, b| a.1.total_cmp(&b.1));
    Some(Touched {
        intersections: (frames.len() == count).then(|| intersections.sum()),
        smallest_gap: smallest.map(|(_, gap)| gap),
        smallest_gap_frame: smallest.map(|(frame, _)| frame),
        solves: counts.solves,
        repeated: counts.repeated,
        divisions: counts.divisions,
        held_back: counts.held_back,
        resting: counts.resting,
        let_through: let_through(scene, yielded),
    })
}

impl Touched {
    /// Adds what is worth a line.
    pub(super) fn add_to(&self, facts: &mut Facts) {
        let met = match self.intersections {
            Some(0) => "no intersections".to_owned(),
            Some(count) => format!("{count} intersections"),
            None => "not all frames were looked at for intersections".to_owned(),
        };
        let gap = match (self.smallest_gap, self.smallest_gap_frame) {
            (Some(gap), Some(frame)) => {
                format!(", smallest gap {:.3} mm in frame {frame}", 1e3 * gap)
            }
            _ => ", nothing nearer than the thickness".to_owned(),
        };
        facts.add("contact", met + &gap);
        facts.add_all("let through", &self.let_through);
        if self.repeated + self.divisions > 0 {
            facts.add(
                "solves",
                format!(
                    "{}, {} repeated; {} substeps divided",
                    self.solves, self.repeated, self.divisions
                ),
            );
        }
        if self.resting > 0 {
            facts.add("at rest", format!("{} frames, not solved", self.resting));
        }
    }
}
