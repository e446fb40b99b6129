//! Moments: the frames of a run that a contact sheet shows.

use glam::Vec3;
use selvedge_cloth::Topology;

use crate::Run;

/// A run whose vertices travel less than this on average is at rest `[m]`.
const AT_REST: f32 = 1e-3;

/// At most `count` frames of `run`, in rising order; all of them when there are no more.
///
/// They are spread over the motion, so that time at rest takes no picture. The way that the vertices
/// travel on average is cut into equal shares; of the middle half of each share, the frame with the
/// deepest folds is shown. Of a run that hardly moves they are evenly spaced.
pub(crate) fn moments(run: &Run<'_>, count: usize) -> Vec<usize> {
    let frames = run.frames();
    let travelled = travelled(frames);
    let total = travelled[frames.len() - 1];
    let moves = total.is_finite() && total > AT_REST;
    if !moves || count >= frames.len() {
        return evenly_spaced(frames.len(), count);
    }
    let at_share = |share: f32| travelled.partition_point(|&way| way < share * total);
    let mut chosen: Vec<usize> = (0..count)
        .map(|k| {
            let [from, to] = [0.25, 0.75].map(|part| at_share((k as f32 + part) / count as f32));
            deepest_folds(run, from..=to.min(frames.len() - 1))
        })
        .collect();
    chosen.dedup();
    chosen
}

/// The mean way of a vertex from the first frame to each `[m]`, `[frames]`.
fn travelled(frames: &[&[Vec3]]) -> Vec<f32> {
    let mut way = 0.0;
    let steps = frames.windows(2).map(|pair| {
        let [before, now] = [pair[0], pair[1]];
        let sum: f32 = before.iter().zip(now).map(|(p, q)| p.distance(*q)).sum();
        sum / before.len() as f32
    });
    let later = steps.map(|step| {
        way += step;
        way
    });
    std::iter::once(0.0).chain(later).collect()
}

/// The frame among `frames` whose surface is folded most; the first of several.
fn deepest_folds(run: &Run<'_>, frames: std::ops::RangeInclusive<usize>) -> usize {
    let first = *frames.start();
    let mut normals = Vec::new();
    let (mut best, mut deepest) = (first, f32::NEG_INFINITY);
    for frame in frames {
        let depth = folding(run.topology(), run.frames()[frame], &mut normals);
        if depth > deepest {
            (best, deepest) = (frame, depth);
        }
    }
    best
}

/// Σ (1 - cos angle) · length over the edges between two faces `[m]`; `normals` is scratch.
fn folding(topology: &Topology, positions: &[Vec3], normals: &mut Vec<Vec3>) -> f32 {
    normals.clear();
    normals.extend(topology.faces().iter().map(|face| {
        let [a, b, c] = face.map(|vertex| positions[vertex.index()]);
        (b - a).cross(c - a).normalize_or_zero()
    }));
    let of_edge = |edge: &selvedge_cloth::Edge| match edge.faces {
        (left, Some(right)) => {
            let [from, to] = edge.vertices.map(|vertex| positions[vertex.index()]);
            let cosine = normals[left.index()].dot(normals[right.index()]);
            (1.0 - cosine) * from.distance(to)
        }
        (_, None) => 0.0,
    };
    topology.edges().iter().map(of_edge).sum()
}

/// `count` numbers from 0 to `frames` - 1, evenly spaced; all of them when there are fewer.
fn evenly_spaced(frames: usize, count: usize) -> Vec<usize> {
    let count = count.min(frames);
    let steps = (count - 1).max(1);
    // Rounded to the nearest frame, in whole numbers.
    (0..count)
        .map(|k| (2 * k * (frames - 1) + steps) / (2 * steps))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_frames_are_spread_from_the_first_to_the_last() {
        assert_eq!(evenly_spaced(61, 4), [0, 20, 40, 60]);
        assert_eq!(evenly_spaced(10, 4), [0, 3, 6, 9]);
        assert_eq!(evenly_spaced(3, 8), [0, 1, 2]);
        assert_eq!(evenly_spaced(9, 1), [0]);
    }

    /// A strip of two triangles that rests for 50 frames, moves along x by a metre in 100 frames,
    /// and rests again; it is folded in the frames `folded`.
    fn frames(folded: std::ops::Range<usize>) -> Vec<[Vec3; 4]> {
        (0..200_usize)
            .map(|frame| {
                let way = Vec3::X * 0.01 * frame.clamp(50, 150).saturating_sub(50) as f32;
                let height = if folded.contains(&frame) { 0.5 } else { 0.0 };
                [Vec3::Y, Vec3::Z, -Vec3::Z, -Vec3::Y + height * Vec3::X].map(|p| p + way)
            })
            .collect()
    }

    #[test]
    fn frames_in_motion_leave_rest_out_and_prefer_folds() {
        let topology = Topology::new(4, &[[0, 1, 2], [2, 1, 3]]).unwrap();
        let frames = frames(120..122);
        let slices = || frames.iter().map(<[Vec3; 4]>::as_slice);
        let run = Run::new(&topology, slices(), &[], 60.0).unwrap();
        // The fold adds a travel of 0.25 m in frame 120 and again in frame 122, so that the way is
        // 1.25 m by frame 150; the second half of it is at frames 112 to 150.
        let chosen = moments(&run, 2);
        assert!((50..113).contains(&chosen[0]), "{chosen:?}");
        assert_eq!(chosen[1], 120);
    }

    #[test]
    fn a_run_at_rest_is_shown_evenly() {
        let topology = Topology::new(4, &[[0, 1, 2], [2, 1, 3]]).unwrap();
        let frames = &frames(0..0)[..11];
        let slices = frames.iter().map(<[Vec3; 4]>::as_slice);
        let run = Run::new(&topology, slices, &[], 60.0).unwrap();
        assert_eq!(moments(&run, 3), [0, 5, 10]);
    }
}
