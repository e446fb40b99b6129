//! The feed of one page: the latest of everything, as fast as the page takes it up.
//!
//! A page says of each frame when it has taken it up; while [`AHEAD`] frames are on their way no
//! other is sent, so that a slow page skips frames and never falls behind.

use bytes::Bytes;

use super::SlotReaders;

/// Frames on their way to a page at most.
pub(crate) const AHEAD: u32 = 3;

/// What a page has got of a session.
pub(crate) struct Feed {
    pub(crate) readers: SlotReaders,
    /// The generation of the cloth that it has.
    shown: u32,
    /// Frames that it has not answered yet.
    on_the_way: u32,
}

impl Feed {
    /// The feed of a page that has nothing yet.
    pub(crate) fn new(mut readers: SlotReaders) -> Self {
        readers.state.mark_changed();
        readers.frame.mark_changed();
        Self {
            readers,
            shown: 0,
            on_the_way: 0,
        }
    }

    /// Returns true where the page may be sent another frame.
    pub(crate) fn has_room(&self) -> bool {
        self.on_the_way < AHEAD
    }

    /// The page has taken up a frame. Returns false where none was on its way.
    pub(crate) fn answered(&mut self) -> bool {
        let was_sent = self.on_the_way > 0;
        self.on_the_way = self.on_the_way.saturating_sub(1);
        was_sent
    }

    /// The latest state; none where the session has not said anything yet.
    pub(crate) fn state(&mut self) -> Option<Bytes> {
        let bytes = self.readers.state.borrow_and_update().bytes.clone();
        (!bytes.is_empty()).then_some(bytes)
    }

    /// The latest frame, if there is one, and before it the cloth where the page has another.
    pub(crate) fn frame(&mut self) -> Vec<Bytes> {
        let frame = self.readers.frame.borrow_and_update().clone();
        let mut messages = Vec::new();
        if frame.number > 0 && frame.generation != self.shown {
            let cloth = self.readers.cloth.borrow_and_update().clone();
            self.shown = cloth.generation;
            messages.push(cloth.bytes);
        }
        // The cloth may have changed once more since: its own frame is to come.
        if frame.number > 0 && frame.generation == self.shown {
            self.on_the_way += 1;
            messages.push(frame.bytes);
        }
        messages
    }
}
