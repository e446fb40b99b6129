//! Distances of two runs of one cloth, and the stretch and speed of one: the measures of
//! Libao et al. 2023, section 6, and a few of our own.
//!
//! Pure functions over frames; sums are `f64`. Two runs are compared over the frames that both
//! have. A value that is not finite makes the measure so: it is never left out.

use glam::{DVec3, Vec3};
use selvedge_cloth::geometry::dihedral_angle;
use selvedge_cloth::{Topology, VertexId};
use serde::{Deserialize, Serialize};

use crate::Frames;
use crate::formats::file_error::Problem;

pub(crate) mod character;

pub use character::Character;

/// The measures of run `b` against run `a`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Frames compared: the smaller of `frame_counts`.
    pub frames: usize,
    /// Frames of `a` and of `b`.
    pub frame_counts: [usize; 2],
    /// See [`position_rmse`] `[m]`.
    pub position_rmse: f64,
    /// Largest distance of a vertex from where it should be `[m]`.
    pub position_max: f64,
    /// Mean distance of a vertex from where it should be `[m]`.
    pub mean_vertex_error: f64,
    /// See [`edge_length_rmse`] `[m]`.
    pub edge_length_rmse: f64,
    /// Mean length of the edges of `a` `[m]`.
    pub edge_length_mean: f64,
    /// Position RMSE of each frame `[m]`, `[frames]`.
    pub per_frame_rmse: Vec<f64>,
}

/// All measures of run `b` against run `a`, over the frames that both have.
/// [`Comparison::frame_counts`] shows when one run is longer. The caller makes sure that both runs
/// are of one mesh: only the numbers of vertices are compared.
///
/// # Errors
/// [`Problem`] when the runs or the mesh do not fit, or have no frame in common.
pub fn compare(a: Frames<'_>, b: Frames<'_>, topology: &Topology) -> Result<Comparison, Problem> {
    let frame_counts = [a.len(), b.len()];
    let (a, b) = common(a, b)?;
    Ok(Comparison {
        frames: a.len(),
        frame_counts,
        position_rmse: position_rmse(a, b)?,
        position_max: largest(vertex_errors(a, b)?),
        mean_vertex_error: mean_vertex_error(a, b)?,
        edge_length_rmse: edge_length_rmse(a, b, topology)?,
        edge_length_mean: mean_edge_length(a, topology)?,
        per_frame_rmse: per_frame_rmse(a, b)?,
    })
}

/// Position RMSE `[eq:position-rmse]`: √(mean over frames and vertices of |p - p̂|²) `[m]`.
///
/// ```
/// use glam::Vec3;
/// use selvedge_data::{Frames, metrics::position_rmse};
///
/// let (a, b) = ([Vec3::ZERO; 2], [Vec3::ZERO, Vec3::new(3.0, 4.0, 0.0)]);
/// let rmse = position_rmse(Frames::new(&a, 2)?, Frames::new(&b, 2)?)?;
/// assert_eq!(rmse, 12.5_f64.sqrt());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn position_rmse(a: Frames<'_>, b: Frames<'_>) -> Result<f64, Problem> {
    Ok(rms(vertex_errors(a, b)?))
}

/// Position RMSE of each frame `[m]`, `[frames]`.
pub fn per_frame_rmse<'a>(a: Frames<'a>, b: Frames<'a>) -> Result<Vec<f64>, Problem> {
    let (a, b) = common(a, b)?;
    let alone = |frame: &'a [Vec3]| Frames::of_whole(frame, frame.len());
    let of_frame = |(p, q)| position_rmse(alone(p), alone(q));
    a.iter().zip(b.iter()).map(of_frame).collect()
}

/// Mean distance of a vertex from where it should be `[m]`.
pub fn mean_vertex_error(a: Frames<'_>, b: Frames<'_>) -> Result<f64, Problem> {
    Ok(mean(vertex_errors(a, b)?))
}

