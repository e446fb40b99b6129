//! Fitting: a cloth relaxes into its pattern from where its mesh stands, before a motion begins.
//!
//! A mesh of another program may have edges many times as long as its pattern has them, and the
//! physics would fling it about. A cloth that is too large or small as a whole is first scaled
//! about its handles, which stay. Then edges are brought to their lengths one after another, by a
//! part of what they lack that rises from pass to pass (position-based, Müller et al. 2007)
//! `[eq:fit]`. Then solves of the cloth without gravity and air, its velocities dropped after each
//! and its stiffness rising to its own, bring the faces to rest; a solve in which an edge strains
//! too much is repeated over a shorter time.

use std::ops::ControlFlow;
use web_time::Instant;

use glam::DVec3;
use selvedge_cloth::{Environment, Handles, LoosePanels, Mesh, Scene, SceneError, Stop, VertexId};
use thiserror::Error;

use crate::active_handles::ActiveHandles;
use crate::edges::{FreeEdge, WatchedEdges, free_edges};
use crate::sew::{sew, widest_gap};
use crate::simulator::SimulatorError;
use crate::state::State;
use crate::stop;

mod around;
mod dress;
mod untangle;

pub use dress::{Dressed, dress};
pub use untangle::{Untangled, untangle};

/// Passes over all edges at most, and those within which something must get better.
const MOST_PASSES: u32 = 6000;
const PATIENCE: u32 = 1200;
/// Passes after which an edge is corrected in full.
const RISE: u32 = 150;
/// Strain of every edge at which the passes end.
const CLOSE: f64 = 2e-3;
/// Median stretches within which a cloth is not scaled as a whole.
const OWN_SIZE: std::ops::RangeInclusive<f64> = 0.8..=1.25;
/// Part of the material's stiffness in each stage of the solves, and the solves of a stage.
const STAGES: [f64; 3] = [0.01, 0.1, 1.0];
const SOLVES: u32 = 15;
/// Change of an edge's stretch in a solve beyond which the solve is repeated over half the time,
/// and how often.
const MOST_CHANGE: f64 = 0.1;
const MOST_HALVINGS: u32 = 8;
/// Strain from which a cloth does not count as relaxed.
const STRAINED: f64 = 0.1;
/// Calls of the listener are this many passes apart at most.
const BEAT: u32 = 10;
/// Part of all progress that sewing is.
const SEWING: f64 = 0.3;

/// A cloth that has relaxed into its pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Largest strain of an edge at the start, by its amount, of the same edges.
    pub before: f64,
    /// Largest strain of an edge that is left, by its amount. Edges between two handles do not
    /// count: nothing moves them.
    pub after: f64,
    /// Largest distance over which a seam was closed, where panels were sewn `[m]`.
    pub gap: Option<f64>,
}

/// Progress of a fit, or of what makes a cloth ready for one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FitProgress {
    /// Part of the most work that it can be, 0 to 1.
    pub done: f64,
    /// Largest strain of an edge now, by its amount.
    pub strain: f64,
    /// Largest distance that seams are open, while panels are sewn `[m]`.
    pub gap: Option<f64>,
    /// Pairs of faces that meet, while the cloth is untangled or a body shrinks out of it.
    pub meeting: Option<usize>,
}

impl FitProgress {
    /// This part of the work done, and this largest strain.
    fn at(done: f64, strain: f64) -> Self {
        Self {
            done,
            strain,
            ..Self::default()
        }
    }
}

