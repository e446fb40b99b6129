//! Static equilibrium: how a cloth hangs from handles that are held still.
//!
//! From the start positions with a smooth bulge, the linearised implicit step of
//! [`crate::Simulator`] is repeated with the velocities set to zero before each solve,
//! x ← x + h² (M + h² K)⁻¹ F(x): with the long time steps used here nearly Newton's method, except
//! that K lacks what would make it indefinite, so that the cloth leaves an unstable equilibrium
//! instead of finding it. Steps are limited in length, and near the end Anderson's method speeds
//! them up. Where that gets stuck, it begins later, the last step has a say in the next
//! ([`crate::rest_pose::last_step`]), and h is halved. Two things are known to make it stick: a kink of the
//! material law, over which a vertex steps to and fro and wants a brake, and a slow way out of an
//! unstable equilibrium, which wants a push; from outside they look alike, so that both are tried in
//! turn. The bulge decides to which side the cloth buckles. Where there are several equilibria,
//! [`SagMethod::Motion`] begins with the motion that a simulation makes (see [`crate::rest_pose::motion`]).
//!
//! The rest pose belongs to the cloth and its handles: the air is still, because cloth in wind
//! flutters and has no equilibrium (from some 3 m/s on), and damping, which no static force knows, is
//! left out. What holds the cloth are the handles that hold at the start of the motion. A sheet that none of
//! them holds has no rest pose: it stays where it starts. A material with strain limits comes to rest
//! within them: see [`crate::rest_pose::within_limits`].

mod anderson;
mod last_step;
mod motion;
mod within_limits;

use std::ops::ControlFlow;

use glam::{DVec2, DVec3};
use selvedge_cloth::geometry::area_vector;
use selvedge_cloth::{Handles, LinearSolver, SagMethod, Scene, SceneError};
use thiserror::Error;

use anderson::Anderson;
use last_step::LastStep;
use motion::fall;
use within_limits::settle;

use crate::solver::{SolveError, System};
use crate::state::State;

/// A cloth in static equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub struct SaggedRest {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Solves that it took.
    pub solves: u32,
    /// Largest residual acceleration |F|/m of a free vertex `[m/s²]`.
    pub residual: f64,
}

/// How far a sag has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SagProgress {
    /// Solves so far.
    pub solves: u32,
    /// Largest residual acceleration |F|/m of a free vertex now `[m/s²]`.
    pub residual: f64,
    /// Where to get `[m/s²]`.
    pub tolerance: f64,
}

/// Why no equilibrium was found.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum SagError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("the scene has no handles: nothing holds the cloth, so it has no sagged rest pose")]
    NoHandles,
    #[error(
        "no equilibrium after {solves} solves: a vertex is still accelerated by {residual:e} m/s², sag.tolerance is {tolerance:e}; raise sag.max_steps or sag.tolerance"
    )]
    NotConverged {
        solves: u32,
        residual: f64,
        tolerance: f64,
    },
    #[error("stopped, as was asked, before an equilibrium was found ({solves} solves)")]
    Stopped { solves: u32 },
    #[error("solve {solves} of the sag failed: {cause}")]
    Solve { solves: u32, cause: String },
}

/// The sagged rest pose of a scene's cloth, its handles where the mesh has them.
///
/// # Errors
/// A scene that does not validate or has no handles; [`SagError::NotConverged`].
pub fn sag(scene: &Scene) -> Result<SaggedRest, SagError> {
    sag_with_progress(scene, &mut |_| ControlFlow::Continue(()))
}

/// What hears of every solve and may stop.
pub(crate) type Listener<'a> = &'a mut dyn FnMut(SagProgress) -> ControlFlow<()>;

/// Tells `progress` how far the sag has come.
///
/// # Errors
/// [`SagError::Stopped`], where it is to stop.
pub(crate) fn tell(progress: Listener<'_>, now: SagProgress) -> Result<(), SagError> {
    match progress(now) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(SagError::Stopped { solves: now.solves }),
    }
}

