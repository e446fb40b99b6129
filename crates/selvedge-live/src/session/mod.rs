//! A session: one cloth that moves, whoever watches. It takes requests, makes frames at the rate of
//! the scene, and leaves the latest cloth, state and frame in three slots, so that nothing grows with
//! the number or the slowness of readers. While nobody watches and nothing is recorded, time stands
//! still.
//!
//! It runs on a thread of its own for a server (`threaded`), or is driven by a page's worker
//! (`embedded`).

mod bodies;
mod commands;
mod embedded;
mod feed;
mod following;
mod motion;
mod showing;
mod slots;
#[cfg(feature = "server")]
mod threaded;

use std::path::PathBuf;
use std::time::Duration;

use tokio::sync::watch;
use web_time::Instant;

use self::bodies::Bodies;
pub use self::embedded::EmbeddedSession;
pub(crate) use self::feed::Feed;
use self::following::Following;
use self::showing::Showing;
use self::slots::TELL_EVERY;
pub(crate) use self::slots::{SlotReaders, SlotWriters};
#[cfg(feature = "server")]
pub(crate) use self::threaded::SessionPort;
#[cfg(feature = "server")]
pub use self::threaded::{RunningSession, start};
use crate::hand::{HandLimits, Hands, Reach};
use crate::live_cloth::LiveCloth;
use crate::mover::{LiveError, Mover};
use crate::order::Order;
use crate::pace::{DEFAULT_FRAME_RATE, Pace};
use crate::player::Replay;
use crate::protocol::{self, ClientMessage, FrameParts};
use crate::recorder::{Destination, Recorder};
use crate::state::{Level, State};
use crate::workshop::ReadyCloth;

/// The beginning of a session.
pub struct Opening {
    /// The cloth to make ready.
    pub order: Order,
    /// The mover of the cloth.
    pub mover: Mover,
    /// A recording to play first; the cloth is then made ready when it is asked for.
    pub replay: Option<Replay>,
}

/// A request to a session.
pub(crate) enum Request {
    /// A message of the page of this number.
    Page(u32, ClientMessage),
    /// The number of pages that watch, now that one has come or, with its number, gone.
    Viewers { count: usize, gone: Option<u32> },
    /// The progress of the workshop.
    Progress(String),
    /// The end of an order in the workshop.
    Prepared(Order, Result<Box<ReadyCloth>, LiveError>),
    /// The end of the session.
    #[cfg(feature = "server")]
    Close,
}

/// The state of a session.
struct Session {
    /// The latest order on its way to the workshop: nothing grows while a cloth takes long, and no
    /// cloth is made for which nobody waits.
    orders: watch::Sender<Option<Order>>,
    writers: SlotWriters,
    /// The cloth on the table, as it was ordered.
    order: Order,
    mover: Mover,
    showing: Showing,
    control: HandleControl,
    bodies: Bodies,
    /// True where pages want the gaps of the vertices.
    shows_gaps: bool,
    time: Time,
    recordings: Recordings,
    viewers: usize,
    busy: Option<String>,
    /// The last remark on mover, handles and wind.
    remarked: Option<String>,
}

/// What moves the handles: hands, keys, or a motion.
#[derive(Default)]
struct HandleControl {
    hands: Hands,
    /// The greatest distances between the handles of the cloth on the table; made when needed.
    reach: Option<Reach>,
    limits: HandLimits,
    following: Option<Following>,
    /// The last drag that was followed: the page, and its number.
    drag: [u32; 2],
    /// The page whose keys the handles follow.
    pusher: Option<u32>,
}

/// The time of a session.
struct Time {
    running: bool,
    /// Parts of real time.
    rate: f64,
    pace: Pace,
}

/// The recordings of a session.
struct Recordings {
    destination: Destination,
    recorder: Option<Recorder>,
    /// The last recording, and its files.
    replay: Option<Replay>,
    files: Vec<PathBuf>,
}

impl Session {
    fn new(
        opening: Opening,
        destination: Destination,
        orders: watch::Sender<Option<Order>>,
        writers: SlotWriters,
    ) -> Self {
        let mut session = Self {
            orders,
            writers,
            order: opening.order,
            mover: opening.mover,
            showing: Showing::default(),
            control: HandleControl::default(),
            bodies: Bodies::default(),
            shows_gaps: false,
            time: Time {
                running: true,
                rate: 1.0,
                pace: Pace::new(DEFAULT_FRAME_RATE, Instant::now()),
            },
            recordings: Recordings {
                destination,
                recorder: None,
                replay: None,
                files: Vec::new(),
            },
            viewers: 0,
            busy: None,
            remarked: None,
        };
        match opening.replay {
            Some(replay) => session.play(replay),
            None => session.place_order(session.order.clone()),
        }
        session
    }