/// Reason why a cloth was not fitted.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum FitError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("the cloth cannot relax into its pattern around what is in its way: {0}")]
    Start(#[from] SimulatorError),
    #[error("stopped, as was asked, while the cloth relaxed into its pattern")]
    Stopped,
    #[error("the cloth cannot relax into its pattern: {cause}")]
    Solve { cause: String },
    #[error(
        "the cloth meets itself at {before} pairs of faces, and cannot be moved apart at {left} of them ({pairs}, by their vertices): move these vertices apart in the mesh, or write contact.self = false"
    )]
    Tangled {
        before: usize,
        left: usize,
        /// The first of those that are left.
        pairs: String,
    },
    #[error(
        "dress = {body:?} needs an obstacle of that name, and contact: dress names the body that the cloth is put onto"
    )]
    NoBody { body: String },
    #[error(
        "the cloth does not get onto {body:?}: {opening}, nor near: move the cloth so that each opening is around its limb (mesh.transform), the body's arms out where it has sleeves"
    )]
    Beside { body: String, opening: String },
    #[error(
        "the cloth does not get onto {body:?}: it meets the body at {before} pairs of faces, and at {left} of them still where the body is thin and short, around vertex {vertex} at ({:.2}, {:.2}, {:.2}) m: move the cloth there so that it goes around the body (mesh.transform), or turn and scale it",
        place.x, place.y, place.z
    )]
    NotClear {
        body: String,
        before: usize,
        left: usize,
        /// A vertex that meets the body.
        vertex: VertexId,
        /// Mean place of those that do `[m]`.
        place: DVec3,
    },
    #[error(
        "the cloth does not get onto {body:?}: the body grew back from within it by {percent:.0} % of the way, and then {cause}: move the cloth so that it goes around the body (mesh.transform), the body's arms out where it has sleeves, or take a larger one"
    )]
    NotGrown {
        body: String,
        percent: f64,
        cause: String,
    },
}

/// A callback that sees the progress and may stop the fit.
pub(crate) type Listener<'a> = &'a mut dyn FnMut(FitProgress) -> ControlFlow<()>;

/// Relaxes the cloth of `scene` into its pattern, its handles where the mesh has them. In a scene
/// with contact nothing meets on the way, and obstacles stand as they do at the start.
///
/// # Errors
/// A scene that does not validate; one with contact whose mesh intersects; [`FitError::Stopped`]; a
/// system that cannot be solved.
pub fn fit(scene: &Scene, progress: Listener<'_>) -> Result<Fitted, FitError> {
    scene.validate()?;
    if scene.contact.is_some() {
        return around::fit_around(scene, progress);
    }
    fit_from(scene, scene.mesh.positions().to_vec(), 0.0, progress)
}

/// Sews the `loose` panels of the scene's mesh, pulled together over a second, and relaxes the
/// cloth into its pattern from there. In a scene with contact they are one from the beginning, each
/// seam half way between its panels, and shrink onto what is in their way.
///
/// # Errors
/// As for [`fit`]; panels that are not those of the scene's mesh.
pub fn sew_and_fit(
    scene: &Scene,
    loose: &LoosePanels,
    progress: Listener<'_>,
) -> Result<Fitted, FitError> {
    scene.validate()?;
    if scene.contact.is_some() {
        let mut fitted = fit(scene, progress)?;
        fitted.gap = Some(widest_gap(scene, loose));
        return Ok(fitted);
    }
    let (positions, gap) = sew(scene, loose, SEWING, progress)?;
    let mut fitted = fit_from(scene, positions, SEWING, progress)?;
    fitted.gap = Some(gap);
    Ok(fitted)
}

/// Relaxes the cloth from `positions` `[m]`, `[vertices]`; `passed` is the part of all progress
/// that was before.
fn fit_from(
    scene: &Scene,
    mut positions: Vec<DVec3>,
    passed: f64,
    progress: Listener<'_>,
) -> Result<Fitted, FitError> {
    let mut progress = |mut now: FitProgress| {
        now.done = passed + (1.0 - passed) * now.done;
        progress(now)
    };
    let progress: Listener<'_> = &mut progress;
    let springs = springs(&scene.mesh, &scene.handles);
    if springs.is_empty() {
        return Ok(Fitted {
            positions,
            before: 0.0,
            after: 0.0,
            gap: None,
        });
    }
    let before = largest_strain(&springs, &positions);
    scale(&springs, &scene.handles, &mut positions);
    project(&springs, &mut positions, progress)?;
    let projected = positions.clone();
    relax(scene, &springs, &mut positions, progress)?;
    let reached = largest_strain(&springs, &projected);
    let mut after = largest_strain(&springs, &positions);
    if after > f64::max(reached, STRAINED) {
        // The physics made it worse, as where a panel is far too small.
        (positions, after) = (projected, reached);
    }
    Ok(Fitted {
        positions,
        before,
        after,
        gap: None,
    })
}