/// As [`sag`]; `progress` hears of every solve and may stop.
///
/// # Errors
/// As for [`sag`]; [`SagError::Stopped`].
pub fn sag_with_progress(
    scene: &Scene,
    progress: &mut dyn FnMut(SagProgress) -> ControlFlow<()>,
) -> Result<SaggedRest, SagError> {
    scene.validate()?;
    let scene = &mut standing(scene)?;
    let start = match scene.sag.method {
        SagMethod::Equilibrium => (bulged(scene), 0),
        SagMethod::Motion => fall(scene, bulged(scene), progress)?,
    };
    // Only on the way to rest is there motion that it could damp.
    scene.material.damping = 0.0;
    let rest = relax(scene, start, progress)?;
    match scene.material.strain_limits {
        Some(_) => settle(scene, rest, progress),
        None => Ok(rest),
    }
}

/// The pose in which no free vertex is accelerated, without regard to limits; from `start` `[m]`,
/// `[vertices]`, which took so many solves.
fn relax(
    scene: &Scene,
    (start, mut solves): (Vec<DVec3>, u32),
    progress: Listener<'_>,
) -> Result<SaggedRest, SagError> {
    let mut relaxation = Relaxation::new(scene, start)?;
    let tolerance = scene.sag.tolerance;
    loop {
        let residual = relaxation.residual();
        let now = SagProgress {
            solves,
            residual,
            tolerance,
        };
        tell(progress, now)?;
        if residual <= tolerance {
            return Ok(SaggedRest {
                positions: relaxation.state.positions,
                solves,
                residual,
            });
        }
        if solves >= scene.sag.max_steps || !residual.is_finite() {
            return Err(SagError::NotConverged {
                solves,
                residual,
                tolerance,
            });
        }
        relaxation.step(residual).map_err(|cause| SagError::Solve {
            solves,
            cause: cause.to_string(),
        })?;
        solves += 1;
    }
}

/// Time step to begin with `[s]`; longer ones gain nothing.
const TIME_STEP: f64 = 0.2;
/// Shortest time step `[s]`.
const SHORTEST_TIME_STEP: f64 = 0.1;
/// Longest step of a vertex, relative to the size of the sheet.
const LONGEST_STEP: f64 = 0.02;
/// Residual acceleration `[m/s²]` below which the iteration is smooth enough to be accelerated.
const ACCELERATE_BELOW: f64 = 0.2;
/// Steps that Anderson's method remembers.
const DEPTH: usize = 8;
/// Solves without a residual a tenth smaller than ever before after which something is changed; a
/// quarter of it while accelerating.
const PATIENCE: u32 = 200;
/// Residual `[m/s²]` below which the last step has a say, once patience has been lost.
const SAY_BELOW: f64 = 1.0;

/// What the last step has to say about the next.
#[derive(Clone, Copy, Debug)]
enum Say {
    /// Nothing: patience was not lost yet.
    None,
    /// [`LastStep::brake`].
    Brake,
    /// [`LastStep::push`].
    Push,
}

/// The iteration.
struct Relaxation {
    system: System,
    state: State,
    targets: Vec<DVec3>,
    anderson: Anderson,
    last_step: LastStep,
    say: Say,
    longest_step: f64,
    time_step: f64,
    /// Size of the last correction `[m]`.
    last_size: f64,
    accelerate_below: f64,
    best_residual: f64,
    solves_since_best: u32,
}

