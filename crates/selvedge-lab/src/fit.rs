//! Numbers of a scene found from what was seen of a cloth, or from where it is to be: the fabric, the
//! air, the start or the motion of the handles, by the gradients of the solver and L-BFGS within bounds.

mod numbers;
mod report;
mod search;
mod seen;
mod told;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, ensure};
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge::start::simulator_of_run;
use selvedge::{GradientSettings, rounded};
use selvedge_cloth::{Checkpoint, Scene, Stepper};
use selvedge_data::{LoadedScene, open_scene};
use selvedge_sim::{SagError, Simulator, sag_gradient, sag_with_progress};
use serde::{Deserialize, Serialize};

pub use self::numbers::Number;
use self::numbers::{EnvironmentFile, MaterialFile, MotionFile, StartFile, Trial};
pub use self::report::write;
use self::search::{Landscape, Look, Metric, Point};
use self::seen::{Mark, SeenFile};
pub use self::told::Direction;
use crate::event::{End, Event, OnEvent, Reporter, Task};

/// Part of the bounds by which numbers are changed for the Gauss-Newton matrix.
const CHANGE: f64 = 1e-2;
/// Numbers up to which a search begins with the Gauss-Newton matrix.
const FEW: usize = 12;

/// An order as people write it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OrderFile {
    scene: String,
    #[serde(default)]
    seed: u64,
    #[serde(default = "one")]
    starts: usize,
    #[serde(default = "usual_runs")]
    runs: usize,
    data: SeenFile,
    #[serde(default)]
    material: MaterialFile,
    #[serde(default)]
    environment: EnvironmentFile,
    #[serde(default)]
    start: StartFile,
    #[serde(default)]
    motion: MotionFile,
}

fn one() -> usize {
    1
}

fn usual_runs() -> usize {
    60
}

/// What is to be fitted to what.
pub struct Order {
    /// The scene, with the numbers where the first search begins.
    pub loaded: LoadedScene,
    /// The numbers that are to be found.
    pub numbers: Vec<Number>,
    /// The files that were read.
    pub files: Vec<PathBuf>,
    marks: Vec<Mark>,
    noise: Option<f64>,
    seed: u64,
    starts: usize,
    runs: usize,
}

impl Order {
    /// Reads an order (.toml); the files that it names are relative to it.
    ///
    /// # Errors
    /// Names the file, the field and what is wrong with it.
    pub fn read(path: &Path) -> Result<Self> {
        let name = || path.display().to_string();
        let text = selvedge_data::read_text(path).with_context(name)?;
        let file: OrderFile = toml::from_str(&text).with_context(name)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let beside = folder.join(&file.scene);
        let scene = if beside.is_file() {
            beside.to_string_lossy().into_owned()
        } else {
            file.scene.clone()
        };
        let loaded = open_scene(&scene).with_context(|| format!("{}: scene", name()))?;
        ensure!(
            (1..=1000).contains(&file.starts) && (1..=100_000).contains(&file.runs),
            "{}: starts must be 1 to 1000, and runs 1 to 100000; found {} and {}",
            name(),
            file.starts,
            file.runs
        );
        let OrderFile {
            material,
            environment,
            start,
            motion,
            ..
        } = &file;
        let numbers = numbers::numbers(&loaded.scene, material, environment, start, motion);
        let (seen, marks) = file.data.read(folder, &loaded.scene).with_context(name)?;
        let mut files = loaded.files.clone();
        files.extend([path.to_owned(), seen]);
        Ok(Self {
            numbers: numbers.with_context(name)?,
            loaded,
            files,
            marks,
            noise: file.data.noise,
            seed: file.seed,
            starts: file.starts,
            runs: file.runs,
        })
    }

    fn values(&self, at: &[f64]) -> Vec<f64> {
        self.numbers
            .iter()
            .zip(at)
            .map(|(number, part)| number.at(*part))
            .collect()
    }

    /// Frames after the start in which something was seen.
    fn frames(&self) -> usize {
        self.marks.last().map_or(0, |mark| mark.frame)
    }
}

/// A number that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Found {
    /// The number.
    #[serde(flatten)]
    pub number: Number,
    /// Its value.
    pub value: f64,
    /// Its standard error; none where the data do not tell it, or nobody has looked.
    pub error: Option<f64>,
    /// True where it is at one of its bounds.
    pub is_at_bound: bool,
}

