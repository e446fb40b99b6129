//! A session: one cloth that moves, whoever watches. A thread of its own owns the steppers, runs at the
//! rate of the scene, and leaves the latest frame where every page can take it.
//!
//! Requests come through one bounded queue; what goes out is three slots (cloth, state, frame), each
//! holding only the latest, so that nothing grows with the number or the slowness of readers. Making a
//! cloth ready is the work of another thread, which gets its orders through such a slot, too; meanwhile the
//! one on the table goes on. Where nobody watches and nothing is recorded, time stands still.

mod commands;
mod motion;
mod orders;

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use tokio::sync::watch;

use self::motion::Following;
use self::orders::{OrderReceiver, OrderSender, order_slot};
use crate::hand::{Hands, Limits};
use crate::order::{Bench, Catalogue, Mover, Order, Workshop};
use crate::pace::Pace;
use crate::player::{Player, Tape};
use crate::protocol::{self, ClientMessage, FrameParts};
use crate::recorder::Recorder;
use crate::stage::Stage;
use crate::state::{Level, Notice, Show, State};

/// What a session begins with.
pub struct Opening {
    /// The cloth to make ready.
    pub order: Order,
    /// Who moves it.
    pub mover: Mover,
    /// A recording to play first; the cloth is then made ready when it is asked for.
    pub tape: Option<Tape>,
    /// Where recordings are written.
    pub folder: PathBuf,
}

/// A message with the generation of the cloth that it belongs to.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slot {
    pub(crate) generation: u32,
    pub(crate) number: u32,
    pub(crate) bytes: Bytes,
}

/// What may be asked of a session.
pub(crate) enum Request {
    /// By the page of this number.
    Page(u32, ClientMessage),
    /// So many pages watch, now that one has come or, with its number, gone.
    Viewers { count: usize, gone: Option<u32> },
    /// By the workshop: what it is doing.
    Progress(String),
    /// By the workshop: it is done.
    Prepared(Order, Result<Box<dyn Bench>, String>),
    /// By the program: the end.
    Close,
}

/// The way to a session, for those who serve it.
#[derive(Clone)]
pub(crate) struct SessionPort {
    pub(crate) requests: SyncSender<Request>,
    pub(crate) catalogue: Arc<Catalogue>,
    pub(crate) cloth: watch::Receiver<Slot>,
    pub(crate) state: watch::Receiver<Slot>,
    pub(crate) frame: watch::Receiver<Slot>,
}

/// A session that runs.
pub struct RunningSession {
    port: SessionPort,
    thread: JoinHandle<()>,
}

/// Requests that wait; a page that finds the queue full is told so.
const QUEUE: usize = 4096;
/// The state is told so often while nothing happens.
const TELL_EVERY: Duration = Duration::from_millis(200);

/// Starts a session.
///
/// # Errors
/// When the system has no thread for it.
pub fn start(workshop: Box<dyn Workshop>, opening: Opening) -> std::io::Result<RunningSession> {
    let (requests, inbox) = mpsc::sync_channel(QUEUE);
    let (orders, to_make) = order_slot();
    let catalogue = Arc::new(workshop.catalogue());
    let back = requests.clone();
    std::thread::Builder::new()
        .name("workshop".to_owned())
        .spawn(move || work(workshop, &to_make, &back))?;
    let (cloth, cloth_out) = watch::channel(Slot::default());
    let (state, state_out) = watch::channel(Slot::default());
    let (frame, frame_out) = watch::channel(Slot::default());
    let port = SessionPort {
        requests,
        catalogue,
        cloth: cloth_out,
        state: state_out,
        frame: frame_out,
    };
    let outlets = Outlets {
        cloth,
        state,
        frame,
    };
    let session = Session::new(opening, orders, outlets);
    let thread = std::thread::Builder::new()
        .name("session".to_owned())
        .spawn(move || session.run(&inbox))?;
    Ok(RunningSession { port, thread })
}

impl RunningSession {
    pub(crate) fn port(&self) -> &SessionPort {
        &self.port
    }