/// The edges that are brought to their lengths.
pub(crate) fn springs(mesh: &Mesh, handles: &Handles) -> Vec<FreeEdge> {
    free_edges(mesh, &handles.mask(mesh.topology().vertex_count()))
}

/// Stretch l/l₀ of each edge.
fn stretches<'a>(
    springs: &'a [FreeEdge],
    positions: &'a [DVec3],
) -> impl Iterator<Item = f64> + 'a {
    springs.iter().map(|spring| {
        let [a, b] = spring.ends.map(|v| positions[v]);
        a.distance(b) / spring.length
    })
}

/// Largest strain of an edge, by its amount.
pub(crate) fn largest_strain(springs: &[FreeEdge], positions: &[DVec3]) -> f64 {
    let strains = stretches(springs, positions).map(|stretch| (stretch - 1.0).abs());
    strains.fold(0.0, f64::max)
}

/// Root mean square of the edges' strains.
fn strain_rms(springs: &[FreeEdge], positions: &[DVec3]) -> f64 {
    let squares = stretches(springs, positions).map(|stretch| (stretch - 1.0).powi(2));
    (squares.sum::<f64>() / springs.len() as f64).sqrt()
}

/// Scales a cloth whose edges are too long or short in the median about the middle of its handles,
/// which stay; about its own middle where it has none.
fn scale(springs: &[FreeEdge], handles: &Handles, positions: &mut [DVec3]) {
    let mut stretches: Vec<f64> = stretches(springs, positions).collect();
    stretches.sort_by(f64::total_cmp);
    let median = stretches[stretches.len() / 2];
    if OWN_SIZE.contains(&median) || median <= 0.0 {
        return;
    }
    let held = handles.mask(positions.len());
    let fixed = if handles.is_empty() { positions.to_vec() } else { handles.select(positions) };
    let middle = fixed.iter().sum::<DVec3>() / fixed.len() as f64;
    for (position, held) in positions.iter_mut().zip(held) {
        if !held {
            *position = middle + (*position - middle) / median;
        }
    }
}

/// Moves the ends of every edge by `part` of what it lacks; every second pass backwards.
fn pass(springs: &[FreeEdge], positions: &mut [DVec3], part: f64, backwards: bool) {
    let count = springs.len();
    for k in 0..count {
        springs[if backwards { count - 1 - k } else { k }].correct(positions, part);
    }
}

impl FreeEdge {
    /// Moves the ends by `part` of what the edge lacks.
    fn correct(&self, positions: &mut [DVec3], part: f64) {
        let [a, b] = self.ends;
        let along = positions[b] - positions[a];
        let length = along.length();
        if length > 0.0 {
            let shift = along * (part * (1.0 - self.length / length));
            positions[a] += shift * self.parts[0];
            positions[b] -= shift * self.parts[1];
        }
    }
}

/// Brings edges to their lengths, until they are or it gets no better.
fn project(
    springs: &[FreeEdge],
    positions: &mut [DVec3],
    progress: Listener<'_>,
) -> Result<(), FitError> {
    let mut best = (strain_rms(springs, positions), 0);
    let mut kept = positions.to_vec();
    let mut reported = Instant::now();
    for number in 0..MOST_PASSES {
        let is_close = best.1 + 1 == number && largest_strain(springs, positions) <= CLOSE;
        if best.0 == 0.0 || is_close || number > best.1 + PATIENCE {
            break;
        }
        let part = f64::from(number + 1) / f64::from(RISE);
        pass(springs, positions, part.min(1.0), number % 2 == 1);
        let rms = strain_rms(springs, positions);
        if rms < 0.999 * best.0 {
            best = (rms, number);
            kept.copy_from_slice(positions);
        }
        if number % BEAT == 0 || reported.elapsed() > stop::BEAT {
            reported = Instant::now();
            let strain = largest_strain(springs, positions);
            let done = 0.5 * f64::from(number) / f64::from(MOST_PASSES);
            tell(progress, FitProgress::at(done, strain))?;
        }
    }
    positions.copy_from_slice(&kept);
    Ok(())
}