/// The end of one search.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SearchEnd {
    /// Root mean square distance of a coordinate at its start and at its end `[m]`; none where the
    /// solver failed at the start.
    pub rms: Option<[f64; 2]>,
    /// Runs forward and backward.
    pub runs: [usize; 2],
}

/// What a fit has found.
#[derive(Clone, Debug, Serialize)]
pub struct Fitted {
    /// The numbers.
    pub numbers: Vec<Found>,
    /// Root mean square distance of a coordinate `[m]`.
    pub rms: f64,
    /// Standard deviation of a coordinate by which errors are reckoned `[m]`: as the order has it, or
    /// from the distances that are left.
    pub noise: f64,
    /// Marks that were fitted.
    pub marks: usize,
    /// Searches, the scene's own start first.
    pub searches: Vec<SearchEnd>,
    /// Runs that failed.
    pub failed: usize,
    /// Combinations of numbers, the best told first; none after an interruption.
    pub directions: Option<Vec<Direction>>,
    /// The scene with the numbers in it.
    #[serde(skip)]
    pub scene: Scene,
    /// Where its motion begins.
    #[serde(skip)]
    pub start: Checkpoint,
    /// Positions of its run `[m]`, `[frames + 1][vertices]`, as far as something was seen.
    #[serde(skip)]
    pub positions: Vec<Vec3>,
    /// The end that the fit came to.
    #[serde(skip)]
    pub end: End,
}

/// A run that was made.
struct Made {
    solver: Simulator,
    trial: Trial,
    start: Checkpoint,
    /// From each mark to its vertex `[m]`, `[marks]`.
    misses: Vec<DVec3>,
    positions: Vec<Vec3>,
}

enum Ran {
    Stopped,
    Failed(anyhow::Error),
    Done(Box<Made>),
}

struct Fit<'a> {
    order: &'a Order,
    /// Where the motion begins; none in the rest pose, which moves with the fabric.
    start: Option<Checkpoint>,
}

impl Fit<'_> {
    fn run(&self, at: &[f64], records: bool, task: &Task<'_, '_>) -> Ran {
        let made = self.make(at, records, task);
        // Where it is to stop, the next frame hears of it.
        let _ = task.advance();
        match made {
            Ok(Some(made)) => Ran::Done(Box::new(made)),
            Ok(None) => Ran::Stopped,
            Err(error) => Ran::Failed(error),
        }
    }

    fn make(&self, at: &[f64], records: bool, task: &Task<'_, '_>) -> Result<Option<Made>> {
        let order = self.order;
        let trial = Trial::of(&order.loaded.scene, &order.numbers, &order.values(at));
        let flow =
            || if task.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let start = match &self.start {
            Some(start) => start.clone(),
            None => match sag_with_progress(&trial.scene, &mut |_| flow()) {
                Err(SagError::Stopped { .. }) => return Ok(None),
                found => Checkpoint::at_rest(found.context("the rest pose")?.positions),
            },
        };
        let start = trial.begin(start);
        let mut solver = simulator_of_run(&trial.scene, &start)?;
        if records {
            solver.record_gradient(GradientSettings::default())?;
        }
        let mut path = trial.scene.handle_path()?;
        let mut positions = rounded(&start.positions);
        let mut misses = Vec::with_capacity(order.marks.len());
        let mut marks = order.marks.iter().peekable();
        for frame in 0..=order.frames() {
            if frame > 0 {
                if task.is_stopped() {
                    return Ok(None);
                }
                let targets = path.next(&solver, trial.scene.physics.substeps as usize)?;
                solver.step(&targets)?;
                positions.extend_from_slice(solver.positions());
            }
            while let Some(mark) = marks.next_if(|mark| mark.frame == frame) {
                misses.push(solver.positions_f64()[mark.vertex] - mark.place());
            }
        }
        Ok(Some(Made {
            solver,
            trial,
            start,
            misses,
            positions,
        }))
    }

    /// The derivatives of the value by the parts of the numbers.
    fn slope(&self, at: &[f64], made: &mut Made) -> Result<Vec<f64>> {
        let order = self.order;
        let scale = 2e6 / (3.0 * made.misses.len() as f64);
        let mut left = order.marks.iter().zip(&made.misses).rev().peekable();
        let mut by = made.solver.backward(&mut |frame, by| {
            while let Some((mark, miss)) = left.next_if(|(mark, _)| mark.frame == frame) {
                by.positions[mark.vertex] += *miss * scale;
            }
        })?;
        if self.start.is_none() {
            let rest = sag_gradient(
                &made.trial.scene,
                &made.start.positions,
                &by.start.positions,
            )?;
            for (sum, rest) in by.materials.iter_mut().zip(rest.materials) {
                sum.density += rest.density;
                let tables = [
                    (sum.stretch.as_flattened_mut(), rest.stretch.as_flattened()),
                    (sum.bend.as_flattened_mut(), rest.bend.as_flattened()),
                ];
                for (sums, rest) in tables {
                    sums.iter_mut().zip(rest).for_each(|(sum, by)| *sum += by);
                }
            }
        }
        let pairs = order.numbers.iter().zip(order.values(at));
        pairs
            .map(|(number, value)| {
                Ok(number.slope(value, &made.trial, &made.start, &by)? * number.rate(value))
            })
            .collect()
    }

    /// How the misses change with each number, in parts of its bounds: `[numbers][coordinates]`, from
    /// those `here` on, or else to both sides. None where it was stopped.
    fn changes(
        &self,
        at: &[f64],
        here: Option<&[DVec3]>,
        task: &Task<'_, '_>,
    ) -> Result<Option<Vec<Vec<f64>>>> {
        let mut changes = Vec::new();
        for number in 0..at.len() {
            let beside = |step: f64| {
                let mut moved = at.to_vec();
                moved[number] = (at[number] + step).clamp(0.0, 1.0);
                match self.run(&moved, false, task) {
                    Ran::Stopped => Ok(None),
                    Ran::Failed(error) => Err(error.context("a change of the numbers")),
                    Ran::Done(made) => Ok(Some((moved[number], made.misses))),
                }
            };
            let inwards = if at[number] > 0.5 { -CHANGE } else { CHANGE };
            let other = match here {
                Some(here) => Some((at[number], here.to_vec())),
                None => beside(-inwards)?,
            };
            let (Some((a, after)), Some((b, before))) = (beside(inwards)?, other) else {
                return Ok(None);
            };
            let pairs = after.iter().zip(before);
            let coordinates =
                pairs.flat_map(|(after, before)| ((*after - before) / (a - b)).to_array());
            changes.push(coordinates.collect());
        }
        Ok(Some(changes))
    }
}

