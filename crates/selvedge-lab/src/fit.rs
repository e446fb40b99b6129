//! Numbers of a scene found from what was seen of a cloth, or from where it is to be: the fabric, the
//! air, the start or the motion of the handles, by the gradients of the solver and L-BFGS within bounds.

mod numbers;
mod report;
mod search;
mod seen;
mod told;

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
use serde::{Deserialize, Serialize};

pub use self::numbers::Number;
use self::numbers::{Bounds, Trial};
pub use self::report::write;
use self::search::{Landscape, Look, Metric, Point, search};
use self::seen::{Mark, SeenFile};
pub use self::told::Direction;
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

/// What is to be fitted to what.
pub struct Order {
    /// The scene, with the numbers where the first search begins.
    pub loaded: LoadedScene,
    /// The numbers that are to be found.
    pub numbers: Vec<Number>,
    /// In order of their frames.
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
        Self::of_file(path).with_context(|| path.display().to_string())
    }

    fn of_file(path: &Path) -> Result<Self> {
        let text = selvedge_data::read_text(path).context("could not be read")?;
        let file: OrderFile = toml::from_str(&text)?;
        let (starts, runs) = (file.starts.unwrap_or(1), file.runs.unwrap_or(60));
        let is_some = (1..=1000).contains(&starts) && (1..=100_000).contains(&runs);
        ensure!(
            is_some,
            "starts must be 1 to 1000, runs 1 to 100000: {starts}, {runs}"
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
            noise: file.data.noise,
            seed: file.seed.unwrap_or(0),
            starts,
            runs,
        })
    }

    /// The numbers, each with its value at a part of its bounds.
    fn at(&self, parts: &[f64]) -> impl Iterator<Item = (&Number, f64)> {
        let pairs = self.numbers.iter().zip(parts);
        pairs.map(|(number, part)| (number, number.at(*part)))
    }
}

/// What a fit has found.
#[derive(Clone, Debug, Serialize)]
pub struct Fitted {
    /// The numbers.
    pub numbers: Vec<Number>,
    /// Root mean square distance of a coordinate `[m]`.
    pub rms: f64,
    /// Standard deviation of a coordinate by which errors are reckoned `[m]`: as the order has it, or
    /// from the distances that are left.
    pub noise: f64,
    /// Marks that were fitted.
    pub marks: usize,
    /// The distance at the start and the end of each search `[mm]`, the scene's own start first; none
    /// of one that failed.
    pub searches: Vec<Option<[f64; 2]>>,
    /// Runs of all searches: forward, and of these also backward.
    pub runs: [usize; 2],
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
    /// Positions of its run `[m]`, `[frames + 1][vertices]`, up to the last mark.
    #[serde(skip)]
    pub positions: Vec<Vec3>,
}

/// A run that was made.
struct Made {
    trial: Trial,
    start: Checkpoint,
    /// From each mark to its vertex `[m]`, `[marks]`.
    misses: Vec<DVec3>,
    positions: Vec<Vec3>,
}

impl Made {
    /// Mean square of the coordinates `[mm²]`.
    fn value(&self) -> f64 {
        let squares = self.misses.iter().map(|miss| miss.length_squared());
        1e6 * squares.sum::<f64>() / (3 * self.misses.len()) as f64
    }
}

/// A fit under way.
struct Fit<'a, 'r, 'e> {
    order: &'a Order,
    /// Where the motion begins; none in the rest pose, which moves with the fabric.
    start: Option<Checkpoint>,
    task: Task<'r, 'e>,
    runs: [usize; 2],
    /// Runs forward after which this search ends.
    most: usize,
    failures: Vec<Error>,
    /// The value where this search began, and the last run that it reached.
    first: Option<f64>,
    last: Option<(Vec<f64>, Made)>,
}