/// Edge-length RMSE `[eq:edge-length-rmse]`: √(mean over frames and undirected edges of
/// (|d| - |d̂|)²) `[m]`.
pub fn edge_length_rmse(a: Frames<'_>, b: Frames<'_>, topology: &Topology) -> Result<f64, Problem> {
    let (a, b) = common(a, b)?;
    check_mesh(a, topology)?;
    let square = |(p, q)| edge_errors(p, q, topology).map(|e| e * e).sum::<f64>();
    let squares: f64 = a.iter().zip(b.iter()).map(square).sum();
    Ok((squares / (a.len() * topology.edges().len()) as f64).sqrt())
}

/// The first frame of more than `frames` in a row whose largest strain, as from
/// [`largest_strain`], is above `limit` or is not a number: where a run
/// diverges, and does not merely stretch for a moment.
pub fn diverged_frame(largest_strains: &[f64], limit: f64, frames: usize) -> Option<usize> {
    let holds = |strain: f64| strain <= limit;
    let mut first = 0;
    for (frame, &strain) in largest_strains.iter().enumerate() {
        if holds(strain) {
            first = frame + 1;
        } else if frame - first >= frames {
            return Some(first);
        }
    }
    None
}

/// Mean length of the edges over all frames `[m]`.
pub fn mean_edge_length(frames: Frames<'_>, topology: &Topology) -> Result<f64, Problem> {
    check_mesh(frames, topology)?;
    let lengths = |p| edge_lengths(p, topology).sum::<f64>();
    let sum: f64 = frames.iter().map(lengths).sum();
    Ok(sum / (frames.len() * topology.edges().len()) as f64)
}

/// Largest strain of each frame, max over edges of (l - l₀)/l₀, `[frames]`; `rest_lengths` `[m]`,
/// `[edges]`, as from [`Pattern::edge_lengths`](selvedge_cloth::Pattern::edge_lengths). Negative where every edge is shortened.
pub fn largest_strain(
    frames: Frames<'_>,
    topology: &Topology,
    rest_lengths: &[f64],
) -> Result<Vec<f64>, Problem> {
    check_mesh(frames, topology)?;
    let (expected, found) = (topology.edges().len(), rest_lengths.len());
    if found != expected {
        return Err(Problem(format!(
            "found rest lengths for {found} edges, the mesh has {expected}"
        )));
    }
    let strains = |positions| largest(strains(positions, topology, rest_lengths));
    Ok(frames.iter().map(strains).collect())
}

/// Mean and largest speed of the vertices between neighbouring frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Speeds {
    /// Mean over frames and vertices `[m/s]`.
    pub mean: f64,
    /// The largest `[m/s]`.
    pub max: f64,
}

/// Speeds over all pairs of neighbouring frames; both zero for a single frame.
pub fn speeds(frames: Frames<'_>, frame_rate: f64) -> Result<Speeds, Problem> {
    if frames.is_empty() {
        return Err(no_frames());
    }
    let pairs = || frames.iter().zip(frames.iter().skip(1));
    let steps = || pairs().flat_map(|(now, next)| distances(now, next));
    Ok(Speeds {
        mean: mean(steps()) * frame_rate,
        max: largest(steps().chain([0.0])) * frame_rate,
    })
}

/// Mean speed of the vertices in the last second `[m/s]`: how far a run is from rest at its end.
pub fn final_speed(frames: Frames<'_>, frame_rate: f64) -> Result<f64, Problem> {
    let steps = (frame_rate.round() as usize).max(1);
    Ok(speeds(frames.last(steps + 1), frame_rate)?.mean)
}

/// The frames that both runs have.
fn common<'a, 'b>(a: Frames<'a>, b: Frames<'b>) -> Result<(Frames<'a>, Frames<'b>), Problem> {
    let (first, second) = (a.vertex_count(), b.vertex_count());
    if first != second {
        return Err(other_mesh(first, second));
    }
    let count = a.len().min(b.len());
    if count == 0 {
        return Err(no_frames());
    }
    Ok((a.first(count), b.first(count)))
}

fn other_mesh(first: usize, second: usize) -> Problem {
    Problem(format!(
        "the runs are of different meshes: {first} and {second} vertices"
    ))
}

fn no_frames() -> Problem {
    Problem("there is no frame to measure".to_owned())
}

