//! One page: its messages are checked and passed on, and it gets the latest of everything, as fast
//! as it takes it up.
//!
//! A page says of each frame when it has taken it up; while [`AHEAD`] frames are on their way no
//! other is sent, so that a slow page skips frames and never falls behind. A page with a message
//! that is refused, or with too many, is told the reason and closed. A page that takes nothing for
//! [`PATIENCE`] is dropped.

use std::sync::mpsc::TrySendError;
use std::time::Duration;

use axum::extract::ws::{CloseCode, CloseFrame, Message, WebSocket, close_code};
use bytes::Bytes;
use tokio::time::{Instant, timeout};

use crate::protocol::{self, ClientMessage, Hello, kind};
use crate::server::shared::Shared;
use crate::session::{Inlets, Request};

/// Frames on their way to a page at most.
const AHEAD: u32 = 3;
/// The time in which a page reads a message.
const PATIENCE: Duration = Duration::from_secs(10);
/// Messages per second that a page may send for long, and at once.
const MESSAGES_PER_SECOND: f64 = 300.0;
const MESSAGES_AT_ONCE: f64 = 600.0;

/// The reason why a page is closed.
struct Closing {
    code: CloseCode,
    reason: String,
}

impl Closing {
    fn new(code: CloseCode, reason: impl Into<String>) -> Self {
        let mut reason = reason.into();
        // A close frame has room for 123 bytes.
        while reason.len() > 120 {
            reason.pop();
        }
        Self { code, reason }
    }

    /// Nobody is there to be told.
    fn gone() -> Self {
        Self::new(close_code::NORMAL, "")
    }
}

/// Serves one page until it goes.
pub(crate) async fn watch(mut socket: WebSocket, client: u32, shared: Shared) {
    count(&shared, 1, None).await;
    let closing = match talk(&mut socket, client, &shared).await {
        Ok(never) => match never {},
        Err(closing) => closing,
    };
    let frame = CloseFrame {
        code: closing.code,
        reason: closing.reason.into(),
    };
    // Who has gone hears it no more.
    let _ = timeout(
        Duration::from_secs(1),
        socket.send(Message::Close(Some(frame))),
    )
    .await;
    count(&shared, -1, Some(client)).await;
}

/// Tells the session the number of pages, and the one that has gone. A full queue is emptied within
/// a frame.
async fn count(shared: &Shared, change: isize, gone: Option<u32>) {
    shared
        .viewers
        .send_modify(|viewers| *viewers = viewers.saturating_add_signed(change));
    loop {
        let count = *shared.viewers.borrow();
        let request = Request::Viewers { count, gone };
        match shared.session.requests.try_send(request) {
            Err(TrySendError::Full(_)) => tokio::time::sleep(Duration::from_millis(20)).await,
            Ok(()) | Err(TrySendError::Disconnected(_)) => return,
        }
    }
}

enum Never {}

/// Talks with a page until there is a reason to close it.
async fn talk(socket: &mut WebSocket, client: u32, shared: &Shared) -> Result<Never, Closing> {
    let hello = Hello {
        client,
        program: concat!("selvedge ", env!("CARGO_PKG_VERSION")),
        catalogue: &shared.session.catalogue,
    };
    send(socket, protocol::json(kind::HELLO, &hello).into()).await?;
    let mut latest = shared.session.inlets.clone();
    let mut stop = shared.stop.clone();
    latest.state.mark_changed();
    latest.frame.mark_changed();
    let mut shown = 0;
    let mut intake = Intake::new();
    loop {
        tokio::select! {
            biased;
            () = told(&mut stop) => {
                return Err(Closing::new(close_code::AWAY, "the program has ended"));
            }
            message = socket.recv() => {
                if let Some(message) = intake.take(received(message)?)? {
                    pass_on(shared, client, message)?;
                }
            }
            changed = latest.state.changed() => {
                changed.map_err(|_| over())?;
                let bytes = latest.state.borrow_and_update().bytes.clone();
                // Empty where the session has not said anything yet.
                if !bytes.is_empty() {
                    send(socket, bytes).await?;
                }
            }
            changed = latest.frame.changed(), if intake.on_the_way < AHEAD => {
                changed.map_err(|_| over())?;
                intake.on_the_way += send_frame(socket, &mut latest, &mut shown).await?;
            }
        }
    }
}

/// The message that has come.
fn received(message: Option<Result<Message, axum::Error>>) -> Result<Message, Closing> {
    match message {
        Some(Ok(message)) => Ok(message),
        // Longer than allowed, or no WebSocket at all.
        Some(Err(error)) => Err(Closing::new(close_code::SIZE, error.to_string())),
        None => Err(Closing::gone()),
    }
}

