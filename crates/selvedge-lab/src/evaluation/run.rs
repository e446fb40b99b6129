//! Runs and times: what an evaluation finds.

use selvedge_data::metrics::Character;
use selvedge_model::Departure;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::measures::FrameErrors;
use super::method::Kind;
use crate::watched::GuardSummary;

/// The outcome of an evaluation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evaluation {
    /// By case, start and method; whole runs last.
    pub runs: Vec<Run>,
    /// By mesh and method.
    pub timings: Vec<Timing>,
}

/// One run of a method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// The data set, or the kind of scenes.
    pub set: String,
    /// The motion, or the scene.
    pub case: String,
    /// The mesh, in words.
    pub mesh: String,
    /// The method.
    pub method: String,
    /// Its kind.
    pub kind: Kind,
    /// The frame in whose true state it started.
    pub start: usize,
    /// It goes from the first frame to the last.
    pub is_whole: bool,
    /// Frames per second.
    pub frame_rate: f64,
    /// After each of the horizons; after every frame of a whole run. Fewer where it failed.
    pub frames: Vec<FrameErrors>,
    /// Of a whole run: the first of more than ten frames in a row in which some edge strains over
    /// 30 % and over 1.5 times the truth's largest strain, or the first that was not reached.
    pub diverged_frame: Option<usize>,
    /// Of a whole run: mean speed of the vertices in its last second `[m/s]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub final_speed: Option<f64>,
    /// Counts of the guard; none without a guard.
    pub guarded: Option<GuardSummary>,
    /// The character of a whole run's motion, and of its truth's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub character: Option<(Character, Character)>,
    /// How a whole run goes beyond what the model was trained on; nothing where its file does not
    /// say.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub out_of_distribution: Vec<Departure>,
    /// The reason of an early end.
    pub failure: Option<String>,
}

/// The time of a frame of one method on one mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// The mesh, in words.
    pub mesh: String,
    /// The method.
    pub method: String,
    /// Its kind.
    pub kind: Kind,
    /// Wall time on one thread, median over frames `[ms]`.
    pub ms_per_frame: f64,
}

impl Run {
    /// The frame so many frames after the start, where it was reached and measured.
    pub fn at(&self, frame: usize) -> Option<FrameErrors> {
        self.frames.iter().find(|at| at.frame == frame).copied()
    }

    /// All frames as one; none where the run failed.
    pub fn over_time(&self) -> Option<FrameErrors> {
        let all = FrameErrors::over_time(&self.frames);
        all.filter(|_| self.failure.is_none())
    }

    /// The run for programs; a whole run has its frames as one, under `whole`.
    pub fn to_json(&self) -> Result<Value, serde_json::Error> {
        let mut value = serde_json::to_value(self)?;
        if let (true, Some(fields)) = (self.is_whole, value.as_object_mut()) {
            fields.remove("frames");
            fields.insert("whole".to_owned(), serde_json::to_value(self.over_time())?);
        }
        Ok(value)
    }
}
