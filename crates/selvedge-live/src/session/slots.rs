//! The slots of a session: three places from which every page takes the latest cloth, state and
//! frame, and the last notice.

use std::time::Duration;

use bytes::Bytes;
use tokio::sync::watch;
use web_time::Instant;

use crate::state::{Level, Notice};

/// A message with the generation of the cloth that it belongs to.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slot {
    pub(crate) generation: u32,
    pub(crate) number: u32,
    pub(crate) bytes: Bytes,
}

/// The ends of the slots that pages read.
#[derive(Clone)]
pub(crate) struct SlotReaders {
    pub(crate) cloth: watch::Receiver<Slot>,
    pub(crate) state: watch::Receiver<Slot>,
    pub(crate) frame: watch::Receiver<Slot>,
}

/// The time between two states while nothing happens.
pub(super) const TELL_EVERY: Duration = Duration::from_millis(200);

/// The ends of the slots that the session writes.
pub(crate) struct SlotWriters {
    cloth: watch::Sender<Slot>,
    state: watch::Sender<Slot>,
    frame: watch::Sender<Slot>,
    generation: u32,
    frames: u32,
    notice: Option<Notice>,
    reported: Instant,
    tell_soon: bool,
}

impl SlotWriters {
    /// Empty slots, and the ends to read them from.
    pub(crate) fn new() -> (Self, SlotReaders) {
        let slot = || watch::channel(Slot::default());
        let ((cloth, cloth_out), (state, state_out), (frame, frame_out)) = (slot(), slot(), slot());
        let writers = Self {
            cloth,
            state,
            frame,
            generation: 0,
            frames: 0,
            notice: None,
            reported: Instant::now(),
            tell_soon: true,
        };
        let readers = SlotReaders {
            cloth: cloth_out,
            state: state_out,
            frame: frame_out,
        };
        (writers, readers)
    }

    /// The number of the cloth that is shown; 0 before the first.
    pub(super) fn generation(&self) -> u32 {
        self.generation
    }

    /// The last notice.
    pub(super) fn notice(&self) -> Option<&Notice> {
        self.notice.as_ref()
    }

    /// Publishes another cloth, of a new generation.
    pub(crate) fn publish_cloth(&mut self, message: impl FnOnce(u32) -> Vec<u8>) {
        self.generation += 1;
        let bytes = message(self.generation).into();
        self.cloth.send_replace(self.slot(0, bytes));
        self.tell_soon = true;
    }

    /// Publishes a frame of this generation, made from generation and number.
    pub(crate) fn publish_frame(&mut self, message: impl FnOnce(u32, u32) -> Vec<u8>) {
        self.frames = self.frames.wrapping_add(1);
        let bytes = message(self.generation, self.frames).into();
        self.frame.send_replace(self.slot(self.frames, bytes));
    }

    pub(super) fn publish_state(&mut self, message: Vec<u8>) {
        self.reported = Instant::now();
        self.tell_soon = false;
        self.state.send_replace(self.slot(0, message.into()));
    }

    /// Asks for a state to be published at the next occasion.
    pub(super) fn tell_soon(&mut self) {
        self.tell_soon = true;
    }

    /// Returns true when a state is due.
    pub(super) fn is_state_due(&self) -> bool {
        self.tell_soon || self.reported.elapsed() >= TELL_EVERY
    }

    /// Sets the notice.
    pub(super) fn notify(&mut self, level: Level, text: impl Into<String>) {
        let number = self.notice.as_ref().map_or(1, |notice| notice.number + 1);
        self.notice = Some(Notice {
            number,
            level,
            text: shortened(text.into()),
        });
        self.tell_soon = true;
    }

    fn slot(&self, number: u32, bytes: Bytes) -> Slot {
        Slot {
            generation: self.generation,
            number,
            bytes,
        }
    }
}

/// Bytes that a notice has at most: it stands on a page, and may quote what somebody sent.
const LONGEST_NOTICE: usize = 600;

/// A text of at most [`LONGEST_NOTICE`] bytes, with a mark where it is cut.
fn shortened(mut text: String) -> String {
    if text.len() > LONGEST_NOTICE {
        text.truncate(text.floor_char_boundary(LONGEST_NOTICE - "…".len()));
        text.push('…');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notices_are_short() {
        assert_eq!(shortened("as it is".to_owned()), "as it is");
        let cut = shortened("é".repeat(5000));
        assert!(cut.len() <= LONGEST_NOTICE && cut.ends_with("é…"), "{cut}");
    }
}
