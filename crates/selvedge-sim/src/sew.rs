//! Sewing: loose panels are pulled together along their seams over a second, and then are one.
//!
//! The panels move by the physics of the scene, without gravity and wind, as if through honey:
//! velocities fade, so that a panel does not fly on when its seam is closed. After every substep
//! the vertices that are to be one are brought as near to their centre of mass as the seam is to be
//! closed by then, which changes no momentum; their velocities take the shift
//! (v ← v + Δx/dt). `[eq:sewing]` Held vertices are led to where the sewn mesh has them.

use glam::DVec3;
use selvedge_cloth::geometry::exp;
use selvedge_cloth::{Handles, LoosePanels, Scene, Stop, VertexId};

use crate::active_handles::ActiveHandles;
use crate::fit::{FitError, FitProgress, Listener, failed, largest_strain, springs, tell};
use crate::state::State;
use crate::stop;

/// Time in which a seam is closed `[s]`, and the substeps of it.
const SECONDS: f64 = 1.0;
const SUBSTEPS: u32 = 120;
/// Time in which velocities fade to 1/e `[s]`.
const FADING: f64 = 0.05;
/// Calls of the listener are this many substeps apart.
const BEAT: u32 = 4;

/// Loose vertices that become one, with their largest distance from their centre at the start.
struct Seam {
    copies: Vec<usize>,
    reach: f64,
}

/// Pulls the `loose` panels of the scene's mesh together; `share` is the part of all progress that
/// this is. Gives the positions of the sewn mesh `[m]`, `[vertices]`, and the largest distance between
/// vertices that became one, at the start `[m]`.
///
/// # Errors
/// As for [`crate::fit`]; panels that are not those of the scene's mesh.
pub(crate) fn sew(
    scene: &Scene,
    loose: &LoosePanels,
    share: f64,
    progress: Listener<'_>,
) -> Result<(Vec<DVec3>, f64), FitError> {
    let copies = loose.copies(&scene.mesh);
    let apart = apart(scene, loose, &copies)?;
    let springs = springs(&apart.mesh, &apart.handles);
    let mut active = ActiveHandles::all(&apart).map_err(failed)?;
    let stop = Stop::default();
    active.system.stop_by(stop.clone());
    let mass = active.system.mass().to_vec();
    let mut state = State::at_rest(loose.positions().to_vec());
    let seams = seams(scene, &copies, &mass, &state.positions);
    let starts = apart.handles.select(&state.positions);
    let ends = ends(scene, &copies);
    let dt = SECONDS / f64::from(SUBSTEPS);
    let gap = widest(&copies, &state.positions);
    let mut now = FitProgress {
        done: 0.0,
        strain: largest_strain(&springs, &state.positions),
        gap: Some(gap),
        meeting: None,
    };
    for substep in 1..=SUBSTEPS {
        let part = smooth(f64::from(substep) / f64::from(SUBSTEPS));
        let pairs = starts.iter().zip(&ends);
        let targets: Vec<DVec3> = pairs.map(|(from, to)| from.lerp(*to, part)).collect();
        now.gap = Some(gap * (1.0 - part));
        let solved = stop::beside(&stop, &mut || progress(now), || {
            active.advance(dt, &mut state, None, &targets)
        });
        if stop.is_wanted() {
            return Err(FitError::Stopped);
        }
        solved.map_err(failed)?;
        close(&seams, &mass, 1.0 - part, dt, &mut state);
        let fading = exp(-dt / FADING);
        state.velocities.iter_mut().for_each(|v| *v *= fading);
        active.system.forget_changes();
        if substep % BEAT == 0 {
            now.done = share * f64::from(substep) / f64::from(SUBSTEPS);
            now.strain = largest_strain(&springs, &state.positions);
            tell(progress, now)?;
        }
    }
    let mut positions: Vec<DVec3> = copies
        .iter()
        .map(|copies| centre(copies, &mass, &state.positions))
        .collect();
    for vertex in scene.handles.vertices() {
        positions[vertex.index()] = scene.mesh.positions()[vertex.index()];
    }
    Ok((positions, gap))
}

/// The scene of the loose panels, every copy of a held vertex held.
fn apart(scene: &Scene, loose: &LoosePanels, copies: &[Vec<usize>]) -> Result<Scene, FitError> {
    let mut apart = scene.clone();
    apart.mesh = loose.mesh(&scene.mesh).map_err(failed)?;
    let held = scene.handles.vertices().iter();
    let held: Vec<u32> = held
        .flat_map(|v| copies[v.index()].iter().map(|copy| *copy as u32))
        .collect();
    apart.handles = Handles::new(&held, loose.positions().len()).map_err(failed)?;
    apart.schedule.releases.clear();
    apart.environment.gravity = DVec3::ZERO;
    apart.environment.wind = DVec3::ZERO;
    apart.environment.gust = None;
    Ok(apart)
}

/// Places of the held vertices in the sewn mesh, once for each of their copies.
fn ends(scene: &Scene, copies: &[Vec<usize>]) -> Vec<DVec3> {
    let held = scene.handles.vertices().iter();
    let place = |v: &VertexId| {
        let place = scene.mesh.positions()[v.index()];
        std::iter::repeat_n(place, copies[v.index()].len())
    };
    held.flat_map(place).collect()
}

/// The seams between vertices that nothing holds.
fn seams(scene: &Scene, copies: &[Vec<usize>], mass: &[f64], positions: &[DVec3]) -> Vec<Seam> {
    let held = scene.handles.mask(copies.len());
    let open = copies.iter().zip(held);
    open.filter(|(copies, held)| copies.len() > 1 && !held)
        .map(|(copies, _)| Seam {
            reach: reach(copies, centre(copies, mass, positions), positions),
            copies: copies.clone(),
        })
        .collect()
}

fn centre(copies: &[usize], mass: &[f64], positions: &[DVec3]) -> DVec3 {
    let (mut sum, mut all) = (DVec3::ZERO, 0.0);
    for &copy in copies {
        sum += mass[copy] * positions[copy];
        all += mass[copy];
    }
    sum / all
}

fn reach(copies: &[usize], centre: DVec3, positions: &[DVec3]) -> f64 {
    let distances = copies.iter().map(|&copy| positions[copy].distance(centre));
    distances.fold(0.0, f64::max)
}

/// Largest distance between vertices of the `loose` panels that become one `[m]`.
pub(crate) fn widest_gap(scene: &Scene, loose: &LoosePanels) -> f64 {
    widest(&loose.copies(&scene.mesh), loose.positions())
}

/// Largest distance between vertices that become one.
fn widest(copies: &[Vec<usize>], positions: &[DVec3]) -> f64 {
    let of = |copies: &Vec<usize>| {
        let each = copies.iter();
        each.map(|&copy| reach(copies, positions[copy], positions))
            .fold(0.0, f64::max)
    };
    copies.iter().map(of).fold(0.0, f64::max)
}

/// Brings the copies of each seam's vertices within `open` times their first distance.
fn close(seams: &[Seam], mass: &[f64], open: f64, dt: f64, state: &mut State) {
    for seam in seams {
        let centre = centre(&seam.copies, mass, &state.positions);
        let now = reach(&seam.copies, centre, &state.positions);
        let allowed = open * seam.reach;
        if now <= allowed {
            continue;
        }
        for &copy in &seam.copies {
            let shift = (centre - state.positions[copy]) * (1.0 - allowed / now);
            state.positions[copy] += shift;
            state.velocities[copy] += shift / dt;
        }
    }
}

/// From 0 to 1, slow at both ends.
fn smooth(part: f64) -> f64 {
    part * part * (3.0 - 2.0 * part)
}
