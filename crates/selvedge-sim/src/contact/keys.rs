//! Names of pairs and of what touches, in an order that does not depend on the search.

use selvedge_cloth::Touching;
use selvedge_contact::{Kind, Pair};

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
