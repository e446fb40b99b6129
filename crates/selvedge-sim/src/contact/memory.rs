//! The memory that one substep leaves for the next, and as a noun that a file of states has; names of
//! pairs and of what touches, in an order that does not depend on the search.

use selvedge_cloth::{
    CaughtPair, ContactMemory, FrictionAnchor, Pushing, ReleasedContact, Touching,
};
use selvedge_contact::{Kind, Pair};

/// State that one substep leaves for the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Memory {
    /// In ascending order of their features.
    pub(super) anchors: Vec<FrictionAnchor>,
    /// Features that pushed, in ascending order.
    pub(super) held: Held,
    /// Those of them that a solve had missed: they push on, whatever else is near. In ascending
    /// order. A pair that pushed too little in two substeps in a row begins the next one with the gap
    /// of the tangent that it needed: without, every substep at rest finds it anew, by solving once
    /// more.
    pub(super) caught: Vec<CaughtPair>,
    /// Contact that is released, in the order of the candidates.
    pub(super) released: Vec<ReleasedContact>,
}

/// Features that push, without the faces that they push against: a vertex that slides over an edge
/// is held by the same body. Each in ascending order, as often as it pushes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Held {
    pub(super) all: Vec<Touching>,
    /// Those that bear more than a little, or are expected to.
    pub(super) firmly: Vec<Touching>,
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
        let entry = |of: &Touching| Pushing {
            of: *of,
            firmly: firmly.next_if_eq(&of).is_some(),
        };
        self.all.iter().map(entry).collect()
    }
}

impl Memory {
    /// What is known of a pair that was caught.
    pub(super) fn caught(&self, pair: Touching) -> Option<CaughtPair> {
        let found = self.caught.binary_search_by_key(&pair, |caught| caught.of);
        found.ok().map(|k| self.caught[k])
    }

    /// Takes pairs that a solve missed, in place of what was known of them.
    pub(super) fn catch(&mut self, pairs: Vec<CaughtPair>) {
        self.caught.splice(0..0, pairs);
        self.caught.sort_by_key(|caught| caught.of);
        self.caught.dedup_by_key(|caught| caught.of);
    }

    /// Forgets that a pair was caught.
    pub(super) fn let_go(&mut self, pair: Touching) {
        self.caught.retain(|caught| caught.of != pair);
    }

    /// As a noun.
    pub(crate) fn saved(&self) -> ContactMemory {
        ContactMemory {
            anchors: self.anchors.clone(),
            pushing: self.held.entries(),
            caught: self.caught.clone(),
            released: self.released.clone(),
        }
    }

    /// Of such a noun, in any order.
    pub(crate) fn of_saved(saved: &ContactMemory) -> Self {
        let mut anchors = saved.anchors.clone();
        anchors.sort_by_key(|anchor| anchor.of);
        let firmly = saved.pushing.iter().filter(|pushing| pushing.firmly);
        let mut held = Held {
            all: saved.pushing.iter().map(|pushing| pushing.of).collect(),
            firmly: firmly.map(|pushing| pushing.of).collect(),
        };
        held.sort();
        let mut caught = saved.caught.clone();
        caught.sort_by_key(|caught| caught.of);
        Self {
            anchors,
            held,
            caught,
            released: saved.released.clone(),
        }
    }
}

/// Returns true if `all` has every entry of `part`, as often; both in ascending order.
pub(super) fn includes(all: &[Touching], part: &[Touching]) -> bool {
    let mut all = all.iter();
    part.iter().all(|own| all.any(|other| other == own))
}

/// Kind and numbers of a pair.
pub(super) fn key(pair: &Pair) -> Touching {
    let (first, second) = (pair.first, pair.second);
    match pair.kind {
        Kind::VertexFace => Touching::Vertex {
            vertex: first,
            other: second,
        },
        Kind::EdgeEdge => Touching::Edges { first, second },
    }
}

/// The features of a pair that go on from substep to substep: a vertex at the other body, whichever
/// of its faces it meets, or two edges.
pub(super) fn feature(pair: &Pair, body: usize) -> Touching {
    match pair.kind {
        Kind::VertexFace => Touching::Vertex {
            vertex: pair.first,
            other: body as u32,
        },
        Kind::EdgeEdge => key(pair),
    }
}