    /// The time until something is due.
    fn wait(&self) -> Duration {
        if self.is_due_ever() { self.time.pace.wait(Instant::now()) } else { TELL_EVERY }
    }

    /// Makes a frame and tells the state, where they are due.
    fn turn(&mut self) {
        if self.is_due_ever() && self.time.pace.wait(Instant::now()).is_zero() {
            self.advance();
            self.time.pace.made(Instant::now());
        }
        if self.writers.is_state_due() {
            self.tell();
        }
    }

    /// Returns true while time goes on.
    fn is_due_ever(&self) -> bool {
        let watched = self.viewers > 0 || self.recordings.recorder.is_some();
        self.time.running && watched && self.showing.is_moving()
    }

    /// Makes one frame.
    fn advance(&mut self) {
        match &mut self.showing.player {
            Some(player) => player.advance(),
            None => self.move_cloth(),
        }
        self.publish_frame();
    }

    /// Shows another cloth: a new generation.
    fn publish_cloth(&mut self) {
        let Some(cloth) = self.showing.cloth() else {
            return;
        };
        let bodies = self.showing.bodies();
        self.writers
            .publish_cloth(|generation| protocol::cloth(generation, cloth, &bodies));
        let rate = self.showing.frame_rate() * self.time.rate;
        self.time.pace.set_rate(rate, Instant::now());
        self.time.pace.restart(Instant::now());
        self.publish_frame();
    }

    fn publish_frame(&mut self) {
        let Some(frame) = self.showing.frame(&self.control.hands) else {
            return;
        };
        let drag = self.control.drag;
        let gaps = if self.shows_gaps { self.showing.gaps() } else { Vec::new() };
        self.writers.publish_frame(|generation, number| {
            protocol::frame(&FrameParts {
                generation,
                number,
                drag,
                gaps,
                ..frame
            })
        });
    }

    /// Says what there is to say of the mover under the present handles and wind, once.
    fn remark(&mut self) {
        let remark = match (&self.showing.player, &self.showing.live) {
            (None, Some(live)) => {
                let places = live.places();
                let movers = &live.ready().movers;
                movers.remark_on(live.mover(), live.influences(), &places)
            }
            _ => None,
        };
        if remark != self.remarked {
            self.remarked.clone_from(&remark);
            if let Some(remark) = remark {
                self.notify(Level::Bad, remark);
            }
        }
    }

    /// Tells something to all pages.
    fn notify(&mut self, level: Level, text: impl Into<String>) {
        self.writers.notify(level, text);
    }

    /// Tells the state to all pages.
    fn tell(&mut self) {
        self.remark();
        let state = self.state();
        self.writers
            .publish_state(protocol::json(protocol::kind::STATE, &state));
    }

    fn state(&self) -> State {
        let live = self.showing.live.as_ref();
        let wind = live.map(|live| live.influences().environment.wind);
        let files = self.recordings.files.iter();
        State {
            generation: self.writers.generation(),
            order: self.order.clone(),
            mover: live.map_or(self.mover, LiveCloth::mover),
            show: self.showing.show(),
            running: self.time.running,
            frame_rate: self.showing.frame_rate(),
            rate: self.time.rate,
            kept: self.time.pace.kept(),
            tracks: self.showing.tracks(),
            limits: self.control.limits,
            wind: wind.unwrap_or_default().to_array(),
            motion: self.control.following.as_ref().map(Following::state),
            recording: self.recordings.recorder.as_ref().map(Recorder::state),
            recorded: files.map(|file| file.display().to_string()).collect(),
            touches: self.showing.has_bodies(),
            gaps: self.shows_gaps,
            can_replay: self.recordings.replay.is_some(),
            can_live: self.showing.player.is_some(),
            busy: self.busy.clone(),
            remark: self.remarked.clone(),
            notice: self.writers.notice().cloned(),
            viewers: self.viewers,
        }
    }
}

#[cfg(test)]
mod body_tests;
#[cfg(test)]
mod tests;