/// A search under way.
struct Search<'a, 'r, 'e> {
    fit: &'a Fit<'a>,
    task: &'a Task<'r, 'e>,
    /// Forward and backward.
    runs: [usize; 2],
    failed: Vec<anyhow::Error>,
    /// The value at the first place.
    first: Option<f64>,
    /// The last place that was reached, its value and its misses.
    last: Option<(Vec<f64>, f64, Vec<DVec3>)>,
}

impl Landscape for Search<'_, '_, '_> {
    fn look(&mut self, at: &[f64], bound: f64) -> Result<Look> {
        if self.runs[0] >= self.fit.order.runs {
            return Ok(Look::Stop);
        }
        self.runs[0] += 1;
        let mut made = match self.fit.run(at, true, self.task) {
            Ran::Stopped => return Ok(Look::Stop),
            Ran::Failed(error) => {
                self.failed.push(error);
                return Ok(Look::Failed);
            }
            Ran::Done(made) => made,
        };
        let value = mean_square(&made.misses);
        tracing::debug!("run {}: {value:.6} mm² at {at:?}", self.runs[0]);
        if value > bound {
            return Ok(Look::Above(value));
        }
        self.task.note(&format!("{:.3} mm off", value.sqrt()));
        self.runs[1] += 1;
        let slope = match self.fit.slope(at, &mut made) {
            Ok(slope) => slope,
            Err(error) => {
                self.failed.push(error);
                return Ok(Look::Failed);
            }
        };
        self.first.get_or_insert(value);
        self.last = Some((at.to_vec(), value, made.misses));
        Ok(Look::Reached(Point {
            at: at.to_vec(),
            value,
            slope,
        }))
    }

    /// The Gauss-Newton matrix of few numbers, by a run for each; none of many, or where one fails.
    fn metric(&mut self) -> Result<Option<Metric>> {
        let Some((at, value, misses)) = self.last.as_ref().filter(|last| last.0.len() <= FEW)
        else {
            return Ok(None);
        };
        let changes = self.fit.changes(at, Some(misses), self.task);
        self.runs[0] += at.len();
        // The value is a mean of squares in mm².
        let unit = (1e-6 * 1.5 * misses.len() as f64).sqrt();
        // What is noise is no fault of the numbers.
        let noise = 1e6 * self.fit.order.noise.unwrap_or(0.0).powi(2);
        let fault = (value - noise).max(0.01 * value);
        let metric = |changes: Vec<Vec<f64>>| Metric::of(told::gauss_newton(&changes, unit), fault);
        Ok(changes.ok().flatten().map(metric))
    }
}

