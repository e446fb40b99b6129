//! Dressing: a garment that stands around a body, and in it, gets onto it.
//!
//! The body is shrunk first: its points move to the mean of their neighbours, pass after pass, so
//! that limbs become thin and then short, always within what they were `[eq:dress]`, until the exact
//! test finds nothing of the body in the cloth, and no piece of that is in the body. Then it grows back the way that it came, as a moving
//! obstacle, and pushes the cloth out, which has no weight, sheds its velocity after every frame,
//! and meets nothing on the way.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;
use selvedge_cloth::geometry::extent;
use selvedge_cloth::{HandleTargets, Obstacle, ObstaclePath, Scene, Stepper, VertexId};
use selvedge_contact::{Candidates, CollisionMesh, winding};

use super::around::bare;
use super::{
    FitError, FitProgress, Listener, failed, largest_strain, of_neighbours, springs, tell,
};
use crate::simulator::{Checkpoint, Simulator};

/// Farthest way of a point of the body in a frame `[m]`.
const STEP: f64 = 4e-3;
/// Frames that the body shrinks further once it is clear.
const BEYOND: usize = 2;
/// Passes at most.
const PASSES: u32 = 40_000;
/// Times that a body winds around what is within it, at least.
const WITHIN: f64 = 0.75;
/// Size of a body, as a part of its own, at which it is given up.
const SMALLEST: f64 = 0.3;
/// Strain of an edge at which a cloth is given up: no fabric stretches to more than its double.
const MOST: f64 = 1.0;
/// An opening counts that is this part of the longest. A body is in it if one of its sides is within
/// this part of its length from its middle, of which the radius of a circle is 0.16; beyond the other it
/// is beside it. A sleeve around an arm has 0.04, one beside which it hangs 0.26, a shirt at the feet 0.3.
const SMALL: f64 = 0.25;
const INSIDE: f64 = 0.2;
const FAR: f64 = 0.25;
/// Frames in which the cloth comes to rest around the whole body, and those at most until what the
/// body let through is out of it.
const SETTLING: usize = 12;
const LONGEST: usize = 120;
/// Part of all progress that shrinking is.
const SHRINKING: f64 = 0.2;

/// A garment that is on a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Dressed {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Pairs of faces of the cloth and the body that met at the start.
    pub before: usize,
    /// Farthest that a point of the body shrank `[m]`.
    pub shrunk: f64,
    /// Largest strain of an edge, by its amount, before and after.
    pub strains: [f64; 2],
    /// Openings through which nothing of the body goes, where something goes through another, in words.
    pub empty: Vec<String>,
}

/// Puts the cloth of `scene` onto its obstacle `body`, as that stands at the start. The cloth must
/// not meet itself.
///
/// # Errors
/// A scene that does not validate, without contact or without this obstacle; a start that meets
/// itself or another obstacle; [`FitError::NotClear`]; [`FitError::NotGrown`];
/// [`FitError::Stopped`].
pub fn dress(scene: &Scene, body: &str, progress: Listener<'_>) -> Result<Dressed, FitError> {
    scene.validate()?;
    let number = scene.obstacles.iter().position(|one| one.name() == body);
    let (Some(number), true) = (number, scene.contact.is_some()) else {
        let body = body.to_owned();
        return Err(FitError::NoBody { body });
    };
    let obstacle = &scene.obstacles[number].at_start().as_mesh();
    let all = empty(scene, obstacle, scene.mesh.positions());
    if let Some((_, opening)) = all.into_iter().find(|(away, _)| *away > FAR) {
        let body = body.to_owned();
        return Err(FitError::Beside { body, opening });
    }
    let (shapes, before) = shrink(scene, obstacle, progress)?;
    let start = scene.mesh.positions();
    let shrunk = farthest(&shapes[0], &shapes[shapes.len() - 1]);
    let positions = match shapes.len() {
        1 => start.to_vec(),
        _ => grow(scene, number, shapes, progress)?,
    };
    let springs = springs(&scene.mesh, &scene.handles);
    Ok(Dressed {
        before,
        shrunk,
        strains: [start, &positions].map(|places| largest_strain(&springs, places)),
        empty: empty(scene, obstacle, &positions)
            .into_iter()
            .map(|(_, opening)| opening)
            .collect(),
        positions,
    })
}

