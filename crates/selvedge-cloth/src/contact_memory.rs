//! What one substep leaves for the next. Nouns of saved states; the laws are in `selvedge-sim`.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::Rigid;

/// All that a run needs to go on bit for bit after a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Frames of the motion that have passed.
    pub frame: usize,
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
    /// The state one substep ago, which a run of second order looks back to; without it the next
    /// substep starts anew.
    pub previous: Option<PreviousSubstep>,
    /// Changes of velocity of the last solve `[m/s]`, `[vertices]`, and the time over which they
    /// came about `[s]`: conjugate gradients begin from them.
    pub changes: Option<(Vec<DVec3>, f64)>,
    /// What contact left for the next substep.
    pub contact: Option<ContactMemory>,
    /// Motions of the first obstacles away from their own paths, which no file has; the others stay where
    /// they are.
    pub obstacles: Vec<Rigid>,
}

impl Checkpoint {
    /// Positions `[m]` and velocities `[m/s]`, `[vertices]`, after `frame` frames, and no more.
    pub fn of(frame: usize, positions: Vec<DVec3>, velocities: Vec<DVec3>) -> Self {
        Self {
            frame,
            positions,
            velocities,
            ..Self::default()
        }
    }

    /// At `positions` `[m]`, `[vertices]`, without velocity, before the motion begins.
    pub fn at_rest(positions: Vec<DVec3>) -> Self {
        let velocities = vec![DVec3::ZERO; positions.len()];
        Self::of(0, positions, velocities)
    }
}

/// The state of a cloth one substep ago.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PreviousSubstep {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
    /// Length of the substep that led from there `[s]`.
    pub seconds: f64,
}

/// State of contact beside positions and velocities, which one substep leaves for the next. A run
/// with contact goes on bit for bit only with it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactMemory {
    /// Friction that features have left.
    pub anchors: Vec<FrictionAnchor>,
    /// Features that push.
    pub pushing: Vec<Pushing>,
    /// Pairs that a solve had missed. They push on, whatever else is near.
    pub caught: Vec<CaughtPair>,
    /// Contact that is released where bodies squeeze the cloth.
    pub released: Vec<ReleasedContact>,
    /// Where each vertex has stayed, and since when, `[vertices]`; empty where the cloth moves.
    pub still: Vec<Still>,
}

/// A place about which a vertex has stayed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Still {
    /// The frame in which it came there.
    pub since: u32,
    /// The place `[m]`.
    pub place: DVec3,
}

/// Contact of a vertex of the cloth with a body that is released: no feature with this vertex meets
/// that body. Bodies are numbered from 1, in the order of the obstacles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReleasedContact {
    /// Number of the vertex.
    pub vertex: u32,
    /// The body that it may pass.
    pub body: u32,
    /// The body against which that one pressed it; 0 where a handle held it, or it is not known.
    /// Where it is the same body, only the connected part is passed that is the first of `parts`;
    /// and where that pressed it against itself, only what is nearer to the first of `places` than
    /// to the second when the scene begins.
    pub against: u32,
    /// Connected parts of the two bodies, as their surface numbers them.
    pub parts: [u32; 2],
    /// The two places between which the vertex was, where they are when the scene begins `[m]`.
    pub places: [DVec3; 2],
    /// Winding number of the body around the vertex at the release: it is on the outer side again
    /// when that is about the same.
    pub winding: f64,
}

/// Friction that a feature has left, and what presses it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrictionAnchor {
    /// The feature, at a whole body where it is a vertex.
    pub of: Touching,
    /// Unit direction of the gap.
    pub normal: DVec3,
    /// Force along the surface `[N]`.
    pub pull: DVec3,
    /// Compression up to which the fabric bears, as a part of the thickness; below 0 while what lies there has not
    /// lain still for long.
    #[serde(default)]
    pub pressed: f64,
}

/// A pair that a solve had missed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaughtPair {
    /// A vertex or a point of an obstacle and a face, or two edges.
    pub of: Touching,
    /// Gap at which its push has to be linearised `[m]`; none where the usual one serves.
    pub gap: Option<f64>,
}

/// A feature that pushes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Pushing {
    /// The feature, at a whole body where it is a vertex.
    pub of: Touching,
    /// True if it bears more than a little, or is expected to.
    pub firmly: bool,
}

/// Two features that touch, by their numbers among those of the cloth and all obstacles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Touching {
    /// A vertex, and a face or a body; body 0 is the cloth.
    Vertex {
        /// Number of the vertex.
        vertex: u32,
        /// Number of the face or of the body.
        other: u32,
    },
    /// Two edges.
    Edges {
        /// Number of the first.
        first: u32,
        /// Number of the second.
        second: u32,
    },
}

impl Touching {
    /// As three numbers: 0 for a vertex or 1 for edges, then those of the features.
    pub fn numbers(self) -> [u32; 3] {
        match self {
            Self::Vertex { vertex, other } => [0, vertex, other],
            Self::Edges { first, second } => [1, first, second],
        }
    }

    /// Of the three numbers that [`Self::numbers`] gives; none where the first is neither 0 nor 1.
    pub fn of_numbers(numbers: [u32; 3]) -> Option<Self> {
        let [kind, first, second] = numbers;
        match kind {
            0 => Some(Self::Vertex {
                vertex: first,
                other: second,
            }),
            1 => Some(Self::Edges { first, second }),
            _ => None,
        }
    }
}
