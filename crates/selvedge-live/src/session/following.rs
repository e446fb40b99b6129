//! A motion that the handles follow, and how far they are along it.

use selvedge_cloth::HandlePath;

use crate::state::MotionState;

/// A motion that the handles follow, or will as soon as they have come to rest.
pub(super) struct Following {
    pub(super) name: String,
    /// The path of the handles; unknown while they brake.
    pub(super) path: Option<HandlePath>,
    pub(super) place: PlaceOnPath,
}

/// How far handles are along a path.
#[derive(Clone, Default)]
pub(super) struct PlaceOnPath {
    pub(super) frame: usize,
    /// The handles that were let go in the last frame, `[handles]`; empty before the first.
    pub(super) free: Vec<bool>,
}

impl Following {
    /// The motion `name` from `frame` on, along `path` if that is known.
    pub(super) fn new(name: String, path: Option<HandlePath>, frame: usize) -> Self {
        let place = PlaceOnPath {
            frame,
            free: Vec::new(),
        };
        Self { name, path, place }
    }

    /// The description that pages get.
    pub(super) fn state(&self) -> MotionState {
        let frames = self.path.as_ref().map(HandlePath::frame_count);
        MotionState {
            name: self.name.clone(),
            frame: self.place.frame,
            frames: frames.unwrap_or(0),
        }
    }

    /// True where the motion has come to its end.
    pub(super) fn is_over(&self) -> bool {
        let path = self.path.as_ref();
        path.is_some_and(|path| self.place.frame >= path.frame_count())
    }
}