impl Relaxation {
    fn new(scene: &Scene, start: Vec<DVec3>) -> Result<Self, SagError> {
        let system = System::with_solver(scene, LinearSolver::Cholesky).map_err(|cause| {
            SagError::Solve {
                solves: 0,
                cause: cause.to_string(),
            }
        })?;
        Ok(Self {
            system,
            state: State {
                positions: start,
                velocities: vec![DVec3::ZERO; scene.mesh.positions().len()],
            },
            targets: scene.handles.select(scene.mesh.positions()),
            anderson: Anderson::new(DEPTH),
            last_step: LastStep::new(scene.mesh.positions().len()),
            say: Say::None,
            longest_step: LONGEST_STEP * sheet_size(scene),
            time_step: TIME_STEP,
            last_size: f64::INFINITY,
            accelerate_below: ACCELERATE_BELOW,
            best_residual: f64::INFINITY,
            solves_since_best: 0,
        })
    }

    /// Assembles at the current positions; largest |F|/m of an unknown vertex `[m/s²]`.
    /// `[eq:sag-residual]`
    fn residual(&mut self) -> f64 {
        self.system
            .assemble(self.time_step, &self.state, &self.targets);
        let (impulses, mass) = (self.system.impulses(), self.system.mass());
        self.system
            .unknown_vertices()
            .iter()
            .map(|&v| impulses[v as usize].length() / (self.time_step * mass[v as usize]))
            .fold(0.0, |largest, a| {
                if a > largest || a.is_nan() {
                    a
                } else {
                    largest
                }
            })
    }

    /// Moves on from what [`Self::residual`] assembled.
    fn step(&mut self, residual: f64) -> Result<(), SolveError> {
        self.system.solve()?;
        let mut correction = vec![DVec3::ZERO; self.state.positions.len()];
        for (v, change) in self.system.velocity_changes() {
            correction[v] = change * self.time_step;
        }
        let size = longest(&correction);
        if residual > self.accelerate_below || size > 2.0 * self.last_size {
            self.anderson.restart();
        }
        self.last_size = size;
        let mut step = self.anderson.step(&correction);
        if (self.accelerate_below..SAY_BELOW).contains(&residual) {
            match self.say {
                Say::None => (),
                Say::Brake => self.last_step.brake(&correction, &mut step),
                Say::Push => self.last_step.push(&correction, &mut step),
            }
        }
        let scale = (self.longest_step / longest(&step)).min(1.0);
        for (position, entry) in self.state.positions.iter_mut().zip(&mut step) {
            *entry *= scale;
            *position += *entry;
        }
        self.last_step.taken(&step);
        self.anderson.taken(step, correction);
        self.lose_patience(residual);
        Ok(())
    }

    fn lose_patience(&mut self, residual: f64) {
        if residual < 0.9 * self.best_residual {
            self.best_residual = residual;
            self.solves_since_best = 0;
            return;
        }
        self.solves_since_best += 1;
        let accelerating = residual <= self.accelerate_below;
        let patience = if accelerating { PATIENCE / 4 } else { PATIENCE };
        if self.solves_since_best < patience {
            return;
        }
        self.say = match self.say {
            Say::None | Say::Push => Say::Brake,
            Say::Brake => Say::Push,
        };
        if accelerating {
            self.accelerate_below = 0.1 * residual;
        } else {
            self.time_step = (0.5 * self.time_step).max(SHORTEST_TIME_STEP);
        }
        self.best_residual = residual;
        self.solves_since_best = 0;
        self.anderson.restart();
    }
}

/// The scene as it stands at its start, in still air: only handles that hold then, and those of a
/// sheet without any are all its vertices.
fn standing(scene: &Scene) -> Result<Scene, SagError> {
    let mut scene = scene.clone();
    scene.environment.wind = DVec3::ZERO;
    scene.environment.gust = None;
    let released = scene
        .schedule
        .released(0, scene.frame_rate, scene.handles.len());
    scene.schedule.releases.clear();
    let holds: Vec<bool> = released.iter().map(|released| !released).collect();
    scene.handles = scene.handles.subset(&holds);
    if scene.handles.is_empty() {
        return Err(SagError::NoHandles);
    }
    let sheets = scene.mesh.topology().sheets();
    let mut is_held = vec![false; sheets.len()];
    for vertex in scene.handles.vertices() {
        is_held[sheets[vertex.index()] as usize] = true;
    }
    let free = (0_u32..)
        .zip(&sheets)
        .filter(|(_, sheet)| !is_held[**sheet as usize]);
    let mut held: Vec<u32> = scene.handles.vertices().iter().map(|v| v.0).collect();
    let handle_count = held.len();
    held.extend(free.map(|(vertex, _)| vertex));
    if held.len() > handle_count {
        scene.handles = Handles::new(&held, sheets.len()).map_err(SceneError::from)?;
    }
    Ok(scene)
}

