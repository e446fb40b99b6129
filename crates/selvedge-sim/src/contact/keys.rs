//! Names of pairs and of what touches, in an order that does not depend on the search.

use selvedge_contact::{Kind, Pair};

/// Returns true if `all` has every entry of `part`, as often; both in ascending order.
pub(super) fn includes(all: &[Key], part: &[Key]) -> bool {
    let mut all = all.iter();
    part.iter().all(|own| all.any(|other| other == own))
}

/// Kind and numbers of a pair.
pub(super) type Key = (Kind, u32, u32);

pub(super) fn key(pair: &Pair) -> Key {
    (pair.kind, pair.first, pair.second)
}

/// The features of a pair that go on from substep to substep: a vertex at the other body, whichever
/// of its faces it meets, or two edges.
pub(super) fn feature(pair: &Pair, body: usize) -> Key {
    match pair.kind {
        Kind::VertexFace => (pair.kind, pair.first, body as u32),
        Kind::EdgeEdge => key(pair),
    }
}
