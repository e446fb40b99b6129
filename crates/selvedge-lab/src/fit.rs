//! Numbers of a scene found from what was seen of a cloth, or from where it is to be: the fabric, the
//! air, the start or the motion of the handles, by the gradients of the solver and L-BFGS within bounds.

mod identifiability;
mod numbers;
mod report;
mod search;
mod seen;

use std::ops::ControlFlow;
use std::path::Path;

use anyhow::{Context, Error, Result, ensure};
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge::start::simulator_of_run;
use selvedge::{GradientSettings, rounded};
use selvedge_cloth::{Checkpoint, Scene, Stepper};
use selvedge_data::{LoadedScene, open_scene};
use selvedge_sim::{SagError, Simulator, sag_gradient, sag_with_progress};
use serde::Deserialize;

pub use self::identifiability::Direction;
use self::numbers::Bounds;
pub use self::numbers::Number;
use self::search::{Metric, Objective};
use self::seen::{Mark, SeenFile};
use crate::event::{OnEvent, Reporter, Task};

/// Part of the bounds by which numbers are changed for the Gauss-Newton matrix.
const CHANGE: f64 = 1e-2;
/// Numbers up to which a search begins with that matrix.
const FEW: usize = 12;

/// An order as people write it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OrderFile {
    scene: String,
    seed: Option<u64>,
    starts: Option<usize>,
    runs: Option<usize>,
    data: SeenFile,
    #[serde(default)]
    material: Bounds,
    #[serde(default)]
    environment: Bounds,
    #[serde(default)]
    start: Bounds,
    #[serde(default)]
    motion: Bounds,
}

/// What is to be fitted to what, and what was found.
pub struct Fit {
    /// The scene, with the numbers where the first search begins.
    pub loaded: LoadedScene,
    /// The numbers, at the end with what was found.
    pub numbers: Vec<Number>,
    /// Runs of all searches: forward, and of these also backward.
    pub runs: [usize; 2],
    /// Why runs failed.
    pub failures: Vec<Error>,
    /// Root mean square distance of a coordinate at the start and the end of each search `[mm]`.
    pub searches: Vec<[f64; 2]>,
    /// Standard deviation of a coordinate by which errors are reckoned `[mm]`: as the order has it, or
    /// from the distances that are left.
    pub noise: Option<f64>,
    /// Combinations of numbers, the best known first; none where the fit was stopped before.
    pub directions: Option<Vec<Direction>>,
    /// In order of their frames.
    marks: Vec<Mark>,
    seed: u64,
    starts: usize,
    most: usize,
    /// Where the motion begins; none in the rest pose, which moves with the fabric.
    start: Option<Checkpoint>,
    /// The last run that a search has reached; at the end that of what was found.
    made: Option<Made>,
}

/// A run that was made, at these parts of the bounds.
struct Made {
    at: Vec<f64>,
    scene: Scene,
    start: Checkpoint,
    /// From each mark to its vertex `[mm]`, `[marks]`.
    misses: Vec<DVec3>,
    positions: Vec<Vec3>,
}

impl Made {
    /// Mean square of the coordinates `[mm²]`.
    fn value(&self) -> f64 {
        let squares = self.misses.iter().map(|miss| miss.length_squared());
        squares.sum::<f64>() / (3 * self.misses.len()) as f64
    }
}

/// A search under way.
struct Search<'a, 'r, 'e> {
    fit: &'a mut Fit,
    task: &'a Task<'r, 'e>,
    /// Runs forward after which it ends.
    most: usize,
    /// The value where it began.
    first: Option<f64>,
}

impl Fit {
    /// Reads an order (.toml); the files that it names are relative to it.
    ///
    /// # Errors
    /// Names the file, the field and what is wrong with it.
    pub fn read(path: &Path) -> Result<Self> {
        Self::of_file(path).with_context(|| path.display().to_string())
    }

    fn of_file(path: &Path) -> Result<Self> {
        let text = selvedge_data::read_text(path).context("could not be read")?;
        let file: OrderFile = toml::from_str(&text)?;
        let (starts, most) = (file.starts.unwrap_or(1), file.runs.unwrap_or(60));
        let is_some = (1..=1000).contains(&starts) && (1..=100_000).contains(&most);
        ensure!(
            is_some,
            "starts must be 1 to 1000, runs 1 to 100000: {starts}, {most}"
        );
        let folder = path.parent().unwrap_or(Path::new(""));
        let beside = folder.join(&file.scene);
        let name = if beside.is_file() { beside.to_string_lossy() } else { file.scene.into() };
        let loaded = open_scene(&name).context("scene")?;
        let parts = [
            ("material", &file.material),
            ("environment", &file.environment),
            ("start", &file.start),
            ("motion", &file.motion),
        ];
        Ok(Self {
            numbers: numbers::numbers(&loaded.scene, parts)?,
            marks: file.data.read(folder, &loaded.scene).context("data")?,
            loaded,
            noise: file.data.noise.map(|metres| 1e3 * metres),
            seed: file.seed.unwrap_or(0),
            starts,
            most,
            runs: [0; 2],
            failures: Vec::new(),
            searches: Vec::new(),
            directions: None,
            start: None,
            made: None,
        })
    }

