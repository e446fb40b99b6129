//! The cloth or the recording that a session shows.

use std::mem;

use glam::{DVec3, Vec3};
use selvedge_cloth::{Cloth, Handles};

use crate::body::Body;
use crate::hand::Hands;
use crate::live_cloth::LiveCloth;
use crate::pace::DEFAULT_FRAME_RATE;
use crate::player::Player;
use crate::state::{Show, TrackState};

/// The shown cloth or recording. The modes of a session are told apart here and nowhere else.
#[derive(Default)]
pub(super) enum Showing {
    /// Nothing yet: the first cloth is being made ready.
    #[default]
    Nothing,
    /// A cloth that moves.
    Live(LiveCloth),
    /// A recording, and the cloth that waits meanwhile.
    Tape(Player, Option<LiveCloth>),
}

pub(super) struct ShownFrame<'a> {
    /// Frames since the start.
    pub(super) number: usize,
    pub(super) handles: &'a Handles,
    /// The places where the handles are wanted `[m]`, `[handles]`.
    pub(super) goals: Vec<DVec3>,
    /// `[tracks][vertices]` `[m]`.
    pub(super) positions: Vec<&'a [Vec3]>,
    /// Points of all bodies `[m]`.
    pub(super) bodies: Vec<Vec3>,
}

impl Showing {
    /// The cloth that moves, also while a recording hides it.
    pub(super) fn live(&self) -> Option<&LiveCloth> {
        match self {
            Self::Nothing => None,
            Self::Live(live) => Some(live),
            Self::Tape(_, waiting) => waiting.as_ref(),
        }
    }

    pub(super) fn live_mut(&mut self) -> Option<&mut LiveCloth> {
        match self {
            Self::Nothing => None,
            Self::Live(live) => Some(live),
            Self::Tape(_, waiting) => waiting.as_mut(),
        }
    }

    /// The recording that is played.
    pub(super) fn player(&self) -> Option<&Player> {
        match self {
            Self::Tape(player, _) => Some(player),
            Self::Nothing | Self::Live(_) => None,
        }
    }

    pub(super) fn player_mut(&mut self) -> Option<&mut Player> {
        match self {
            Self::Tape(player, _) => Some(player),
            Self::Nothing | Self::Live(_) => None,
        }
    }

    /// Puts a recording before the cloth, which waits.
    pub(super) fn play(&mut self, player: Player) {
        *self = match mem::take(self) {
            Self::Nothing => Self::Tape(player, None),
            Self::Live(live) => Self::Tape(player, Some(live)),
            Self::Tape(_, waiting) => Self::Tape(player, waiting),
        };
    }

    /// Puts the recording away. Returns whether there was one.
    pub(super) fn stop_playing(&mut self) -> bool {
        let was_playing = self.player().is_some();
        *self = match mem::take(self) {
            Self::Tape(_, Some(live)) | Self::Live(live) => Self::Live(live),
            Self::Tape(_, None) | Self::Nothing => Self::Nothing,
        };
        was_playing
    }

    /// Returns true where the next frame differs from the present one.
    pub(super) fn is_moving(&self) -> bool {
        match self {
            Self::Nothing => false,
            Self::Live(live) => live.is_moving(),
            Self::Tape(..) => true,
        }
    }

    /// The constant part of the cloth.
    pub(super) fn cloth(&self) -> Option<&Cloth> {
        match self {
            Self::Nothing => None,
            Self::Live(live) => Some(live.ready().cloth()),
            Self::Tape(player, _) => Some(player.tape().first().cloth()),
        }
    }

    /// The bodies beside it.
    pub(super) fn bodies(&self) -> Vec<Body> {
        match self {
            Self::Nothing => Vec::new(),
            Self::Live(live) => live.ready().bodies().to_vec(),
            Self::Tape(player, _) => Body::of_recording(player.tape().first()),
        }
    }

    /// Returns true where the cloth that moves has bodies to touch.
    pub(super) fn has_bodies(&self) -> bool {
        self.live()
            .is_some_and(|live| !live.ready().bodies().is_empty())
    }

    /// Smallest gap of each vertex of each cloth that moves `[m]`, `[tracks][vertices]`.
    pub(super) fn gaps(&self) -> Vec<Vec<f32>> {
        match self {
            Self::Live(live) => live.gaps(),
            Self::Nothing | Self::Tape(..) => Vec::new(),
        }
    }

    /// Frames per second.
    pub(super) fn frame_rate(&self) -> f64 {
        match self {
            Self::Nothing => DEFAULT_FRAME_RATE,
            Self::Live(live) => live.ready().frame_rate(),
            Self::Tape(player, _) => player.tape().first().frame_rate(),
        }
    }

    /// The frame that is shown; the cloth goes after `hands`.
    pub(super) fn frame(&self, hands: &Hands) -> Option<ShownFrame<'_>> {
        match self {
            Self::Nothing => None,
            Self::Live(live) => Some(ShownFrame {
                number: live.frame(),
                handles: &live.hold().handles,
                goals: hands.goals(),
                positions: live.positions(),
                bodies: live.body_points(),
            }),
            Self::Tape(player, _) => {
                let handles = player.tape().first().handles();
                let positions = player.positions();
                let goals = handles.select(positions[0]);
                Some(ShownFrame {
                    number: player.frame(),
                    handles,
                    goals: goals.iter().map(|p| p.as_dvec3()).collect(),
                    positions,
                    bodies: player.body_points(),
                })
            }
        }
    }

    /// The description that pages get.
    pub(super) fn show(&self) -> Show {
        match self {
            Self::Nothing => Show::Nothing,
            Self::Live(_) => Show::Live,
            Self::Tape(player, _) => player.show(),
        }
    }

    /// The state of each cloth that is shown.
    pub(super) fn tracks(&self) -> Vec<TrackState> {
        match self {
            Self::Nothing => Vec::new(),
            Self::Live(live) => live.tracks(),
            Self::Tape(player, _) => player.tracks(),
        }
    }
}
