//! Groups of handles that are led by displacements of their own, at common times.
//!
//! Distances between handles are convex between two keyframes, so that those at the keyframes bound
//! them.

use glam::DVec3;

use super::{Draws, TRAINED_SPEED};
use crate::motion::MOTION_RATE;
use crate::{Keyframe, KeyframeGroup, KeyframeMotion};

/// Ratio of the peak speed to the mean between two keyframes: the slope of s²(3 - 2s) at ½.
const KEYFRAME_PEAK: f64 = 1.5;
/// Shortest and longest time between two keyframes `[s]`.
const KEYFRAME_SPAN: [f64; 2] = [0.5, 1.5];
/// Longest way of a handle against the others between keyframes, in parts of the cloth's size.
const APART: f64 = 0.6;
/// Part of the flat distance to which the distance of two handles may grow: that and a rounding.
const TAUT: f64 = 1.0 + 1e-9;
/// Times that displacements are drawn nearer together before the handles stay where they are.
const TRIES: usize = 20;
/// Most groups.
const MOST_GROUPS: usize = 4;

/// Handles in groups.
struct Groups<'a> {
    /// Start positions `[m]`, `[handles]`.
    start: &'a [DVec3],
    /// Handles of each group.
    members: Vec<Vec<usize>>,
    /// The group of each handle.
    owner: Vec<usize>,
    /// Centre of each group at the start `[m]`.
    centres: Vec<DVec3>,
    /// Mean of the centres `[m]`.
    middle: DVec3,
}

/// Displacements of groups from their start.
#[derive(Clone)]
struct Place {
    /// The part that all have in common `[m]`.
    together: DVec3,
    /// Displacement of each group `[m]`.
    groups: Vec<DVec3>,
}

impl Draws {
    /// Keyframes for groups of handles with these start positions `[m]`, of a cloth of this size
    /// `[m]`: no faster than `speed`, in parts of the trained one, for `duration` `[s]` or a little
    /// more.
    pub(super) fn apart(
        &mut self,
        start: &[DVec3],
        size: f64,
        speed: f64,
        duration: f64,
    ) -> KeyframeMotion {
        let groups = self.groups(start);
        let count = groups.members.len();
        let mut place = Place {
            together: DVec3::ZERO,
            groups: vec![DVec3::ZERO; count],
        };
        let mut keyframes: Vec<Vec<Keyframe>> = vec![Vec::new(); count];
        // Counted in whole frames: a time is then the same number wherever it comes from.
        let frames = |seconds: f64| (seconds * MOTION_RATE).round();
        let (mut frame, end) = (frames(self.uniform([0.2, 0.6])), frames(duration));
        let mut last = end;
        while frame < end {
            let lasts = frames(self.uniform(KEYFRAME_SPAN));
            let farthest = speed * TRAINED_SPEED * lasts / MOTION_RATE / KEYFRAME_PEAK;
            // Half of the speed for all together, half against each other.
            let together = self.unit() * farthest / 2.0 * self.direction();
            let own = (0..count).map(|_| self.unit() * APART * size * self.direction());
            let next = groups.settle(&place, together, own.collect(), farthest);
            for (group, keyframes) in keyframes.iter_mut().enumerate() {
                add(keyframes, frame, place.groups[group]);
                add(keyframes, frame + lasts, next.groups[group]);
            }
            place = next;
            frame += lasts;
            last = frame;
            frame += frames(self.uniform([0.0, 0.5]));
        }
        let groups = groups.members.into_iter().zip(keyframes);
        KeyframeMotion {
            duration: last.max(end) / MOTION_RATE,
            groups: groups
                .map(|(handles, keyframes)| KeyframeGroup {
                    handles,
                    keyframes,
                    axis: DVec3::Y,
                })
                .collect(),
        }
    }

    fn groups<'a>(&mut self, start: &'a [DVec3]) -> Groups<'a> {
        let count = self.whole(2, start.len().min(MOST_GROUPS));
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); count];
        let mut owner = Vec::with_capacity(start.len());
        for handle in 0..start.len() {
            // The first of them make sure that no group is empty.
            let group = if handle < count {
                handle
            } else {
                self.whole(0, count - 1)
            };
            members[group].push(handle);
            owner.push(group);
        }
        let centre = |handles: &Vec<usize>| {
            handles.iter().map(|&handle| start[handle]).sum::<DVec3>() / handles.len() as f64
        };
        let centres: Vec<DVec3> = members.iter().map(centre).collect();
        Groups {
            middle: centres.iter().sum::<DVec3>() / count as f64,
            start,
            members,
            owner,
            centres,
        }
    }
}

impl Groups<'_> {
    /// The place after `from`, farther by `together` for all and with displacements `own` of the
    /// groups: drawn back and towards each other until no group goes farther than `farthest` `[m]`
    /// and no two handles are too far from each other. Where that is not found, `from` itself.
    fn settle(&self, from: &Place, together: DVec3, mut own: Vec<DVec3>, farthest: f64) -> Place {
        let mut together = from.together + together;
        for _ in 0..TRIES {
            let groups: Vec<DVec3> = own.iter().map(|own| together + *own).collect();
            let mut ways = groups.iter().zip(&from.groups);
            let is_slow = ways.all(|(to, from)| to.distance(*from) <= farthest);
            if is_slow && self.are_loose(&groups) {
                return Place { together, groups };
            }
            for (own, centre) in own.iter_mut().zip(&self.centres) {
                *own = 0.8 * *own + 0.06 * (self.middle - *centre);
            }
            together = from.together.lerp(together, 0.8);
        }
        from.clone()
    }

    /// Returns true when no two handles are farther from each other than the cloth allows.
    fn are_loose(&self, displacements: &[DVec3]) -> bool {
        let (start, owner) = (self.start, &self.owner);
        let at = |handle: usize| start[handle] + displacements[owner[handle]];
        (0..start.len()).all(|a| {
            (0..a).all(|b| {
                let most = TAUT * start[a].distance(start[b]);
                owner[a] == owner[b] || at(a).distance(at(b)) <= most
            })
        })
    }
}

/// Adds a keyframe at a frame of 1/60 s, unless there is one already.
fn add(keyframes: &mut Vec<Keyframe>, frame: f64, translation: DVec3) {
    let time = frame / MOTION_RATE;
    if keyframes.last().is_none_or(|last| last.time < time) {
        keyframes.push(Keyframe {
            time,
            translation,
            rotation_deg: 0.0,
        });
    }
}