/// Solves without gravity and air, from standstill to standstill, the stiffness rising.
fn relax(
    scene: &Scene,
    springs: &[FreeEdge],
    positions: &mut Vec<DVec3>,
    progress: Listener<'_>,
) -> Result<(), FitError> {
    let watched = WatchedEdges::new(&scene.mesh, &scene.handles);
    let targets = scene.handles.select(scene.mesh.positions());
    for (number, part) in STAGES.into_iter().enumerate() {
        let bare = weightless(scene, part);
        let mut active = ActiveHandles::all(&bare).map_err(failed)?;
        let stop = Stop::default();
        active.system.stop_by(stop.clone());
        for solve in 0..SOLVES {
            let before = largest_strain(springs, positions);
            let all = (STAGES.len() as u32 * SOLVES) as f64;
            let done = 0.5 + 0.5 * f64::from(number as u32 * SOLVES + solve) / all;
            let mut now = FitProgress::at(done, before);
            let solved = stop::beside(&stop, &mut || progress(now), || {
                still_step(&mut active, &bare, positions, &targets, &watched, &stop)
            });
            if stop.is_wanted() {
                return Err(FitError::Stopped);
            }
            if !solved {
                // Too far from its pattern for the physics: what the passes reached stays.
                return Ok(());
            }
            let strain = largest_strain(springs, positions);
            now.strain = strain;
            tell(progress, now)?;
            if (before - strain).abs() < 1e-6 {
                break;
            }
        }
    }
    Ok(())
}

/// Sum of the `values` of the neighbours of each along `sides`, and their number.
fn of_neighbours(values: &[DVec3], sides: &[[usize; 2]]) -> Vec<(DVec3, u32)> {
    let mut sums = vec![(DVec3::ZERO, 0); values.len()];
    for &[a, b] in sides {
        for (own, other) in [(a, b), (b, a)] {
            sums[own].0 += values[other];
            sums[own].1 += 1;
        }
    }
    sums
}

/// The scene without weight and air, its fabrics `part` times as stiff.
fn weightless(scene: &Scene, part: f64) -> Scene {
    let mut bare = scene.clone();
    bare.environment = Environment {
        gravity: DVec3::ZERO,
        air_density: 0.0,
        ..Environment::default()
    };
    for fabric in [&mut bare.material]
        .into_iter()
        .chain(bare.fabrics.values_mut())
    {
        *fabric = fabric.clone().multiplied(part, part);
    }
    bare
}

pub(crate) fn failed(cause: impl std::error::Error) -> FitError {
    FitError::Solve {
        cause: cause.to_string(),
    }
}

/// One solve from a standstill, in which no edge strains too much; returns false if there is none, or
/// a stop is wanted.
fn still_step(
    active: &mut ActiveHandles,
    scene: &Scene,
    positions: &mut Vec<DVec3>,
    targets: &[DVec3],
    watched: &WatchedEdges,
    stop: &Stop,
) -> bool {
    let mut dt = 1.0 / scene.frame_rate;
    for _ in 0..MOST_HALVINGS {
        let mut state = State::at_rest(positions.clone());
        let solved = active.advance(dt, &mut state, None, targets);
        if solved.is_ok()
            && state.positions.iter().all(|p| p.is_finite())
            && watched.keep_their_lengths(positions, &state.positions, MOST_CHANGE)
        {
            *positions = state.positions;
            return true;
        }
        if stop.is_wanted() {
            return false;
        }
        active.system.forget_changes();
        dt *= 0.5;
    }
    false
}

pub(crate) fn tell(progress: Listener<'_>, now: FitProgress) -> Result<(), FitError> {
    match progress(now) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(FitError::Stopped),
    }
}