/// Openings of the cloth at `positions` that the body is not in, where it is in others: how far its
/// sides are from the middle, in lengths of the border, and where that is, in words.
fn empty(scene: &Scene, body: &Obstacle, positions: &[DVec3]) -> Vec<(f64, String)> {
    let topology = scene.mesh.topology();
    let mut next = BTreeMap::new();
    for (face, edges) in topology.faces().iter().zip(topology.face_edges()) {
        for k in (0..3).filter(|k| topology.edges()[edges[*k].index()].is_boundary()) {
            next.insert(face[k], face[(k + 1) % 3]);
        }
    }
    let points: Vec<DVec3> = body.positions_at(0.0).collect();
    let mut all = Vec::new();
    while let Some((vertex, mut at)) = next.pop_first() {
        let mut ring = vec![positions[vertex.index()]];
        while let Some(on) = next.remove(&at) {
            ring.push(positions[at.index()]);
            at = on;
        }
        let middle = ring.iter().sum::<DVec3>() / ring.len() as f64;
        let sides = ring.iter().zip(ring.iter().cycle().skip(1));
        let length: f64 = sides.map(|(a, b)| a.distance(*b)).sum();
        let faces = body
            .faces()
            .iter()
            .map(|face| face.map(|p| points[p as usize]));
        let sides = faces.flat_map(|[a, b, c]| [(a, b), (b, c), (c, a)]);
        let away = sides.map(|(a, b)| {
            let part = (middle - a).dot(b - a) / a.distance_squared(b).max(f64::MIN_POSITIVE);
            middle.distance(a.lerp(b, part.clamp(0.0, 1.0)))
        });
        all.push((
            length,
            away.fold(f64::MAX, f64::min) / length,
            middle,
            vertex,
        ));
    }
    let longest = all.iter().map(|one| one.0).fold(0.0, f64::max);
    all.retain(|one| one.0 >= SMALL * longest);
    let is_held = all.iter().any(|one| one.1 <= INSIDE);
    all.retain(|one| is_held && one.1 > INSIDE);
    let said = |(length, away, middle, vertex): (f64, f64, DVec3, VertexId)| {
        let (length, [x, y, z]) = (100.0 * length, middle.to_array());
        let said = format!(
            "nothing of the body is in the opening of {length:.0} cm around ({x:.2}, {y:.2}, {z:.2}) m, at vertex {vertex}"
        );
        (away, said)
    };
    all.into_iter().map(said).collect()
}

/// The shapes of a body from its own to one that is clear of the cloth, and the pairs of faces that
/// met at first.
fn shrink(
    scene: &Scene,
    body: &Obstacle,
    progress: Listener<'_>,
) -> Result<(Vec<Vec<DVec3>>, usize), FitError> {
    let surface = CollisionMesh::new(scene.mesh.topology(), std::slice::from_ref(body));
    let cloth = scene.mesh.positions();
    let mut points = cloth.to_vec();
    points.extend(body.positions_at(0.0));
    let candidates = Candidates::new(&surface, &points, false);
    let mut met = candidates.intersections(&surface, &points);
    let before = met.len();
    let mut shape = points.split_off(cloth.len());
    // Of the diagonal of its box.
    let full = extent(&shape).length();
    let smoothing = Smoothing::of(&shape, body.faces());
    // What meets no face of a body is in it with all of its piece, or not at all.
    let pieces = scene.mesh.topology().sheets();
    let firsts = (0..=pieces.iter().copied().max().unwrap_or(0))
        .filter_map(|piece| pieces.iter().position(|of| *of == piece));
    let firsts: Vec<DVec3> = firsts.map(|v| cloth[v]).collect();
    let is_outside = |shape: &[DVec3]| {
        let faces = body.faces().iter();
        let faces = faces.map(|face| face.map(|p| shape[p as usize]));
        firsts
            .iter()
            .all(|place| winding(*place, faces.clone()).abs() < WITHIN)
    };
    let mut shapes = vec![shape.clone()];
    if met.is_empty() && is_outside(&shape) {
        return Ok((shapes, before));
    }
    let mut clear = 0;
    for _ in 0..PASSES {
        if clear > BEYOND {
            return Ok((shapes, before));
        }
        let next = smoothing.pass(&shape);
        let last = &shapes[shapes.len() - 1];
        if farthest(last, &next) <= STEP {
            shape = next;
            continue;
        }
        points.truncate(cloth.len());
        points.extend(&shape);
        met = candidates.intersections(&surface, &points);
        let is_clear = met.is_empty() && is_outside(&shape);
        clear = if is_clear { clear + 1 } else { 0 };
        let is_small = !is_clear && extent(&shape).length() < SMALLEST * full;
        shapes.push(std::mem::replace(&mut shape, next));
        let now = FitProgress {
            meeting: Some(met.len()),
            ..FitProgress::default()
        };
        tell(progress, now)?;
        if is_small {
            break;
        }
    }
    let faces = met
        .iter()
        .map(|pair| surface.faces()[pair.faces[0] as usize]);
    let vertices: Vec<u32> = faces.flatten().collect();
    Err(not_clear(body, cloth, [before, met.len()], &vertices))
}

/// The error of a body that meets `cloth` at so many pairs of faces at first and now, now around these
/// `vertices`.
fn not_clear(
    body: &Obstacle,
    cloth: &[DVec3],
    [before, left]: [usize; 2],
    vertices: &[u32],
) -> FitError {
    let sum: DVec3 = vertices.iter().map(|v| cloth[*v as usize]).sum();
    FitError::NotClear {
        body: body.name().to_owned(),
        before,
        left,
        vertex: VertexId(vertices.first().copied().unwrap_or(0)),
        place: sum / vertices.len().max(1) as f64,
    }
}

