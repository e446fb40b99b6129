//! Fitting around obstacles: a cloth relaxes into its pattern where bodies are in the way, as a
//! garment does that stands open around the one who is to wear it.
//!
//! Edges are brought to their lengths as without obstacles `[eq:fit]`, but every way that this
//! takes is certified, and pairs of features that would meet are pushed apart. Then the cloth comes
//! to rest by its physics with contact, without gravity, air and friction, its velocities dropped
//! after each frame and its stiffness rising. Obstacles stand as they do at the start.

use glam::DVec3;
use selvedge_cloth::{HandleTargets, Obstacle, Scene, Stepper};

use super::{
    FitError, FitProgress, Fitted, Listener, failed, largest_strain, pass, springs, strain_rms,
    tell, weightless,
};
use crate::edges::FreeEdge;
use crate::simulator::{Checkpoint, Simulator};

/// Passes over all edges, and those until an edge is corrected in full.
const PASSES: u32 = 300;
const RISE: u32 = 100;
/// Root mean square of the strains from which the passes go on only while it falls, and how long
/// without.
const PATIENCE: u32 = 30;
/// Farthest way of a vertex in a pass `[m]`.
const FARTHEST: f64 = 4e-3;
/// Times that the way of a pass is halved where it cannot be gone, before the passes end.
const HALVINGS: u32 = 6;
/// Parts of the material's stiffness, and the frames of each.
const STAGES: [f64; 3] = [0.03, 0.3, 1.0];
const FRAMES: u32 = 12;
/// Substeps per frame at least.
const SUBSTEPS: u32 = 4;
/// Largest strain that a frame of the relaxation may end with: none that stops it.
const ANY_STRAIN: f64 = 1e6;
/// Part of all progress that the passes are.
const PASSING: f64 = 0.7;

/// Relaxes the cloth of a scene with contact from where its mesh is.
///
/// # Errors
/// A start that intersects; a cloth that cannot be set up; [`FitError::Stopped`].
pub(super) fn fit_around(scene: &Scene, progress: Listener<'_>) -> Result<Fitted, FitError> {
    let mut positions = scene.mesh.positions().to_vec();
    let springs = springs(&scene.mesh, &scene.handles);
    let before = largest_strain(&springs, &positions);
    project(scene, &springs, &mut positions, progress)?;
    relax(scene, &springs, &mut positions, progress)?;
    Ok(Fitted {
        before,
        after: largest_strain(&springs, &positions),
        positions,
        gap: None,
    })
}

/// The scene with its obstacles still, without what moves or holds the cloth but itself, its
/// stiffness multiplied by `part`.
pub(super) fn bare(scene: &Scene, part: f64) -> Scene {
    let mut bare = weightless(scene, part);
    bare.schedule.releases.clear();
    bare.physics.max_strain = ANY_STRAIN;
    bare.physics.substeps = scene.physics.substeps.max(SUBSTEPS);
    if let Some(contact) = &mut bare.contact {
        contact.friction = 0.0;
    }
    bare.obstacles = scene.obstacles.iter().map(Obstacle::at_start).collect();
    bare
}

/// Brings edges to their lengths, as far as nothing is in the way.
fn project(
    scene: &Scene,
    springs: &[FreeEdge],
    positions: &mut [DVec3],
    progress: Listener<'_>,
) -> Result<(), FitError> {
    let start = bare(scene, 1.0);
    let at_rest = Checkpoint::at_rest(positions.to_vec());
    let mut simulator = Simulator::from_checkpoint(&start, &at_rest)?;
    let mut wanted = positions.to_vec();
    let mut best = (f64::INFINITY, 0);
    for number in 0..PASSES {
        let part = f64::from(number + 1) / f64::from(RISE);
        wanted.copy_from_slice(positions);
        pass(springs, &mut wanted, part.min(1.0), number % 2 == 1);
        for (from, to) in positions.iter().zip(&mut wanted) {
            let way = *to - *from;
            let length = way.length();
            if length > FARTHEST {
                *to = *from + way * (FARTHEST / length);
            }
        }
        if !go(&mut simulator, positions, &mut wanted) {
            break;
        }
        let rms = strain_rms(springs, positions);
        if rms < 0.995 * best.0 {
            best = (rms, number);
        } else if number > RISE.max(best.1 + PATIENCE) {
            break;
        }
        let done = PASSING * f64::from(number) / f64::from(PASSES);
        let strain = largest_strain(springs, positions);
        tell(progress, FitProgress::at(done, strain))?;
    }
    Ok(())
}

/// Goes from `positions` towards `wanted` without meeting anything. Returns false if no part of the
/// way can be gone.
fn go(simulator: &mut Simulator, positions: &mut [DVec3], wanted: &mut [DVec3]) -> bool {
    for _ in 0..HALVINGS {
        if simulator.lead_wide(0, positions, wanted).is_ok() {
            positions.copy_from_slice(wanted);
            return true;
        }
        for (from, to) in positions.iter().zip(&mut *wanted) {
            *to = from.lerp(*to, 0.5);
        }
    }
    false
}

/// Frames of physics from standstill to standstill, the stiffness rising.
fn relax(
    scene: &Scene,
    springs: &[FreeEdge],
    positions: &mut [DVec3],
    progress: Listener<'_>,
) -> Result<(), FitError> {
    let held = scene.handles.select(positions);
    let targets = HandleTargets::at_frame_end(held).map_err(failed)?;
    for (stage, part) in (0..).zip(STAGES) {
        let scene = bare(scene, part);
        let at_rest = Checkpoint::at_rest(positions.to_vec());
        let mut simulator = Simulator::from_checkpoint(&scene, &at_rest)?;
        for frame in 0..FRAMES {
            if simulator.step(&targets).is_err() {
                // What the passes and the frames before reached stays.
                return Ok(());
            }
            positions.copy_from_slice(simulator.positions_f64());
            simulator.restore(&Checkpoint::at_rest(positions.to_vec()))?;
            let passed = f64::from(stage * FRAMES + frame) / f64::from(3 * FRAMES);
            let done = PASSING + (1.0 - PASSING) * passed;
            let strain = largest_strain(springs, positions);
            tell(progress, FitProgress::at(done, strain))?;
        }
    }
    Ok(())
}