    /// Ends the session; a recording under way is written.
    pub fn close(self) {
        if self.port.requests.send(Request::Close).is_ok() {
            // A session that has panicked has said so on standard error.
            let _ = self.thread.join();
        }
    }
}

/// Makes cloths ready, the latest order only, until the session has gone; one that a later order overtakes
/// is stopped.
fn work(mut workshop: Box<dyn Workshop>, orders: &OrderReceiver, back: &SyncSender<Request>) {
    while let Some(order) = orders.wait() {
        let prepared = workshop.prepare(&order, &mut |text| {
            // Progress that does not fit in the queue is not missed.
            let told = back.try_send(Request::Progress(text));
            let is_over = matches!(told, Err(TrySendError::Disconnected(_)));
            match is_over || orders.is_one_waiting() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        if prepared.is_err() && orders.is_one_waiting() {
            continue;
        }
        if back.send(Request::Prepared(order, prepared)).is_err() {
            return;
        }
    }
}

/// Where pages take things from.
struct Outlets {
    cloth: watch::Sender<Slot>,
    state: watch::Sender<Slot>,
    frame: watch::Sender<Slot>,
}

/// All that a session knows.
struct Session {
    orders: OrderSender,
    outlets: Outlets,
    folder: PathBuf,
    order: Order,
    mover: Mover,
    stage: Option<Stage>,
    player: Option<Player>,
    hands: Hands,
    limits: Limits,
    following: Option<Following>,
    recorder: Option<Recorder>,
    replay: Option<Tape>,
    recorded: Vec<PathBuf>,
    running: bool,
    rate: f64,
    pace: Pace,
    generation: u32,
    number: u32,
    drag: [u32; 2],
    /// The page whose keys the handles follow.
    pusher: Option<u32>,
    viewers: usize,
    busy: Option<String>,
    notice: Option<Notice>,
    told: Instant,
    tell_soon: bool,
}

impl Session {
    fn new(opening: Opening, orders: OrderSender, outlets: Outlets) -> Self {
        let now = Instant::now();
        let mut session = Self {
            orders,
            outlets,
            folder: opening.folder,
            order: opening.order,
            mover: opening.mover,
            stage: None,
            player: None,
            hands: Hands::default(),
            limits: Limits::default(),
            following: None,
            recorder: None,
            replay: None,
            recorded: Vec::new(),
            running: true,
            rate: 1.0,
            pace: Pace::new(60.0, now),
            generation: 0,
            number: 0,
            drag: [0; 2],
            pusher: None,
            viewers: 0,
            busy: None,
            notice: None,
            told: now,
            tell_soon: true,
        };
        match opening.tape {
            Some(tape) => session.play(tape),
            None => session.place_order(session.order.clone()),
        }
        session
    }

    /// The loop: requests as they come, frames as they are due.
    fn run(mut self, inbox: &Receiver<Request>) {
        self.tell();
        loop {
            let now = Instant::now();
            let wait = if self.is_due_ever() {
                self.pace.wait(now)
            } else {
                TELL_EVERY
            };
            match inbox.recv_timeout(wait) {
                Ok(Request::Close) | Err(RecvTimeoutError::Disconnected) => break,
                Ok(request) => self.take(request),
                Err(RecvTimeoutError::Timeout) => {}
            }
            // A flood of requests must not keep frames from being made.
            if self.is_due_ever() && self.pace.wait(Instant::now()).is_zero() {
                self.advance();
                self.pace.made(Instant::now());
            }
            if self.tell_soon || self.told.elapsed() >= TELL_EVERY {
                self.tell();
            }
        }
        self.stop_recording();
    }

    /// Whether time goes on.
    fn is_due_ever(&self) -> bool {
        let watched = self.viewers > 0 || self.recorder.is_some();
        let moving = self.stage.as_ref().is_some_and(Stage::is_moving);
        self.running && watched && (self.player.is_some() || moving)
    }

    /// One frame.
    fn advance(&mut self) {
        if let Some(player) = &mut self.player {
            player.advance();
        } else {
            self.move_cloth();
        }
        self.publish_frame();
    }

    /// Shows another cloth: a new generation.
    fn publish_cloth(&mut self) {
        let cloth = match (&self.player, &self.stage) {
            (Some(player), _) => player.tape().first().cloth(),
            (None, Some(stage)) => stage.bench().cloth(),
            (None, None) => return,
        };
        self.generation += 1;
        let bytes = protocol::cloth(self.generation, cloth);
        self.outlets.cloth.send_replace(Slot {
            generation: self.generation,
            number: 0,
            bytes: bytes.into(),
        });
        self.tell_soon = true;
        let rate = self.frame_rate() * self.rate;
        self.pace.set_rate(rate, Instant::now());
        self.pace.restart(Instant::now());
        self.publish_frame();
    }

    fn publish_frame(&mut self) {
        let (tracks, handles, goals, frame) = match (&self.player, &self.stage) {
            (Some(player), _) => {
                let handles = player.tape().first().handles();
                let positions = player.positions();
                let goals = handles.select(positions[0]);
                let goals = goals.iter().map(|p| p.as_dvec3()).collect();
                (positions, handles, goals, player.frame())
            }
            (None, Some(stage)) => {
                let goals = self.hands.goals();
                (
                    stage.positions(),
                    &stage.hold().handles,
                    goals,
                    stage.frame(),
                )
            }
            (None, None) => return,
        };
        let vertices = handles.vertices().iter().map(|v| v.0);
        let goals: Vec<_> = vertices.zip(goals).collect();
        self.number = self.number.wrapping_add(1);
        let bytes = protocol::frame(&FrameParts {
            generation: self.generation,
            number: self.number,
            time: frame as f64 / self.frame_rate(),
            drag: self.drag,
            goals: &goals,
            tracks: &tracks,
        });
        self.outlets.frame.send_replace(Slot {
            generation: self.generation,
            number: self.number,
            bytes: bytes.into(),
        });
    }

    fn frame_rate(&self) -> f64 {
        match (&self.player, &self.stage) {
            (Some(player), _) => player.tape().first().frame_rate(),
            (None, Some(stage)) => stage.bench().frame_rate(),
            (None, None) => 60.0,
        }
    }

    /// Lets something be known.
    fn notify(&mut self, level: Level, text: impl Into<String>) {
        let number = self.notice.as_ref().map_or(1, |notice| notice.number + 1);
        self.notice = Some(Notice {
            number,
            level,
            text: text.into(),
        });
        self.tell_soon = true;
    }

    /// Tells all pages how things are.
    fn tell(&mut self) {
        self.told = Instant::now();
        self.tell_soon = false;
        let bytes = protocol::json(protocol::kind::STATE, &self.state());
        self.outlets.state.send_replace(Slot {
            generation: self.generation,
            number: 0,
            bytes: bytes.into(),
        });
    }

    fn state(&self) -> State {
        let (show, tracks) = match (&self.player, &self.stage) {
            (Some(player), _) => (player.show(), player.tracks()),
            (None, Some(stage)) => (Show::Live, stage.tracks()),
            (None, None) => (Show::Nothing, Vec::new()),
        };
        let wind = self.stage.as_ref().map(|s| s.hold().environment.wind);
        State {
            generation: self.generation,
            order: self.order.clone(),
            mover: self.stage.as_ref().map_or(self.mover, Stage::mover),
            show,
            running: self.running,
            frame_rate: self.frame_rate(),
            rate: self.rate,
            kept: self.pace.kept(),
            tracks,
            limits: self.limits,
            wind: wind.unwrap_or_default().to_array(),
            motion: self.following.as_ref().map(Following::state),
            recording: self.recorder.as_ref().map(Recorder::state),
            recorded: self
                .recorded
                .iter()
                .map(|p| p.display().to_string())
                .collect(),
            can_replay: self.replay.is_some(),
            can_live: self.player.is_some(),
            busy: self.busy.clone(),
            notice: self.notice.clone(),
            viewers: self.viewers,
        }
    }
}

#[cfg(test)]
mod tests;