    /// The numbers, each with its value at a part of its bounds.
    fn at(&self, parts: &[f64]) -> impl Iterator<Item = (&Number, f64)> {
        let pairs = self.numbers.iter().zip(parts);
        pairs.map(|(number, part)| (number, number.at(*part)))
    }

    /// Makes a run, and the solver with its record; none where it was stopped.
    fn run(
        &self,
        at: &[f64],
        records: bool,
        task: &Task<'_, '_>,
    ) -> Result<Option<(Made, Simulator)>> {
        let (scene, begin) = numbers::placed(&self.loaded.scene, self.at(at))?;
        let flow = |is_stopped| {
            if is_stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let start = match &self.start {
            Some(start) => start.clone(),
            None => match sag_with_progress(&scene, &mut |_| flow(task.is_stopped())) {
                Err(SagError::Stopped { .. }) => return Ok(None),
                found => Checkpoint::at_rest(found.context("the rest pose")?.positions),
            },
        };
        let start = begin(start);
        let mut solver = simulator_of_run(&scene, &start)?;
        if records {
            solver.record_gradient(GradientSettings::default())?;
        }
        let mut path = scene.handle_path()?;
        let (mut positions, mut misses) = (rounded(&start.positions), Vec::new());
        let mut marks = self.marks.iter().peekable();
        for frame in 0..=self.marks.last().map_or(0, |mark| mark.frame) {
            if task.is_stopped() {
                return Ok(None);
            }
            if frame > 0 {
                solver.step(&path.next(&solver, scene.physics.substeps as usize)?)?;
                positions.extend_from_slice(solver.positions());
            }
            while let Some(mark) = marks.next_if(|mark| mark.frame == frame) {
                misses.push(1e3 * (solver.positions_f64()[mark.vertex] - mark.place()));
            }
        }
        let _ = task.advance();
        let at = at.to_vec();
        let made = Made {
            at,
            scene,
            start,
            misses,
            positions,
        };
        Ok(Some((made, solver)))
    }

    /// The derivatives of the value by the parts of the numbers.
    fn slope(&self, made: &Made, solver: &mut Simulator) -> Result<Vec<f64>> {
        let (at, scene, start, misses) = (&made.at, &made.scene, &made.start, &made.misses);
        let scale = 2e3 / (3 * misses.len()) as f64;
        let mut left = self.marks.iter().zip(misses).rev().peekable();
        let mut by = solver.backward(&mut |frame, by| {
            while let Some((mark, miss)) = left.next_if(|(mark, _)| mark.frame == frame) {
                by.positions[mark.vertex] += *miss * scale;
            }
        })?;
        if self.start.is_none() {
            let rest = sag_gradient(scene, &start.positions, &by.start.positions)?;
            let (sum, rest) = (&mut by.materials[0], &rest.materials[0]);
            let add =
                |sums: &mut [f64], by: &[f64]| sums.iter_mut().zip(by).for_each(|(s, by)| *s += by);
            add(sum.stretch.as_flattened_mut(), rest.stretch.as_flattened());
            add(sum.bend.as_flattened_mut(), rest.bend.as_flattened());
            sum.density += rest.density;
        }
        let slopes = numbers::slopes(self.at(at), scene, start, &by)?;
        let pairs = self.at(at).zip(slopes);
        Ok(pairs
            .map(|((number, value), slope)| slope * number.rate(value))
            .collect())
    }

    /// How the misses of `made` change with each number, in parts of its bounds:
    /// `[numbers][coordinates]`. None where it was stopped.
    fn changes(&self, made: &Made, task: &Task<'_, '_>) -> Result<Option<Vec<Vec<f64>>>> {
        let mut changes = Vec::new();
        for number in 0..made.at.len() {
            let mut at = made.at.clone();
            let step = if at[number] > 0.5 { -CHANGE } else { CHANGE };
            at[number] += step;
            let Some((moved, _)) = self.run(&at, false, task)? else {
                return Ok(None);
            };
            let pairs = moved.misses.iter().zip(&made.misses);
            let rows = pairs.flat_map(|(a, b)| ((*a - *b) / step).to_array());
            changes.push(rows.collect());
        }
        Ok(Some(changes))
    }

    /// So many searches, the first from the scene's own numbers, the others from places within the bounds
    /// that the seed chooses; then measures what the data identify. Returns false where it was stopped before
    /// the first run had ended.
    ///
    /// # Errors
    /// A start that cannot be had; a solver that fails, or has no gradients, at the start of every search.
    pub fn search(&mut self, on_event: &mut OnEvent<'_>) -> Result<bool> {
        let reporter = Reporter::new(on_event);
        let scene = selvedge::Scene::from(self.loaded.clone());
        if !scene.begins_at_rest() {
            self.start = Some(scene.start(&mut reporter.listener())?.state);
        }
        let what = format!("fitting {}", self.loaded.scene.name);
        let task = reporter.count(&what, self.starts * self.most, "runs at most");
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut best: Option<Made> = None;
        for number in 0..self.starts {
            let numbers = self.numbers.iter();
            let at = match number {
                0 => numbers.map(Number::part).collect(),
                _ => numbers.map(|_| rng.random()).collect(),
            };
            let most = self.runs[0] + self.most;
            let mut search = Search {
                fit: &mut *self,
                task: &task,
                most,
                first: None,
            };
            search::search(at, &mut search);
            let first = search.first;
            if let (Some(first), Some(found)) = (first, self.made.take()) {
                self.searches.push([first, found.value()].map(f64::sqrt));
                let all = best.into_iter().chain([found]);
                best = all.min_by(|a, b| a.value().total_cmp(&b.value()));
            }
            if task.is_stopped() {
                break;
            }
        }
        drop(task);
        let Some(made) = best else {
            let why = self.failures.pop();
            let why = why.map(|why| why.context("where the searches begin"));
            return why.map_or(Ok(false), Err);
        };
        let task = reporter.count("measuring what the data identify", made.at.len(), "runs");
        let (all, numbers) = ((3 * made.misses.len()) as f64, made.at.len() as f64);
        let left = (made.value() * all / (all - numbers).max(1.0)).sqrt();
        let noise = *self.noise.get_or_insert(left.max(f64::MIN_POSITIVE));
        // What was found is kept where a run beside it fails.
        let changes = self.changes(&made, &task).unwrap_or_else(|error| {
            self.failures.push(error);
            Some(Vec::new())
        });
        let known = changes.map(|changes| identifiability::directions(&changes, noise));
        let (directions, errors) = known.unzip();
        let errors = errors.into_iter().flatten();
        let errors = errors.chain(std::iter::repeat(f64::NAN));
        for ((number, part), error) in self.numbers.iter_mut().zip(&made.at).zip(errors) {
            number.value = number.at(*part);
            number.error = error * number.rate(number.value);
        }
        (self.directions, self.made) = (directions, Some(made));
        Ok(true)
    }
}

impl Search<'_, '_, '_> {
    fn try_at(&mut self, at: &[f64], bound: f64) -> Result<Option<(f64, Vec<f64>)>> {
        let Some((made, mut solver)) = self.fit.run(at, true, self.task)? else {
            return Ok(None);
        };
        let value = made.value();
        tracing::debug!("run {}: {:.4} mm at {at:?}", self.fit.runs[0], value.sqrt());
        if value > bound {
            return Ok(Some((value, Vec::new())));
        }
        self.task.note(&format!("{:.3} mm off", value.sqrt()));
        self.fit.runs[1] += 1;
        let slope = self.fit.slope(&made, &mut solver)?;
        self.first.get_or_insert(value);
        self.fit.made = Some(made);
        Ok(Some((value, slope)))
    }
}

