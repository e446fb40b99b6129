//! Vertices that are held, found by how they move: they stand still in all frames, or keep their
//! distances from each other in all frames while the cloth around them does not.
//!
//! Each group of the second kind is a set in which every two keep their distance. What is moved by
//! a hand keeps it to the rounding of the file; cloth stretches by more than that, seen over enough
//! frames. Two vertices that are near each other are no group by themselves: their distance changes
//! by so little that rounding may hide it.

use std::collections::BTreeSet;

use glam::DVec3;

/// Roundings of the largest coordinate by which a distance that is kept may differ: each end has
/// three coordinates in single precision, in each of two frames.
const ROUNDINGS: f64 = 4.0;

/// Distance from which two vertices may be a group by themselves, as a share of the diagonal of the
/// cloth's box.
const APART: f64 = 0.1;

/// Frames from which a motion says anything.
const LEAST_FRAMES: usize = 3;

/// Members of a group to which a further one is compared.
const COMPARED: usize = 32;

/// So many roundings of the largest coordinate in single precision `[m]`.
pub(super) fn rounding(frames: &[Vec<DVec3>], roundings: f64) -> f64 {
    let coordinates = frames.iter().flatten().map(|p| p.abs().max_element());
    roundings * f64::from(f32::EPSILON) * coordinates.fold(0.0, f64::max)
}

/// The held vertices of a cloth with these `faces`, by number.
///
/// # Errors
/// The end of a sentence, where none or all of them move so.
pub(super) fn found(frames: &[Vec<DVec3>], faces: &[[u32; 3]]) -> Result<Vec<u32>, String> {
    let vertices = frames.first().map_or(0, Vec::len);
    let count = frames.len();
    if count < LEAST_FRAMES {
        return Err(format!(
            "has {count} frames, too few to find the held vertices from: number them (`handles` 0,30)"
        ));
    }
    let motion = Motion::new(frames);
    let (still, mut moving): (Vec<u32>, Vec<u32>) =
        (0..vertices as u32).partition(|&vertex| motion.stands(vertex));
    if moving.is_empty() {
        return Err(
            "has a cloth that does not move: no vertex is held more than another".to_owned(),
        );
    }
    let edges: BTreeSet<[u32; 2]> = faces
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    let first = &frames[0];
    let apart = APART * diagonal(first);
    let is_small = |group: &[u32]| match *group {
        [a, b] => {
            let distance = first[a as usize].distance(first[b as usize]);
            distance < apart || edges.contains(&[a.min(b), a.max(b)])
        }
        _ => group.len() < 2,
    };
    let mut held: BTreeSet<u32> = still.iter().copied().collect();
    while let Some(vertex) = moving.pop() {
        // One that turns about another that stands still keeps its distance from that.
        let others = moving.iter().chain(&still);
        let near = others.filter(|&&other| motion.keep(vertex, other));
        let group = motion.group(vertex, near.copied().collect());
        if is_small(&group) {
            continue;
        }
        moving.retain(|other| !group.contains(other));
        held.extend(group);
    }
    let tolerance = motion.tolerance;
    if held.is_empty() {
        return Err(format!(
            "has no vertex that stands still and no two that keep their distance to {tolerance:.1e} m in all {count} frames: number the held vertices (`handles` 0,30), or name nodes that they go with (`handles` left,right); one that is moved alone cannot be found"
        ));
    }
    if held.len() == vertices {
        return Err(format!(
            "moves as if all its {vertices} vertices were held: they keep their distances to {tolerance:.1e} m in all {count} frames; number those that are (`handles` 0,30)"
        ));
    }
    Ok(held.into_iter().collect())
}

/// The diagonal of the box around `points`.
fn diagonal(points: &[DVec3]) -> f64 {
    let low = points.iter().copied().reduce(DVec3::min);
    let high = points.iter().copied().reduce(DVec3::max);
    low.zip(high).map_or(0.0, |(low, high)| low.distance(high))
}

/// The frames, those that differ most from the first one first.
struct Motion<'a> {
    frames: Vec<&'a [DVec3]>,
    tolerance: f64,
}

impl<'a> Motion<'a> {
    fn new(frames: &'a [Vec<DVec3>]) -> Self {
        // The first, the middle of all, the middles of the halves, and so on: most pairs that move
        // apart are seen to at once.
        let bits = usize::BITS - (frames.len() - 1).leading_zeros();
        let order = (0..1_usize << bits).map(|k| k.reverse_bits() >> (usize::BITS - bits));
        Self {
            frames: order
                .filter_map(|k| frames.get(k).map(Vec::as_slice))
                .collect(),
            tolerance: rounding(frames, ROUNDINGS),
        }
    }

    /// True if a vertex is where it was in every frame.
    fn stands(&self, vertex: u32) -> bool {
        let at = |frame: &[DVec3]| frame[vertex as usize];
        let place = at(self.frames[0]);
        self.frames
            .iter()
            .all(|frame| at(frame).distance(place) <= self.tolerance)
    }