/// Grows the body of this `number` through its shapes, the last first, and lets the cloth come to
/// rest.
fn grow(
    scene: &Scene,
    number: usize,
    shapes: Vec<Vec<DVec3>>,
    progress: Listener<'_>,
) -> Result<Vec<DVec3>, FitError> {
    let name = scene.obstacles[number].name();
    let frames = shapes.len() - 1;
    let not_grown = |frame: usize, cause: String| FitError::NotGrown {
        body: name.to_owned(),
        percent: 100.0 * (frame as f64 / frames as f64).min(1.0),
        cause,
    };
    let mut simulator = growing(scene, number, shapes)?;
    let springs = springs(&scene.mesh, &scene.handles);
    let most = MOST.max(largest_strain(&springs, scene.mesh.positions()));
    let held = scene.handles.select(scene.mesh.positions());
    let targets = HandleTargets::at_frame_end(held).map_err(failed)?;
    for frame in 0..frames + LONGEST {
        let stepped = simulator.step(&targets);
        stepped.map_err(|error| not_grown(frame, error.to_string()))?;
        let mut still = simulator.checkpoint();
        still.velocities.fill(DVec3::ZERO);
        still.previous = None;
        still.changes = None;
        simulator.restore(&still)?;
        let has_released = still
            .contact
            .is_some_and(|memory| !memory.released.is_empty());
        if frame >= frames + SETTLING && !has_released {
            break;
        }
        let passed = (frame as f64 / (frames + SETTLING) as f64).min(1.0);
        let done = SHRINKING + (1.0 - SHRINKING) * passed;
        let strain = largest_strain(&springs, simulator.positions_f64());
        if strain > most {
            let cause = format!("strains the cloth by {:.0} %", 100.0 * strain);
            return Err(not_grown(frame, cause));
        }
        tell(progress, FitProgress::at(done, strain))?;
    }
    let positions = simulator.positions_f64().to_vec();
    let left = simulator.checkpoint().contact.unwrap_or_default();
    match left.released.first() {
        None => Ok(positions),
        Some(one) => {
            let (vertex, place) = (one.vertex, positions[one.vertex as usize]);
            let cause = format!("leaves it no room around vertex {vertex} at {place:.2} m");
            Err(not_grown(frames, cause))
        }
    }
}

/// A simulator of the cloth with the body growing.
fn growing(scene: &Scene, number: usize, shapes: Vec<Vec<DVec3>>) -> Result<Simulator, FitError> {
    let mut growing = bare(scene, 1.0);
    // What is let through is known by its place in frame 0, where the body is whole; it starts in
    // frame 1.
    let whole = shapes[..1].to_vec();
    let path = ObstaclePath::Points {
        frame_rate: scene.frame_rate,
        frames: whole.into_iter().chain(shapes.into_iter().rev()).collect(),
    };
    let moving = scene.obstacles[number].at_start().moving(path);
    growing.obstacles[number] = moving.map_err(failed)?;
    let positions = scene.mesh.positions().to_vec();
    let rest = vec![DVec3::ZERO; positions.len()];
    let start = Checkpoint::of(1, positions, rest);
    Ok(Simulator::from_checkpoint(&growing, &start)?)
}

fn farthest(from: &[DVec3], to: &[DVec3]) -> f64 {
    let ways = from.iter().zip(to).map(|(a, b)| a.distance(*b));
    ways.fold(0.0, f64::max)
}

/// The neighbours of points, of which those at one place are one.
struct Smoothing {
    /// The first point at the place of each.
    first: Vec<usize>,
    sides: Vec<[usize; 2]>,
}

impl Smoothing {
    fn of(points: &[DVec3], faces: &[[u32; 3]]) -> Self {
        let mut known = HashMap::new();
        let places = points.iter().enumerate();
        let first: Vec<usize> = places
            .map(|(k, p)| *known.entry(p.to_array().map(f64::to_bits)).or_insert(k))
            .collect();
        let sides = faces.iter().flat_map(|face| {
            let face = face.map(|p| first[p as usize]);
            (0..3).map(move |k| [face[k], face[(k + 1) % 3]])
        });
        Self {
            sides: sides.collect(),
            first,
        }
    }

    /// Every point half way to the mean of its neighbours, which inner sides count twice.
    fn pass(&self, points: &[DVec3]) -> Vec<DVec3> {
        let sums = of_neighbours(points, &self.sides);
        let moved = |&first: &usize| match sums[first] {
            (_, 0) => points[first],
            (sum, count) => {
                let way = 0.5 * (sum / f64::from(count) - points[first]);
                points[first] + way.clamp_length_max(0.5 * STEP)
            }
        };
        self.first.iter().map(moved).collect()
    }
}
