//! Bodies that were let through a cloth which they left no room.

use std::collections::{BTreeMap, BTreeSet};

use selvedge_cloth::Scene;
use selvedge_sim::YieldedContact;
use serde::Serialize;

/// A body that was let through the cloth because it and something else left that no room.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LetThrough {
    /// Name of the obstacle.
    pub obstacle: String,
    /// Name of the obstacle against which it pressed the cloth, which may be the same; none where
    /// it met a handle, or cloth that could not yield.
    pub against: Option<String>,
    /// Vertices that were let through.
    pub vertices: usize,
    /// First and last frame.
    pub frames: [usize; 2],
    /// Vertices in each frame from the first to the last.
    pub per_frame: Vec<usize>,
}

impl std::fmt::Display for LetThrough {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            obstacle, vertices, ..
        } = self;
        let [from, to] = self.frames;
        match &self.against {
            Some(other) if other == obstacle => {
                write!(f, "obstacle {obstacle:?} passes through itself")?;
            }
            Some(other) => write!(f, "obstacles {obstacle:?} and {other:?} squeeze the cloth")?,
            None => write!(f, "obstacle {obstacle:?} presses cloth that cannot yield")?,
        }
        let plural = if *vertices == 1 { "vertex" } else { "vertices" };
        write!(
            f,
            ": {obstacle:?} was let through at {vertices} {plural}, frames {from} to {to}"
        )
    }
}

/// The bodies that were let through in a run, by the obstacles that pressed the cloth.
pub fn let_through(scene: &Scene, yielded: &[YieldedContact]) -> Vec<LetThrough> {
    let name = |body: u32| {
        let number = (body as usize).checked_sub(1)?;
        scene.obstacles.get(number).map(|o| o.name().to_owned())
    };
    let mut pairs: BTreeMap<[u32; 2], Vec<&YieldedContact>> = BTreeMap::new();
    for one in yielded {
        let pair = [one.released.body, one.released.against];
        pairs.entry(pair).or_default().push(one);
    }
    let of = |([body, against], all): ([u32; 2], Vec<&YieldedContact>)| {
        let vertices = |frame: Option<usize>| {
            let now = |one: &&&YieldedContact| {
                frame.is_none_or(|f| (one.frames[0]..=one.frames[1]).contains(&f))
            };
            let numbers = all.iter().filter(now).map(|one| one.released.vertex);
            numbers.collect::<BTreeSet<_>>().len()
        };
        let from = all.iter().map(|one| one.frames[0]).min()?;
        let to = all.iter().map(|one| one.frames[1]).max()?;
        Some(LetThrough {
            obstacle: name(body)?,
            against: name(against),
            vertices: vertices(None),
            frames: [from, to],
            per_frame: (from..=to).map(|frame| vertices(Some(frame))).collect(),
        })
    };
    pairs.into_iter().filter_map(of).collect()
}