    /// True if two vertices keep their distance in every frame.
    fn keep(&self, a: u32, b: u32) -> bool {
        let apart = |frame: &[DVec3]| frame[a as usize].distance(frame[b as usize]);
        let first = apart(self.frames[0]);
        self.frames
            .iter()
            .all(|frame| (apart(frame) - first).abs() <= self.tolerance)
    }

    /// `vertex` and those of `near`, each of which keeps its distance from it, that also keep it
    /// from each other: beginning with those that keep it from most.
    fn group(&self, vertex: u32, near: Vec<u32>) -> Vec<u32> {
        let sample = near.iter().step_by(1 + near.len() / COMPARED);
        let kept = |other: u32| sample.clone().filter(|&&one| self.keep(one, other)).count();
        let mut near: Vec<(usize, u32)> = near.iter().map(|&other| (kept(other), other)).collect();
        near.sort_unstable_by(|a, b| b.cmp(a));
        let mut group = vec![vertex];
        for (_, other) in near {
            if group
                .iter()
                .take(COMPARED)
                .all(|&member| self.keep(member, other))
            {
                group.push(other);
            }
        }
        group
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    const SIDE: u32 = 6;

    /// A square grid of triangles.
    fn faces() -> Vec<[u32; 3]> {
        let cell = |k: u32| {
            let a = k / (SIDE - 1) * SIDE + k % (SIDE - 1);
            [[a, a + 1, a + SIDE], [a + 1, a + SIDE + 1, a + SIDE]]
        };
        (0..(SIDE - 1) * (SIDE - 1)).flat_map(cell).collect()
    }

    /// A grid that waves, while a hand takes `held` along, rounded to single precision.
    fn frames(held: &[u32], hand: impl Fn(f64, DVec3) -> DVec3) -> Vec<Vec<DVec3>> {
        let frame = |number: u32| {
            let t = f64::from(number) / 24.0;
            let place = |vertex: u32| {
                let [i, j] = [vertex / SIDE, vertex % SIDE].map(|x| f64::from(x) / 5.0);
                let flat = DVec3::new(i, j, 0.0);
                let wave = DVec3::new(
                    0.02 * (3.0 * i + t).sin(),
                    0.01 * (t * j).cos(),
                    (4.0 * t + 2.0 * i + j).sin(),
                );
                let at = if held.contains(&vertex) {
                    hand(t, flat)
                } else {
                    flat + 0.1 * wave
                };
                at.as_vec3().as_dvec3()
            };
            (0..SIDE * SIDE).map(place).collect()
        };
        (0..20).map(frame).collect()
    }

    #[test]
    fn what_a_hand_turns_is_found() {
        let turn =
            |t: f64, p: DVec3| DQuat::from_rotation_y(2.0 * t) * p + DVec3::new(t, t * t, 0.0);
        for held in [&[0, 30][..], &[3, 4, 5], &[0, 7, 13, 21, 35]] {
            assert_eq!(found(&frames(held, turn), &faces()).unwrap(), held);
        }
    }

    #[test]
    fn what_stands_still_is_found_even_alone() {
        for held in [&[35][..], &[0, 5]] {
            assert_eq!(found(&frames(held, |_, p| p), &faces()).unwrap(), held);
        }
    }

    #[test]
    fn what_turns_about_one_that_stands_is_found() {
        let about = |t: f64, p: DVec3| DQuat::from_rotation_y(3.0 * t) * p;
        let held = [0, 35];
        assert_eq!(found(&frames(&held, about), &faces()).unwrap(), held);
    }

    #[test]
    fn hands_that_move_apart_are_two_groups() {
        let hands = |t: f64, p: DVec3| match p.x < 0.5 {
            true => p + DVec3::Y * t,
            false => DQuat::from_rotation_z(t) * p,
        };
        let held = [0, 2, 31, 33];
        assert_eq!(found(&frames(&held, hands), &faces()).unwrap(), held);
    }

    #[test]
    fn none_and_all_have_words() {
        let lift = |t: f64, p: DVec3| p + DVec3::Y * t;
        for (held, word) in [
            (vec![], "no vertex that stands still"),
            // One alone, and the two ends of an edge, could be the cloth.
            (vec![7], "moved alone"),
            (vec![7, 8], "no two that keep"),
            ((0..36).collect(), "all its 36 vertices"),
        ] {
            let error = found(&frames(&held, lift), &faces()).unwrap_err();
            assert!(
                error.contains(word) && error.contains("`handles`"),
                "{error}"
            );
        }
        let all: Vec<u32> = (0..36).collect();
        let error = found(&frames(&all, |_, p| p), &faces()).unwrap_err();
        assert!(error.contains("does not move"), "{error}");
        let error = found(&frames(&[0], lift)[..2], &faces()).unwrap_err();
        assert!(error.contains("2 frames"), "{error}");
    }
}
