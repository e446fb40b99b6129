//! A session without threads or sockets, for one page in the same process: the page's worker drives
//! it and carries its messages.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

use selvedge_cloth::HandleTargets;
use tokio::sync::watch;
use web_time::Instant;

use super::{Feed, Opening, Request, Session, SlotWriters};
use crate::order::{Catalogue, Order};
use crate::protocol::{self, ClientMessage, WireError};
use crate::recorder::Destination;
use crate::workshop::Workshop;

/// The number of the only page.
const PAGE: u32 = 1;

/// Frames that a cloth takes before its first one, and the longest time for them.
const WARM_UP: usize = 12;
const LONGEST_WARM_UP: Duration = Duration::from_millis(300);

/// A session that its host drives: messages go in by [`receive`](Self::receive), and
/// [`turn`](Self::turn) does what is due and hands out messages.
pub struct EmbeddedSession {
    session: Session,
    workshop: Box<dyn Workshop>,
    catalogue: Catalogue,
    orders: watch::Receiver<Option<Order>>,
    feed: Feed,
    has_greeted: bool,
}

impl EmbeddedSession {
    /// A session for one page. Its recordings go into `folder` or, where there is none, to the page,
    /// as files to save.
    pub fn new(workshop: Box<dyn Workshop>, opening: Opening, folder: Option<PathBuf>) -> Self {
        let (sender, orders) = watch::channel(None);
        let (writers, readers) = SlotWriters::new();
        let to_page = || Destination::Page {
            number: 0,
            files: Vec::new(),
        };
        let destination = folder.map_or_else(to_page, Destination::Folder);
        let mut embedded = Self {
            session: Session::new(opening, destination, sender, writers),
            catalogue: workshop.catalogue(),
            workshop,
            orders,
            feed: Feed::new(readers),
            has_greeted: false,
        };
        embedded.watch(true);
        embedded
    }

    /// Lets time go on where the page is watched; otherwise it stands still, but for a recording.
    pub fn watch(&mut self, is_watched: bool) {
        let (count, gone) = if is_watched { (1, None) } else { (0, Some(PAGE)) };
        self.session.take(Request::Viewers { count, gone });
    }

    /// Takes a message of the page.
    ///
    /// # Errors
    /// [`WireError`] says why it is refused.
    pub fn receive(&mut self, message: &[u8]) -> Result<(), WireError> {
        match protocol::decode(message)? {
            ClientMessage::Ready(_) => {
                self.feed.answered();
            }
            message => self.session.take(Request::Page(PAGE, message)),
        }
        Ok(())
    }

    /// Makes the cloth that is ordered, and the frame and the state that are due; `post` gets every
    /// message to the page. Returns the time until something is due. Making a cloth may take
    /// seconds, of which `post` gets the progress.
    pub fn turn(&mut self, post: &mut dyn FnMut(&[u8])) -> Duration {
        if !std::mem::replace(&mut self.has_greeted, true) {
            post(&protocol::hello(PAGE, &self.catalogue));
        }
        let is_new = self.orders.has_changed().unwrap_or(false);
        let order = is_new.then(|| self.orders.borrow_and_update().clone());
        if let Some(order) = order.flatten() {
            let (session, feed) = (&mut self.session, &mut self.feed);
            let mut tell = |text| {
                session.take(Request::Progress(text));
                session.tell();
                if let Some(state) = feed.state() {
                    post(&state);
                }
                ControlFlow::Continue(())
            };
            // The page is told before the first step, which may be long.
            let _ = tell("making the cloth ready".to_owned());
            let prepared = self.workshop.prepare(&order, &mut tell);
            let is_made = prepared.is_ok();
            self.session.take(Request::Prepared(order, prepared));
            if is_made {
                self.post(post);
                self.warm_up();
            }
        }
        self.session.turn();
        self.post(post);
        self.session.wait()
    }

    /// Steps the cloth that was just made, which the page draws meanwhile, and puts it back to its beginning: an engine
    /// compiles the solver in its first frames, which take up to 0.1 s.
    fn warm_up(&mut self) {
        let began = Instant::now();
        while let Some(live) = &mut self.session.showing.live
            && live.frame() < WARM_UP
            && began.elapsed() < LONGEST_WARM_UP
            && let Ok(targets) = HandleTargets::at_frame_end(live.handle_places())
        {
            live.step(&targets, true);
        }
        let reset = ClientMessage::Command(protocol::Command::Reset {});
        self.session.take(Request::Page(PAGE, reset));
        self.session.time.pace.restart(Instant::now());
    }