impl Fit<'_, '_, '_> {
    /// Makes a run, and the solver with its record; none where it was stopped.
    fn run(&self, at: &[f64], records: bool) -> Result<Option<(Made, Simulator)>> {
        let (order, task) = (self.order, &self.task);
        let trial = Trial::of(&order.loaded.scene, order.at(at));
        let flow = |is_stopped| match is_stopped {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let start = match &self.start {
            Some(start) => start.clone(),
            None => match sag_with_progress(&trial.scene, &mut |_| flow(task.is_stopped())) {
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
        let (mut positions, mut misses) = (rounded(&start.positions), Vec::new());
        let mut marks = order.marks.iter().peekable();
        for frame in 0..=order.marks.last().map_or(0, |mark| mark.frame) {
            if task.is_stopped() {
                return Ok(None);
            }
            if frame > 0 {
                solver.step(&path.next(&solver, trial.scene.physics.substeps as usize)?)?;
                positions.extend_from_slice(solver.positions());
            }
            while let Some(mark) = marks.next_if(|mark| mark.frame == frame) {
                misses.push(solver.positions_f64()[mark.vertex] - mark.place());
            }
        }
        let _ = task.advance();
        let made = Made {
            trial,
            start,
            misses,
            positions,
        };
        Ok(Some((made, solver)))
    }

    /// The derivatives of the value by the parts of the numbers.
    fn slope(&self, at: &[f64], made: &Made, solver: &mut Simulator) -> Result<Vec<f64>> {
        let scale = 2e6 / (3 * made.misses.len()) as f64;
        let mut left = self.order.marks.iter().zip(&made.misses).rev().peekable();
        let mut by = solver.backward(&mut |frame, by| {
            while let Some((mark, miss)) = left.next_if(|(mark, _)| mark.frame == frame) {
                by.positions[mark.vertex] += *miss * scale;
            }
        })?;
        let (scene, start) = (&made.trial.scene, &made.start);
        if self.start.is_none() {
            let rest = sag_gradient(scene, &start.positions, &by.start.positions)?;
            let (sum, rest) = (&mut by.materials[0], &rest.materials[0]);
            let add = |sums: &mut [f64], by: &[f64]| {
                sums.iter_mut().zip(by).for_each(|(sum, by)| *sum += by);
            };
            sum.density += rest.density;
            add(sum.stretch.as_flattened_mut(), rest.stretch.as_flattened());
            add(sum.bend.as_flattened_mut(), rest.bend.as_flattened());
        }
        let slopes = numbers::slopes(self.order.at(at), &made.trial, start, &by);
        let pairs = self.order.at(at).zip(slopes);
        Ok(pairs
            .map(|((number, value), slope)| slope * number.rate(value))
            .collect())
    }

    /// How the misses change with each number, in parts of its bounds: `[numbers][coordinates]`, from
    /// those `here` on or, without them, to both sides. None where it was stopped.
    fn changes(&self, at: &[f64], here: Option<&[DVec3]>) -> Result<Option<Vec<Vec<f64>>>> {
        let mut changes = Vec::new();
        for number in 0..at.len() {
            let beside = |step: f64| -> Result<Option<(f64, Vec<DVec3>)>> {
                let mut moved = at.to_vec();
                moved[number] = (at[number] + step).clamp(0.0, 1.0);
                let made = self.run(&moved, false).context("a change of the numbers")?;
                Ok(made.map(|(made, _)| (moved[number], made.misses)))
            };
            let step = if at[number] > 0.5 { -CHANGE } else { CHANGE };
            let other = match here {
                Some(here) => Some((at[number], here.to_vec())),
                None => beside(-step)?,
            };
            let (Some((a, after)), Some((b, before))) = (beside(step)?, other) else {
                return Ok(None);
            };
            let pairs = after.iter().zip(before);
            changes.push(
                pairs
                    .flat_map(|(x, y)| ((*x - y) / (a - b)).to_array())
                    .collect(),
            );
        }
        Ok(Some(changes))
    }

    /// As [`Landscape::look`]; none where it is stopped.
    fn try_at(&mut self, at: &[f64], bound: f64) -> Result<Option<Look>> {
        if self.runs[0] >= self.most {
            return Ok(None);
        }
        self.runs[0] += 1;
        let Some((made, mut solver)) = self.run(at, true)? else {
            return Ok(None);
        };
        let value = made.value();
        tracing::debug!("run {}: {:.4} mm at {at:?}", self.runs[0], value.sqrt());
        if value > bound {
            return Ok(Some(Look::Above(value)));
        }
        self.task.note(&format!("{:.3} mm off", value.sqrt()));
        self.runs[1] += 1;
        let (at, slope) = (at.to_vec(), self.slope(at, &made, &mut solver)?);
        self.first.get_or_insert(value);
        self.last = Some((at.clone(), made));
        Ok(Some(Look::Reached(Point { at, value, slope })))
    }
}

impl Landscape for Fit<'_, '_, '_> {
    fn look(&mut self, at: &[f64], bound: f64) -> Look {
        let found = self.try_at(at, bound);
        found.map_or_else(
            |error| {
                self.failures.push(error);
                Look::Failed
            },
            |found| found.unwrap_or(Look::Stop),
        )
    }

    /// The Gauss-Newton matrix of few numbers; of many, or where a run fails, what the value says alone.
    fn metric(&mut self) -> Metric {
        let Some((at, made)) = &self.last else {
            return Metric::of(Vec::new(), 0.0);
        };
        let value = made.value();
        // What is noise is no fault of the numbers.
        let noise = 1e6 * self.order.noise.unwrap_or(0.0).powi(2);
        let mut matrix = vec![vec![0.0; at.len()]; at.len()];
        if at.len() <= FEW
            && let Ok(Some(changes)) = self.changes(at, Some(&made.misses))
        {
            // The value is a mean of squares in mm².
            matrix = told::gauss_newton(&changes, (1.5e-6 * made.misses.len() as f64).sqrt());
            self.runs[0] += at.len();
        }
        Metric::of(matrix, (value - noise).max(0.01 * value))
    }
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
    let is_at_rest = scene.begins_at_rest();
    let start = (!is_at_rest).then(|| scene.start(&mut reporter.listener()));
    let what = format!("fitting {}", order.loaded.scene.name);
    let mut fit = Fit {
        order,
        start: start.transpose()?.map(|start| start.state),
        task: reporter.count(&what, order.starts * order.runs, "runs at most"),
        runs: [0; 2],
        most: 0,
        failures: Vec::new(),
        first: None,
        last: None,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(order.seed);
    let (mut best, mut searches): (Option<(Vec<f64>, Made)>, _) = (None, Vec::new());
    for number in 0..order.starts {
        let numbers = order.numbers.iter();
        let first = match number {
            0 => numbers.map(Number::part).collect(),
            _ => numbers.map(|_| rng.random()).collect(),
        };
        (fit.most, fit.first) = (fit.runs[0] + order.runs, None);
        search(first, &mut fit);
        let found = fit.last.take();
        let ends = fit.first.zip(found.as_ref());
        searches.push(ends.map(|(from, (_, made))| [from.sqrt(), made.value().sqrt()]));
        let all = best.into_iter().chain(found);
        best = all.min_by(|a, b| a.1.value().total_cmp(&b.1.value()));
        if fit.task.is_stopped() {
            break;
        }
    }
    let Some((at, made)) = best else {
        let why = fit.failures.into_iter().next();
        return why.map_or(Ok(None), |why| Err(why.context("where the searches begin")));
    };
    fit.task = reporter.count("looking at what the data tell", 2 * at.len(), "runs");
    let rms = 1e-3 * made.value().sqrt();
    let coordinates = (3 * order.marks.len()) as f64;
    let left = rms * (coordinates / (coordinates - at.len() as f64).max(1.0)).sqrt();
    let noise = order.noise.unwrap_or(left).max(f64::MIN_POSITIVE);
    let changes = if fit.task.is_stopped() { None } else { fit.changes(&at, None)? };
    let told = changes.map(|changes| told::directions(&changes, noise));
    let (directions, errors) = told.unzip();
    let mut numbers = order.numbers.clone();
    let errors = errors.unwrap_or_else(|| vec![None; at.len()]);
    for ((number, part), error) in numbers.iter_mut().zip(&at).zip(errors) {
        number.value = number.at(*part);
        number.error = error.map(|error| error * number.rate(number.value));
    }
    Ok(Some(Fitted {
        numbers,
        rms,
        noise,
        marks: order.marks.len(),
        searches,
        runs: fit.runs,
        failed: fit.failures.len(),
        directions,
        scene: made.trial.scene,
        start: made.start,
        positions: made.positions,
    }))
}