fn check_mesh(frames: Frames<'_>, topology: &Topology) -> Result<(), Problem> {
    let (first, second) = (frames.vertex_count(), topology.vertex_count());
    if first != second {
        return Err(other_mesh(first, second));
    }
    if frames.is_empty() {
        return Err(no_frames());
    }
    Ok(())
}

/// How far each vertex of each frame is from where it should be `[m]`.
fn vertex_errors<'a>(
    a: Frames<'a>,
    b: Frames<'a>,
) -> Result<impl Iterator<Item = f64> + use<'a>, Problem> {
    let (a, b) = common(a, b)?;
    Ok(a.iter().zip(b.iter()).flat_map(|(p, q)| distances(p, q)))
}

/// How far the vertices of two frames are apart `[m]`.
pub fn distances<P: Copy + Into<DVec3>>(p: &[P], q: &[P]) -> impl Iterator<Item = f64> {
    p.iter()
        .zip(q)
        .map(|(p, q)| (*p).into().distance((*q).into()))
}

/// By how much the edges of one frame are longer than those of another `[m]`.
pub fn edge_errors<P: Copy + Into<DVec3>>(
    truth: &[P],
    found: &[P],
    topology: &Topology,
) -> impl Iterator<Item = f64> {
    let pairs = edge_lengths(truth, topology).zip(edge_lengths(found, topology));
    pairs.map(|(truth, found)| found - truth)
}

/// Strains of the edges of a frame, (l - l₀)/l₀, with the rest lengths `[m]`.
pub fn strains<P: Copy + Into<DVec3>>(
    positions: &[P],
    topology: &Topology,
    rest_lengths: &[f64],
) -> impl Iterator<Item = f64> {
    let pairs = edge_lengths(positions, topology).zip(rest_lengths);
    pairs.map(|(length, rest)| (length - rest) / rest)
}

/// Lengths of the edges of a frame `[m]`.
fn edge_lengths<P: Copy + Into<DVec3>>(
    positions: &[P],
    topology: &Topology,
) -> impl Iterator<Item = f64> {
    topology.edges().iter().map(|edge| {
        let [a, b] = edge.vertices.map(|v| positions[v.index()].into());
        a.distance(b)
    })
}

/// The bending angle `[rad]` and the length `[m]` of each inner edge of a frame.
pub fn bends<P: Copy + Into<DVec3>>(
    positions: &[P],
    topology: &Topology,
) -> impl Iterator<Item = [f64; 2]> {
    topology.edges().iter().filter_map(|edge| {
        let (left, right) = (edge.opposite.0, edge.opposite.1?);
        let [from, to] = edge.vertices;
        let at = |vertex: VertexId| positions[vertex.index()].into();
        let [from, to, left, right] = [from, to, left, right].map(at);
        Some([dihedral_angle(from, to, left, right), from.distance(to)])
    })
}

/// √(mean of squares); 0 of none.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    mean(values.map(|value| value * value)).sqrt()
}

/// The mean; 0 of none.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, n), value| (sum + value, n + 1));
    sum / count.max(1) as f64
}

/// The largest; NaN where one of them is.
pub fn largest(values: impl Iterator<Item = f64>) -> f64 {
    let larger = |a: f64, b: f64| if a >= b || a.is_nan() { a } else { b };
    values.fold(f64::NEG_INFINITY, larger)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_diverges_where_it_stays_strained() {
        for (strained, patience, expected) in [
            (&[2, 3, 4][..], 3, None),
            (&[2, 3, 4, 5], 3, Some(2)),
            (&[2, 3, 4, 6, 7, 8, 9], 3, Some(6)),
            (&[8, 9, 10, 11], 3, Some(8)),
            (&[9, 10, 11], 3, None),
            (&[4], 0, Some(4)),
        ] {
            let strain = |frame| if strained.contains(&frame) { 0.4 } else { 0.1 };
            let run: Vec<f64> = (0..12).map(strain).collect();
            let found = diverged_frame(&run, 0.3, patience);
            assert_eq!(found, expected, "{strained:?}");
        }
        let lost = vec![f64::NAN; 3];
        assert_eq!(diverged_frame(&lost, 0.3, 2), Some(0));
    }
}
