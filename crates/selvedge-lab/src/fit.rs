//! Numbers of a scene found from what was seen of a cloth, or from where it is to be: the fabric, the
//! air, the start or the motion of the handles, by the gradients of the solver and L-BFGS within bounds.

mod numbers;
mod report;
mod search;
mod seen;
mod told;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::{Context, Error, Result, anyhow, ensure};
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
use crate::event::{End, Event, OnEvent, Reporter, Task};

/// Part of the bounds by which numbers are changed for the Gauss-Newton matrix.
const CHANGE: f64 = 1e-2;
/// Numbers up to which a search begins with that matrix.
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
    material: Bounds,
    #[serde(default)]
    environment: Bounds,
    #[serde(default)]
    start: Bounds,
    #[serde(default)]
    motion: Bounds,
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
        let OrderFile {
            scene,
            seed,
            starts,
            runs,
            data,
            material,
            environment,
            start,
            motion,
        } = toml::from_str(&text)?;
        let is_some = (1..=1000).contains(&starts) && (1..=100_000).contains(&runs);
        ensure!(
            is_some,
            "starts must be 1 to 1000, runs 1 to 100000; found {starts} and {runs}"
        );
        let folder = path.parent().unwrap_or(Path::new(""));
        let beside = folder.join(&scene);
        let name = if beside.is_file() { beside.to_string_lossy() } else { scene.into() };
        let loaded = open_scene(&name).context("scene")?;
        let parts = [
            ("material", &material),
            ("environment", &environment),
            ("start", &start),
            ("motion", &motion),
        ];
        Ok(Self {
            numbers: numbers::numbers(&loaded.scene, parts)?,
            marks: data.read(folder, &loaded.scene).context("data")?,
            loaded,
            noise: data.noise,
            seed,
            starts,
            runs,
        })
    }

    fn values(&self, at: &[f64]) -> Vec<f64> {
        self.numbers
            .iter()
            .zip(at)
            .map(|(number, part)| number.at(*part))
            .collect()
    }
}

/// A number that was found.
#[derive(Clone, Debug, Serialize)]
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
    /// That distance at the start and the end of each search `[m]`, the scene's own start first; none
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

/// Mean square of the coordinates `[mm²]`.
fn mean_square(misses: &[DVec3]) -> f64 {
    1e6 * misses.iter().map(|miss| miss.length_squared()).sum::<f64>() / (3.0 * misses.len() as f64)
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
    /// The value where this search began.
    first: Option<f64>,
    /// The last place that was reached, and its misses.
    last: (Vec<f64>, Vec<DVec3>),
}