/// Start positions with the bulge of the scene along the normals.
fn bulged(scene: &Scene) -> Vec<DVec3> {
    let mesh = &scene.mesh;
    let heights = bulge_profile(scene);
    let mut normals = vec![DVec3::ZERO; mesh.positions().len()];
    for face in mesh.topology().faces() {
        let [a, b, c] = face.map(|v| mesh.positions()[v.index()]);
        for vertex in face {
            normals[vertex.index()] += area_vector(a, b, c);
        }
    }
    mesh.positions()
        .iter()
        .zip(normals)
        .zip(heights)
        .map(|((position, normal), height)| {
            *position + normal.normalize_or_zero() * (height * scene.sag.bulge)
        })
        .collect()
}

/// On each sheet a bump around the middle of its handles that vanishes at each of them, at most 1;
/// nothing where all vertices are handles.
fn bulge_profile(scene: &Scene) -> Vec<f64> {
    let sheets = scene.mesh.topology().sheets();
    let count = sheets.iter().max().map_or(0, |last| last + 1);
    let mut heights = vec![0.0; sheets.len()];
    for sheet in 0..count {
        let of_sheet = |v: &usize| sheets[*v] == sheet;
        let vertices: Vec<usize> = (0..sheets.len()).filter(of_sheet).collect();
        let handles = scene.handles.vertices().iter().map(|v| v.index());
        let handles: Vec<usize> = handles.filter(of_sheet).collect();
        if handles.len() < vertices.len() {
            for (v, height) in vertices.iter().zip(bump(scene, &vertices, &handles)) {
                heights[*v] = height;
            }
        }
    }
    heights
}

/// The bump of one sheet with these `vertices` and `handles`, `[vertices]`.
fn bump(scene: &Scene, vertices: &[usize], handles: &[usize]) -> Vec<f64> {
    let uv = scene.mesh.material_coordinates();
    let places: Vec<DVec2> = vertices.iter().map(|&v| uv[v]).collect();
    let size = extent(&places);
    let handles: Vec<DVec2> = handles.iter().map(|&v| uv[v]).collect();
    let middle = handles.iter().sum::<DVec2>() / handles.len() as f64;
    let mut heights: Vec<f64> = places
        .iter()
        .map(|place| {
            let bump = (-(place.distance(middle) / (0.6 * size)).powi(2)).exp();
            let clear =
                |handle: &DVec2| 1.0 - (-(place.distance(*handle) / (0.2 * size)).powi(2)).exp();
            bump * handles.iter().map(clear).product::<f64>()
        })
        .collect();
    let highest = heights.iter().copied().fold(0.0, f64::max);
    if highest > 0.0 {
        heights.iter_mut().for_each(|height| *height /= highest);
    }
    heights
}

fn longest(vectors: &[DVec3]) -> f64 {
    vectors.iter().map(|v| v.length()).fold(0.0, f64::max)
}

/// Longer side of the mesh's box in material space `[m]`.
fn sheet_size(scene: &Scene) -> f64 {
    extent(scene.mesh.material_coordinates())
}

/// Longer side of the box around `places` `[m]`.
fn extent(places: &[DVec2]) -> f64 {
    let low = places.iter().fold(places[0], |low, c| low.min(*c));
    let high = places.iter().fold(places[0], |high, c| high.max(*c));
    (high - low).max_element()
}
