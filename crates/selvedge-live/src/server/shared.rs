//! The state that all connections of a server share.

use std::sync::Arc;
use std::sync::atomic::AtomicU32;

use tokio::sync::{Semaphore, watch};

use super::gate::Gate;
use crate::session::SessionPort;

/// Pages that may watch at once.
pub const MOST_PAGES: usize = 32;

/// The session that is served, and the counters of its pages.
#[derive(Clone)]
pub(super) struct Shared {
    pub(super) session: SessionPort,
    pub(super) gate: Arc<Gate>,
    /// Room for pages that watch.
    pub(super) places: Arc<Semaphore>,
    pub(super) next_client: Arc<AtomicU32>,
    /// True when the server ends.
    pub(super) stop: watch::Receiver<bool>,
    pub(super) viewers: Arc<watch::Sender<usize>>,
}

impl Shared {
    pub(super) fn new(session: SessionPort, gate: Gate, stop: watch::Receiver<bool>) -> Self {
        Self {
            session,
            gate: Arc::new(gate),
            places: Arc::new(Semaphore::new(MOST_PAGES)),
            next_client: Arc::new(AtomicU32::new(1)),
            stop,
            viewers: Arc::new(watch::channel(0).0),
        }
    }
}