impl Fit<'_, '_, '_> {
    /// Makes a run; none where it was stopped.
    fn run(&self, at: &[f64], records: bool) -> Result<Option<Made>> {
        let (order, is_stopped) = (self.order, || self.task.is_stopped());
        let trial = Trial::of(&order.loaded.scene, &order.numbers, &order.values(at));
        let mut flow =
            |_| if is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let start = match &self.start {
            Some(start) => start.clone(),
            None => match sag_with_progress(&trial.scene, &mut flow) {
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
        for (frame, marks) in (0..).zip(by_frame(&order.marks)) {
            if is_stopped() {
                return Ok(None);
            }
            if frame > 0 {
                solver.step(&path.next(&solver, trial.scene.physics.substeps as usize)?)?;
                positions.extend_from_slice(solver.positions());
            }
            let places = solver.positions_f64();
            misses.extend(marks.iter().map(|mark| places[mark.vertex] - mark.place()));
        }
        let _ = self.task.advance();
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
        let marks = &self.order.marks;
        let scale = 2e6 / (3.0 * marks.len() as f64);
        let mut by = made.solver.backward(&mut |frame, by| {
            let first = marks.partition_point(|mark| mark.frame < frame);
            let seen = marks[first..].iter().zip(&made.misses[first..]);
            for (mark, miss) in seen.take_while(|(mark, _)| mark.frame == frame) {
                by.positions[mark.vertex] += *miss * scale;
            }
        })?;
        if self.start.is_none() {
            let rest = sag_gradient(
                &made.trial.scene,
                &made.start.positions,
                &by.start.positions,
            )?;
            let add = |sums: &mut [f64], by: &[f64]| {
                sums.iter_mut().zip(by).for_each(|(sum, by)| *sum += by)
            };
            let (sum, rest) = (&mut by.materials[0], &rest.materials[0]);
            sum.density += rest.density;
            add(sum.stretch.as_flattened_mut(), rest.stretch.as_flattened());
            add(sum.bend.as_flattened_mut(), rest.bend.as_flattened());
        }
        let pairs = self.order.numbers.iter().zip(self.order.values(at));
        let slope = |(number, value): (&Number, f64)| {
            number.slope(value, &made.trial, &made.start, &by) * number.rate(value)
        };
        Ok(pairs.map(slope).collect())
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
                Ok(made.map(|made| (moved[number], made.misses)))
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

    fn fails(&mut self, error: Error) -> Look {
        tracing::debug!("{error:#}");
        self.failures.push(error);
        Look::Failed
    }
}

/// The marks of each frame, from 0 to the last one that has any.
fn by_frame(marks: &[Mark]) -> impl Iterator<Item = &[Mark]> {
    let frames = marks.last().map_or(0, |mark| mark.frame + 1);
    let before = |frame| marks.partition_point(|mark| mark.frame < frame);
    (0..frames).map(move |frame| &marks[before(frame)..before(frame + 1)])
}

impl Landscape for Fit<'_, '_, '_> {
    fn look(&mut self, at: &[f64], bound: f64) -> Look {
        if self.runs[0] >= self.most {
            return Look::Stop;
        }
        self.runs[0] += 1;
        let mut made = match self.run(at, true) {
            Ok(Some(made)) => made,
            Ok(None) => return Look::Stop,
            Err(error) => return self.fails(error),
        };
        let value = mean_square(&made.misses);
        tracing::debug!("run {}: {:.4} mm at {at:?}", self.runs[0], value.sqrt());
        if value > bound {
            return Look::Above(value);
        }
        self.task.note(&format!("{:.3} mm off", value.sqrt()));
        self.runs[1] += 1;
        match self.slope(at, &mut made) {
            Err(error) => self.fails(error),
            Ok(slope) => {
                self.first.get_or_insert(value);
                self.last = (at.to_vec(), made.misses);
                Look::Reached(Point {
                    at: at.to_vec(),
                    value,
                    slope,
                })
            }
        }
    }

    /// The Gauss-Newton matrix of few numbers; of many, or where a run fails, what the value says alone.
    fn metric(&mut self) -> Metric {
        let (at, misses) = &self.last;
        let value = mean_square(misses);
        // What is noise is no fault of the numbers.
        let noise = 1e6 * self.order.noise.unwrap_or(0.0).powi(2);
        let fault = (value - noise).max(0.01 * value);
        let mut matrix = vec![vec![0.0; at.len()]; at.len()];
        if at.len() <= FEW
            && let Ok(Some(changes)) = self.changes(at, Some(misses))
        {
            // The value is a mean of squares in mm².
            matrix = told::gauss_newton(&changes, (1.5e-6 * misses.len() as f64).sqrt());
            self.runs[0] += at.len();
        }
        Metric::of(matrix, fault)
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
    let start = (!is_at_rest)
        .then(|| scene.start(&mut reporter.listener()))
        .transpose()?;
    let what = format!("fitting {}", order.loaded.scene.name);
    let mut fit = Fit {
        order,
        start: start.map(|start| start.state),
        task: reporter.count(&what, order.starts * order.runs, "runs at most"),
        runs: [0; 2],
        most: 0,
        failures: Vec::new(),
        first: None,
        last: Default::default(),
    };
    let mut rng = ChaCha8Rng::seed_from_u64(order.seed);
    let (mut best, mut searches): (Option<Point>, _) = (None, Vec::new());
    for number in 0..order.starts {
        let numbers = order.numbers.iter();
        let first: Vec<f64> = match number {
            0 => numbers.map(Number::part).collect(),
            _ => numbers.map(|_| rng.random()).collect(),
        };
        fit.most = fit.runs[0] + order.runs;
        fit.first = None;
        let found = search(first, &mut fit);
        let both = fit
            .first
            .zip(found.as_ref())
            .map(|(from, to)| [from, to.value]);
        searches.push(both.map(|both| both.map(|value| 1e-3 * value.sqrt())));
        best = best
            .into_iter()
            .chain(found)
            .min_by(|a, b| a.value.total_cmp(&b.value));
        if fit.task.is_stopped() {
            break;
        }
    }
    let Some(best) = best else {
        let why = fit.failures.into_iter().next();
        return why.map_or(Ok(None), |why| Err(why.context("where the searches begin")));
    };
    let (numbers, coordinates) = (order.numbers.len(), 3 * order.marks.len());
    fit.task = reporter.count("looking at what the data tell", 2 * numbers, "runs");
    let freedom = coordinates.saturating_sub(numbers).max(1);
    let left = 1e-3 * (best.value * coordinates as f64 / freedom as f64).sqrt();
    let noise = order.noise.unwrap_or(left).max(f64::MIN_POSITIVE);
    let changes = if fit.task.is_stopped() { None } else { fit.changes(&best.at, None)? };
    let (directions, errors) = changes
        .map(|changes| told::directions(&changes, noise))
        .unzip();
    let errors = errors.unwrap_or_else(|| vec![None; numbers]);
    // The last run is made whatever is asked: its files belong to the numbers.
    let mut deaf = |_: Event<'_>| ControlFlow::Continue(());
    let deaf = Reporter::new(&mut deaf);
    let last = Fit {
        task: deaf.count("", 1, ""),
        ..fit
    };
    let made = last
        .run(&best.at, false)?
        .ok_or_else(|| anyhow!("the last run was stopped"))?;
    let values = order.numbers.iter().zip(order.values(&best.at));
    let found = values.zip(best.at.iter().zip(errors));
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
        runs: last.runs,
        failed: last.failures.len(),
        end: if directions.is_some() { End::Complete } else { End::Interrupted },
        directions,
        scene: made.trial.scene,
        start: made.start,
        positions: made.positions,
    }))
}
