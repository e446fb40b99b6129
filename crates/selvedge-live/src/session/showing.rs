//! The cloth or the recording that a session shows.

use selvedge_cloth::Cloth;

use crate::body::Body;
use crate::hand::Hands;
use crate::live_cloth::LiveCloth;
use crate::pace::DEFAULT_FRAME_RATE;
use crate::player::Player;
use crate::protocol::FrameParts;
use crate::state::{Show, TrackState};

/// The shown cloth or recording: nothing before the first. The modes of a session are told apart
/// here and nowhere else.
#[derive(Default)]
pub(super) struct Showing {
    /// The recording that is played.
    pub(super) player: Option<Player>,
    /// The cloth that moves; it waits while a recording hides it.
    pub(super) live: Option<LiveCloth>,
}

impl Showing {
    /// Returns true where the next frame differs from the present one.
    pub(super) fn is_moving(&self) -> bool {
        self.player.is_some() || self.live.as_ref().is_some_and(LiveCloth::is_moving)
    }

    /// The constant part of the cloth.
    pub(super) fn cloth(&self) -> Option<&Cloth> {
        match (&self.player, &self.live) {
            (Some(player), _) => Some(player.replay().first().cloth()),
            (None, live) => live.as_ref().map(|live| &*live.ready().cloth),
        }
    }

    /// The bodies beside it.
    pub(super) fn bodies(&self) -> Vec<Body> {
        match (&self.player, &self.live) {
            (Some(player), _) => Body::of_recording(player.replay().first()),
            (None, Some(live)) => live.ready().bodies.clone(),
            (None, None) => Vec::new(),
        }
    }

    /// Returns true where the cloth that moves has bodies to touch.
    pub(super) fn has_bodies(&self) -> bool {
        let live = self.live.as_ref();
        live.is_some_and(|live| !live.ready().bodies.is_empty())
    }

    /// Smallest gap of each vertex of each cloth that moves `[m]`, `[tracks][vertices]`.
    pub(super) fn gaps(&self) -> Vec<Vec<f32>> {
        match (&self.player, &self.live) {
            (None, Some(live)) => live.gaps(),
            _ => Vec::new(),
        }
    }

    /// Frames per second.
    pub(super) fn frame_rate(&self) -> f64 {
        match (&self.player, &self.live) {
            (Some(player), _) => player.replay().first().frame_rate(),
            (None, Some(live)) => live.ready().frame_rate,
            (None, None) => DEFAULT_FRAME_RATE,
        }
    }

    /// The parts of the frame that is shown, without numbers, drag and gaps; the cloth goes after
    /// `hands`.
    pub(super) fn frame(&self, hands: &Hands) -> Option<FrameParts<'_>> {
        let (frame, handles, goals, tracks, bodies) = match (&self.player, &self.live) {
            (Some(player), _) => {
                let (handles, tracks) = (player.replay().first().handles(), player.positions());
                let goals = handles.of(tracks[0]).map(|p| p.as_dvec3()).collect();
                (player.frame(), handles, goals, tracks, player.body_points())
            }
            (None, Some(live)) => {
                let (handles, tracks) = (&live.influences().handles, live.positions());
                let bodies = live.body_points();
                (live.frame(), handles, hands.goals(), tracks, bodies)
            }
            (None, None) => return None,
        };
        let vertices = handles.vertices().iter().map(|v| v.0);
        Some(FrameParts {
            time: frame as f64 / self.frame_rate(),
            goals: vertices.zip(goals).collect(),
            tracks,
            bodies,
            ..FrameParts::default()
        })
    }

    /// The description that pages get.
    pub(super) fn show(&self) -> Show {
        match (&self.player, &self.live) {
            (Some(player), _) => player.show(),
            (None, Some(_)) => Show::Live,
            (None, None) => Show::Nothing,
        }
    }

    /// The state of each cloth that is shown.
    pub(super) fn tracks(&self) -> Vec<TrackState> {
        match (&self.player, &self.live) {
            (Some(player), _) => player.tracks(),
            (None, Some(live)) => live.tracks(),
            (None, None) => Vec::new(),
        }
    }
}
