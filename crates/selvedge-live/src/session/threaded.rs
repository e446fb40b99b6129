//! A session on a thread of its own, for a server. Another thread makes cloths ready; it gets its
//! orders through a slot that holds only the latest, and meanwhile the cloth on the table goes on.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::thread::JoinHandle;

use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;

use super::slots::{SlotReaders, SlotWriters};
use super::{Opening, Request, Session};
use crate::order::{Catalogue, Order};
use crate::recorder::Destination;
use crate::workshop::Workshop;

/// The way to a session, for a server.
#[derive(Clone)]
pub(crate) struct SessionPort {
    pub(crate) requests: SyncSender<Request>,
    pub(crate) catalogue: Arc<Catalogue>,
    pub(crate) readers: SlotReaders,
}

/// A session that runs.
pub struct RunningSession {
    port: SessionPort,
    thread: JoinHandle<()>,
}

/// Requests that wait; a page that finds the queue full is told so.
const QUEUE: usize = 4096;

/// Starts a session whose recordings go into `folder`.
pub fn start(
    workshop: Box<dyn Workshop>,
    opening: Opening,
    folder: PathBuf,
) -> std::io::Result<RunningSession> {
    let (requests, inbox) = mpsc::sync_channel(QUEUE);
    let (orders, to_make) = watch::channel(None);
    let waiting = Builder::new_current_thread().build()?;
    let catalogue = Arc::new(workshop.catalogue());
    let back = requests.clone();
    std::thread::Builder::new()
        .name("workshop".to_owned())
        .spawn(move || work(workshop, to_make, &waiting, &back))?;
    let (writers, readers) = SlotWriters::new();
    let port = SessionPort {
        requests,
        catalogue,
        readers,
    };
    let session = Session::new(opening, Destination::Folder(folder), orders, writers);
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

/// Makes cloths ready, the latest order only, until the session has gone. An order that a later one
/// overtakes is stopped.
fn work(
    mut workshop: Box<dyn Workshop>,
    mut orders: watch::Receiver<Option<Order>>,
    waiting: &Runtime,
    back: &SyncSender<Request>,
) {
    while waiting.block_on(orders.changed()).is_ok() {
        let Some(order) = orders.borrow_and_update().clone() else {
            continue;
        };
        let is_one_waiting = || orders.has_changed().unwrap_or(false);
        let prepared = workshop.prepare(&order, &mut |text| {
            // Progress that does not fit in the queue is not missed.
            let sent = back.try_send(Request::Progress(text));
            let is_over = matches!(sent, Err(TrySendError::Disconnected(_)));
            if is_over || is_one_waiting() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        if prepared.is_err() && is_one_waiting() {
            continue;
        }
        if back.send(Request::Prepared(order, prepared)).is_err() {
            return;
        }
    }
}

impl Session {
    /// The loop: requests as they come, frames as they are due.
    fn run(mut self, inbox: &Receiver<Request>) {
        self.tell();
        loop {
            match inbox.recv_timeout(self.wait()) {
                Ok(Request::Close) | Err(RecvTimeoutError::Disconnected) => break,
                Ok(request) => self.take(request),
                Err(RecvTimeoutError::Timeout) => {}
            }
            // A flood of requests must not keep frames from being made.
            self.turn();
        }
        self.stop_recording();
    }
}
