//! The memory that one substep leaves for the next, a [`ContactMemory`] whose lists are in ascending
//! order; names of pairs and of what touches, in an order that does not depend on the search.
//!
//! What pushes is named without the face that it pushes against: a vertex that slides over an edge is
//! held by the same body. It is in the list as often as it pushes. A pair that pushed too little in
//! two substeps in a row is caught, and begins the next one with the gap of the tangent that it
//! needed: without, every substep at rest finds it anew, by solving once more.

use selvedge_cloth::{CaughtPair, ContactMemory, Pushing, Touching};
use selvedge_contact::{Kind, Pair};

/// A saved memory, whose lists may be in any order.
pub(crate) fn of_saved(mut memory: ContactMemory) -> ContactMemory {
    memory.anchors.sort_by_key(|anchor| anchor.of);
    sort(&mut memory.pushing);
    memory.caught.sort_by_key(|caught| caught.of);
    memory
}

/// Of a feature that pushes several times those come first that push firmly.
pub(super) fn sort(pushing: &mut [Pushing]) {
    pushing.sort_unstable_by_key(|one| (one.of, !one.firmly));
}

/// Returns true if something begins to push firmly, or ends while it did; both in order.
pub(super) fn jumps(before: &[Pushing], now: &[Pushing]) -> bool {
    let includes = |all: &[Pushing], part: &[Pushing]| {
        let mut all = all.iter();
        let mut firm = part.iter().filter(|own| own.firmly);
        firm.all(|own| all.any(|other| other.of == own.of))
    };
    !includes(before, now) || !includes(now, before)
}

/// What is known of a pair that was caught.
pub(super) fn caught(all: &[CaughtPair], pair: Touching) -> Option<CaughtPair> {
    let found = all.binary_search_by_key(&pair, |caught| caught.of);
    found.ok().map(|k| all[k])
}

/// Takes pairs that a solve missed, in place of what was known of them.
pub(super) fn catch(all: &mut Vec<CaughtPair>, pairs: Vec<CaughtPair>) {
    all.splice(0..0, pairs);
    all.sort_by_key(|caught| caught.of);
    all.dedup_by_key(|caught| caught.of);
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
/// of its faces it meets, or two edges. A round body's core meets many faces, each for itself.
pub(super) fn feature(pair: &Pair, body: usize, is_of_core: bool) -> Touching {
    match pair.kind {
        Kind::VertexFace if !is_of_core => Touching::Vertex {
            vertex: pair.first,
            other: body as u32,
        },
        _ => key(pair),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_firm_push_that_begins_or_ends_is_a_jump() {
        let push = |firmly| Pushing {
            of: Touching::Edges {
                first: 1,
                second: 2,
            },
            firmly,
        };
        let (soft, firm) = (push(false), push(true));
        let cases: [(&[Pushing], &[Pushing], bool); 6] = [
            (&[], &[soft], false),
            (&[soft], &[firm], false),
            (&[], &[firm], true),
            (&[firm, soft], &[firm], false),
            (&[firm, firm], &[firm], true),
            (&[firm], &[firm, firm], true),
        ];
        for (before, now, expected) in cases {
            assert_eq!(jumps(before, now), expected, "{before:?} {now:?}");
        }
    }
}