/// Mean square of the coordinates `[mm²]`.
fn mean_square(misses: &[DVec3]) -> f64 {
    1e6 * misses.iter().map(|miss| miss.length_squared()).sum::<f64>() / (3.0 * misses.len() as f64)
}

/// Fits the numbers of an order: so many searches, the first from the scene's own numbers, the others from
/// places within the bounds that the seed chooses; then looks at what the data tell. None where it
/// was stopped before the first run had ended.
///
/// # Errors
/// A start that cannot be had; a solver that fails, or has no gradients, at the start of every search.
pub fn fit(order: &Order, on_event: &mut OnEvent<'_>) -> Result<Option<Fitted>> {
    let reporter = Reporter::new(on_event);
    let scene = selvedge::Scene::from(order.loaded.clone());
    let start = match scene.begins_at_rest() {
        true => None,
        false => Some(scene.start(&mut reporter.listener())?.state),
    };
    let fit = Fit { order, start };
    let mut rng = ChaCha8Rng::seed_from_u64(order.seed);
    let (mut best, mut searches): (Option<Point>, Vec<SearchEnd>) = (None, Vec::new());
    let (mut failed, mut why) = (0, None);
    let task = reporter.count(
        &format!("fitting {}", order.loaded.scene.name),
        order.starts * order.runs,
        "runs at most",
    );
    for number in 0..order.starts {
        let first: Vec<f64> = match number {
            0 => order.numbers.iter().map(Number::part).collect(),
            _ => order.numbers.iter().map(|_| rng.random()).collect(),
        };
        let mut under_way = Search {
            fit: &fit,
            task: &task,
            runs: [0; 2],
            failed: Vec::new(),
            first: None,
            last: None,
        };
        let found = search::search(first, &mut under_way)?;
        let Search {
            runs,
            first,
            failed: errors,
            ..
        } = under_way;
        let both = first
            .zip(found.as_ref())
            .map(|(value, found)| [value, found.value]);
        let rms = both.map(|both| both.map(|value| 1e-3 * value.sqrt()));
        searches.push(SearchEnd { rms, runs });
        failed += errors.len();
        why = why.or(errors.into_iter().next());
        if let Some(found) = found
            && best.as_ref().is_none_or(|best| found.value < best.value)
        {
            best = Some(found);
        }
        if task.is_stopped() {
            break;
        }
    }
    drop(task);
    let Some(best) = best else {
        return match why {
            Some(why) => Err(why.context("the solver fails where the searches begin")),
            None => Ok(None),
        };
    };
    let numbers = order.numbers.len();
    let coordinates = 3 * order.marks.len();
    let task = reporter.count("looking at what the data tell", 2 * numbers + 1, "runs");
    let left = (best.value * coordinates as f64
        / coordinates.saturating_sub(numbers).max(1) as f64)
        .sqrt();
    let noise = order.noise.unwrap_or(1e-3 * left).max(f64::MIN_POSITIVE);
    let told = match task.is_stopped() {
        true => None,
        false => fit.changes(&best.at, None, &task)?,
    };
    let told = told.map(|changes| told::directions(&changes, noise));
    let end = if told.is_some() { End::Complete } else { End::Interrupted };
    // The last run is made whatever is asked: its files belong to the numbers.
    let mut deaf = |_: Event<'_>| ControlFlow::Continue(());
    let quiet = Reporter::new(&mut deaf);
    let made = fit.make(&best.at, false, &quiet.count("", 1, ""))?;
    let made = made.ok_or_else(|| anyhow!("the last run was stopped"))?;
    let (directions, errors) = told.unzip();
    let errors = errors.unwrap_or_else(|| vec![None; numbers]);
    let values = order.values(&best.at);
    let found = order
        .numbers
        .iter()
        .zip(values)
        .zip(best.at.iter().zip(errors));
    let found = found.map(|((number, value), (part, error))| Found {
        error: error.map(|error| error * number.rate(value)),
        is_at_bound: *part <= 0.0 || *part >= 1.0,
        number: number.clone(),
        value,
    });
    Ok(Some(Fitted {
        numbers: found.collect(),
        rms: 1e-3 * best.value.sqrt(),
        noise,
        marks: order.marks.len(),
        searches,
        failed,
        directions,
        scene: made.trial.scene,
        start: made.start,
        positions: made.positions,
        end,
    }))
}
