//! The memory that one substep leaves for the next, and as a noun that a file of states has.

use glam::DVec3;
use selvedge_cloth::{
    CaughtPair, ContactMemory, FrictionAnchor, Pushing, ReleasedContact, Touching,
};
use selvedge_contact::Kind;

use super::keys::{Key, includes};

/// Friction that a feature has left from the substep before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Anchor {
    pub(super) of: Key,
    pub(super) normal: DVec3,
    /// Force along the surface `[N]`.
    pub(super) pull: DVec3,
}

/// A pair that a solve had missed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Caught {
    pub(super) pair: Key,
    /// Gap of the tangent that it needed `[m]`, of a pair that pushed too little in two substeps in
    /// a row: it begins the next one with that. Without, every substep at rest finds it anew, by
    /// solving once more.
    pub(super) gap: Option<f64>,
}

/// State that one substep leaves for the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Memory {
    /// In ascending order of their features.
    pub(super) anchors: Vec<Anchor>,
    /// Features that pushed, in ascending order.
    pub(super) held: Held,
    /// Those of them that a solve had missed: they push on, whatever else is near. In ascending
    /// order.
    pub(super) caught: Vec<Caught>,
    /// Contact that is released, in the order of the candidates.
    pub(super) released: Vec<ReleasedContact>,
}

/// Features that push, without the faces that they push against: a vertex that slides over an edge
/// is held by the same body. Each in ascending order, as often as it pushes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Held {
    pub(super) all: Vec<Key>,
    /// Those that bear more than a little, or are expected to.
    pub(super) firmly: Vec<Key>,
}

impl Held {
    /// Returns true if something begins to push firmly, or ends while it did.
    pub(super) fn jumps_to(&self, next: &Self) -> bool {
        !includes(&self.all, &next.firmly) || !includes(&next.all, &self.firmly)
    }

    pub(super) fn sort(&mut self) {
        self.all.sort_unstable();
        self.firmly.sort_unstable();
    }

    /// As entries: of a feature that pushes several times as many are firm as push firmly.
    fn entries(&self) -> Vec<Pushing> {
        let mut firmly = self.firmly.iter().peekable();
        let entry = |of: &Key| Pushing {
            of: touching(*of),
            firmly: firmly.next_if_eq(&of).is_some(),
        };
        self.all.iter().map(entry).collect()
    }
}

impl Memory {
    /// What is known of a pair that was caught.
    pub(super) fn caught(&self, pair: Key) -> Option<Caught> {
        let found = self
            .caught
            .binary_search_by_key(&pair, |caught| caught.pair);
        found.ok().map(|k| self.caught[k])
    }

    /// Takes pairs that a solve missed, in place of what was known of them.
    pub(super) fn catch(&mut self, pairs: Vec<Caught>) {
        self.caught.splice(0..0, pairs);
        self.caught.sort_by_key(|caught| caught.pair);
        self.caught.dedup_by_key(|caught| caught.pair);
    }

    /// Forgets that a pair was caught.
    pub(super) fn let_go(&mut self, pair: Key) {
        self.caught.retain(|caught| caught.pair != pair);
    }

    /// As a noun.
    pub(crate) fn saved(&self) -> ContactMemory {
        let anchor = |anchor: &Anchor| FrictionAnchor {
            of: touching(anchor.of),
            normal: anchor.normal,
            pull: anchor.pull,
        };
        let caught = |caught: &Caught| CaughtPair {
            of: touching(caught.pair),
            gap: caught.gap,
        };
        ContactMemory {
            anchors: self.anchors.iter().map(anchor).collect(),
            pushing: self.held.entries(),
            caught: self.caught.iter().map(caught).collect(),
            released: self.released.clone(),
        }
    }

    /// Of such a noun, in any order.
    pub(crate) fn of_saved(saved: &ContactMemory) -> Self {
        let anchor = |anchor: &FrictionAnchor| Anchor {
            of: key_of(anchor.of),
            normal: anchor.normal,
            pull: anchor.pull,
        };
        let mut anchors: Vec<Anchor> = saved.anchors.iter().map(anchor).collect();
        anchors.sort_by_key(|anchor| anchor.of);
        let of = |pushing: &Pushing| key_of(pushing.of);
        let firmly = saved.pushing.iter().filter(|pushing| pushing.firmly);
        let mut held = Held {
            all: saved.pushing.iter().map(of).collect(),
            firmly: firmly.map(of).collect(),
        };
        held.sort();
        let caught = |caught: &CaughtPair| Caught {
            pair: key_of(caught.of),
            gap: caught.gap,
        };
        let mut caught: Vec<Caught> = saved.caught.iter().map(caught).collect();
        caught.sort_by_key(|caught| caught.pair);
        Self {
            anchors,
            held,
            caught,
            released: saved.released.clone(),
        }
    }
}

fn touching(key: Key) -> Touching {
    let (kind, first, second) = key;
    match kind {
        Kind::VertexFace => Touching::Vertex {
            vertex: first,
            other: second,
        },
        Kind::EdgeEdge => Touching::Edges { first, second },
    }
}

fn key_of(touching: Touching) -> Key {
    match touching {
        Touching::Vertex { vertex, other } => (Kind::VertexFace, vertex, other),
        Touching::Edges { first, second } => (Kind::EdgeEdge, first, second),
    }
}