    fn post(&mut self, post: &mut dyn FnMut(&[u8])) {
        let feed = &mut self.feed;
        if feed.readers.state.has_changed().unwrap_or(false)
            && let Some(state) = feed.state()
        {
            post(&state);
        }
        if feed.has_room() && feed.readers.frame.has_changed().unwrap_or(false) {
            for message in feed.frame() {
                post(&message);
            }
        }
        if let Destination::Page { files, .. } = &mut self.session.recordings.destination {
            for (name, contents) in files.drain(..) {
                post(&protocol::file(&name, &contents));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use crate::mover::Mover;
    use crate::protocol::{VERSION, kind};
    use crate::session::feed::AHEAD;
    use crate::test_cloth::{CORNERS, TestWorkshop, order};

    fn session() -> EmbeddedSession {
        let opening = Opening {
            order: order("corners"),
            mover: Mover::Physics,
            replay: None,
        };
        EmbeddedSession::new(Box::<TestWorkshop>::default(), opening, None)
    }

    /// The messages of turns until one of this kind has come.
    fn until(session: &mut EmbeddedSession, kind: u8) -> Vec<Vec<u8>> {
        let mut all: Vec<Vec<u8>> = Vec::new();
        while all.last().is_none_or(|last| last[1] != kind) {
            session.turn(&mut |message| all.push(message.to_vec()));
        }
        all
    }

    fn command(session: &mut EmbeddedSession, text: &str) {
        let message = [&[VERSION, kind::COMMAND, 0, 0], text.as_bytes()].concat();
        session.receive(&message).unwrap();
    }

    #[test]
    fn a_page_is_greeted_told_of_the_progress_and_sent_cloth_and_frames() {
        let mut session = session();
        let all = until(&mut session, kind::FRAME);
        let kinds: Vec<u8> = all.iter().map(|message| message[1]).collect();
        assert_eq!(kinds[0], kind::HELLO);
        let cloth = kinds.iter().position(|found| *found == kind::CLOTH);
        assert_eq!(kinds[cloth.unwrap() + 1], kind::FRAME);
        let busy = all.iter().filter(|message| message[1] == kind::STATE);
        let busy: Vec<Value> = busy
            .map(|state| serde_json::from_slice::<Value>(&state[4..]).unwrap()["busy"].clone())
            .collect();
        assert!(busy.contains(&Value::from("corners half way")), "{busy:?}");
    }

    #[test]
    fn the_first_frame_of_a_page_is_the_first_of_the_scene() {
        let opening = Opening {
            order: order("corners"),
            mover: Mover::Physics,
            replay: None,
        };
        let workshop = TestWorkshop {
            fall: 0.25,
            ..TestWorkshop::default()
        };
        let mut session = EmbeddedSession::new(Box::new(workshop), opening, None);
        until(&mut session, kind::FRAME);
        let live = session.session.showing.live.as_ref().unwrap();
        assert_eq!(live.frame(), 1);
        let fallen = CORNERS[2] - glam::Vec3::Y * 0.25;
        assert_eq!(live.positions()[0][2], fallen);
    }

    #[test]
    fn a_page_that_does_not_answer_is_sent_no_more_frames() {
        let mut session = session();
        let mut frames = 0;
        for _ in 0..200 {
            session.turn(&mut |message| frames += u32::from(message[1] == kind::FRAME));
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(frames, AHEAD);
        session
            .receive(&[VERSION, kind::READY, 0, 0, 1, 0, 0, 0])
            .unwrap();
        until(&mut session, kind::FRAME);
    }

    #[test]
    fn out_of_sight_time_stands_still() {
        let mut session = session();
        until(&mut session, kind::FRAME);
        session.watch(false);
        let before = session.session.showing.live.as_ref().unwrap().frame();
        for _ in 0..50 {
            session.turn(&mut |_| {});
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(
            session.session.showing.live.as_ref().unwrap().frame(),
            before
        );
    }

    #[test]
    fn a_recording_is_a_file_for_the_page() {
        let mut session = session();
        until(&mut session, kind::FRAME);
        command(&mut session, r#"{"do":"record"}"#);
        (0..3).for_each(|_| session.session.advance());
        command(&mut session, r#"{"do":"stop-recording"}"#);
        let file = until(&mut session, kind::FILE).pop().unwrap();
        let name = b"recording-1-physics.glb";
        assert_eq!(file[4..8], (name.len() as u32).to_le_bytes());
        let (found, contents) = file[8..].split_at(name.len());
        assert_eq!((found, &contents[..4]), (&name[..], &b"glTF"[..]));
    }

    #[test]
    fn what_is_no_message_is_refused() {
        assert!(session().receive(&[VERSION, 99, 0, 0]).is_err());
        assert!(session().receive(&[]).is_err());
    }
}