/// Sends the latest frame, and before it the cloth where that is not the one of the generation
/// `shown`. Returns the number of frames sent, 0 or 1.
async fn send_frame(
    socket: &mut WebSocket,
    latest: &mut Inlets,
    shown: &mut u32,
) -> Result<u32, Closing> {
    let frame = latest.frame.borrow_and_update().clone();
    if frame.number == 0 {
        return Ok(0);
    }
    if frame.generation != *shown {
        let cloth = latest.cloth.borrow_and_update().clone();
        send(socket, cloth.bytes).await?;
        *shown = cloth.generation;
    }
    // The cloth may have changed once more since: its own frame is to come.
    if frame.generation != *shown {
        return Ok(0);
    }
    send(socket, frame.bytes).await?;
    Ok(1)
}

/// Waits until the program is to end.
async fn told(stop: &mut tokio::sync::watch::Receiver<bool>) {
    // Who could tell has gone: that is the end, too.
    let _ = stop.wait_for(|stop| *stop).await;
}

fn over() -> Closing {
    Closing::new(close_code::AWAY, "the session has ended")
}

async fn send(socket: &mut WebSocket, bytes: Bytes) -> Result<(), Closing> {
    match timeout(PATIENCE, socket.send(Message::Binary(bytes))).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) => Err(Closing::gone()),
        Err(_) => Err(Closing::new(close_code::POLICY, "the page does not read")),
    }
}

/// The messages from a page, and its allowance of more.
struct Intake {
    /// Frames that it has not answered yet.
    on_the_way: u32,
    allowance: Allowance,
}

impl Intake {
    fn new() -> Self {
        Self {
            on_the_way: 0,
            allowance: Allowance::new(),
        }
    }

    /// Returns the part of a message that is passed on. The answer to a frame costs nothing: there
    /// are no more answers than frames.
    fn take(&mut self, message: Message) -> Result<Option<ClientMessage>, Closing> {
        let message = read(message)?;
        let is_answer = matches!(message, Some(ClientMessage::Ready(_)));
        if is_answer && self.on_the_way > 0 {
            self.on_the_way -= 1;
            return Ok(None);
        }
        self.allowance.spend()?;
        Ok(message.filter(|_| !is_answer))
    }
}

/// Reads what a page sent.
fn read(message: Message) -> Result<Option<ClientMessage>, Closing> {
    match message {
        Message::Binary(bytes) => match protocol::decode(&bytes) {
            Ok(message) => Ok(Some(message)),
            Err(error) => Err(Closing::new(close_code::PROTOCOL, error.to_string())),
        },
        Message::Text(_) => Err(Closing::new(
            close_code::UNSUPPORTED,
            "messages are binary, not text",
        )),
        Message::Ping(_) | Message::Pong(_) => Ok(None),
        Message::Close(_) => Err(Closing::gone()),
    }
}

fn pass_on(shared: &Shared, client: u32, message: ClientMessage) -> Result<(), Closing> {
    match shared
        .session
        .requests
        .try_send(Request::Page(client, message))
    {
        Ok(()) => Ok(()),
        Err(TrySendError::Full(_)) => Err(Closing::new(close_code::AGAIN, "too much is asked")),
        Err(TrySendError::Disconnected(_)) => Err(over()),
    }
}

/// The messages that a page may still send: a bucket that fills at a steady rate.
struct Allowance {
    left: f64,
    filled: Instant,
}

impl Allowance {
    fn new() -> Self {
        Self {
            left: MESSAGES_AT_ONCE,
            filled: Instant::now(),
        }
    }

    fn spend(&mut self) -> Result<(), Closing> {
        let now = Instant::now();
        let gained = MESSAGES_PER_SECOND * (now - self.filled).as_secs_f64();
        self.filled = now;
        self.left = (self.left + gained).min(MESSAGES_AT_ONCE) - 1.0;
        if self.left >= 0.0 {
            Ok(())
        } else {
            Err(Closing::new(
                close_code::POLICY,
                format!("more than {MESSAGES_PER_SECOND} messages per second"),
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ready() -> Message {
        Message::Binary(vec![protocol::VERSION, kind::READY, 0, 0, 1, 0, 0, 0].into())
    }

    #[test]
    fn answers_to_frames_are_not_counted_as_messages_and_others_are() {
        let mut intake = Intake::new();
        for _ in 0..100_000 {
            intake.on_the_way = 1;
            assert!(intake.take(ready()).is_ok_and(|passed| passed.is_none()));
            assert_eq!(intake.on_the_way, 0);
        }
        let mut refused = (0..100_000).filter_map(|_| intake.take(ready()).err());
        let closing = refused.next().map(|closing| closing.code);
        assert_eq!(closing, Some(close_code::POLICY));
    }
}