impl Objective for Search<'_, '_, '_> {
    fn evaluate(&mut self, at: &[f64], bound: f64) -> Option<(f64, Vec<f64>)> {
        if self.fit.runs[0] >= self.most {
            return None;
        }
        self.fit.runs[0] += 1;
        self.try_at(at, bound).unwrap_or_else(|error| {
            tracing::debug!("run {}: {error:#}", self.fit.runs[0]);
            self.fit.failures.push(error);
            Some((f64::INFINITY, Vec::new()))
        })
    }

    /// The Gauss-Newton matrix of few numbers; of many, or where a run fails, what the value says alone.
    fn metric(&mut self) -> Metric {
        let Some(made) = &self.fit.made else {
            return Metric::of(Vec::new(), 0.0);
        };
        let (value, numbers) = (made.value(), made.at.len());
        let mut matrix = vec![vec![0.0; numbers]; numbers];
        if numbers <= FEW
            && let Ok(Some(changes)) = self.fit.changes(made, self.task)
        {
            // The value is a mean of squares.
            matrix =
                identifiability::gauss_newton(&changes, (1.5 * made.misses.len() as f64).sqrt());
            self.fit.runs[0] += numbers;
        }
        // What is noise is no fault of the numbers.
        let noise = self.fit.noise.unwrap_or(0.0).powi(2);
        Metric::of(matrix, (value - noise).max(0.01 * value))
    }
}

#[cfg(test)]
mod tests;
