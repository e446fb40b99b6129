//! One page: its messages are checked and passed on, and it gets the latest of everything, as fast
//! as it takes it up.
//!
//! A page with a message that is refused, or with too many, is told the reason and closed. A page
//! that takes nothing for [`PATIENCE`] is dropped.

use std::convert::Infallible;
use std::sync::mpsc::TrySendError;
use std::time::Duration;

use axum::extract::ws::{CloseCode, CloseFrame, Message, WebSocket, close_code};
use bytes::Bytes;
use tokio::time::{Instant, timeout};

use crate::protocol::{self, ClientMessage};
use crate::server::Shared;
use crate::session::{Feed, Request};

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
pub(super) async fn watch(mut socket: WebSocket, client: u32, shared: Shared) {
    count(&shared, 1, None).await;
    let Err(closing) = talk(&mut socket, client, &shared).await;
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

/// Talks with a page until there is a reason to close it.
async fn talk(socket: &mut WebSocket, client: u32, shared: &Shared) -> Result<Infallible, Closing> {
    let hello = protocol::hello(client, &shared.session.catalogue);
    send(socket, hello.into()).await?;
    let mut feed = Feed::new(shared.session.readers.clone());
    let mut allowance = Allowance::new();
    let mut stop = shared.stop.clone();
    loop {
        tokio::select! {
            biased;
            () = until_stopped(&mut stop) => {
                return Err(Closing::new(close_code::AWAY, "the program has ended"));
            }
            message = socket.recv() => {
                if let Some(message) = taken(received(message)?, &mut feed, &mut allowance)? {
                    pass_on(shared, client, message)?;
                }
            }
            changed = feed.readers.state.changed() => {
                changed.map_err(|_| over())?;
                if let Some(state) = feed.state() {
                    send(socket, state).await?;
                }
            }
            changed = feed.readers.frame.changed(), if feed.has_room() => {
                changed.map_err(|_| over())?;
                for message in feed.frame() {
                    send(socket, message).await?;
                }
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

/// Waits until the program is to end.
async fn until_stopped(stop: &mut tokio::sync::watch::Receiver<bool>) {
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

/// Returns the part of a message that is passed on. The answer to a frame costs nothing: there are
/// no more answers than frames.
fn taken(
    message: Message,
    feed: &mut Feed,
    allowance: &mut Allowance,
) -> Result<Option<ClientMessage>, Closing> {
    let message = read(message)?;
    let is_answer = matches!(message, Some(ClientMessage::Ready(_)));
    if !(is_answer && feed.answered()) {
        allowance.spend()?;
    }
    Ok(message.filter(|_| !is_answer))
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
    use crate::protocol::{VERSION, kind};
    use crate::session::SlotWriters;

    #[test]
    fn answers_to_frames_are_not_counted_as_messages_and_others_are() {
        let (mut writers, readers) = SlotWriters::new();
        let (mut feed, mut allowance) = (Feed::new(readers), Allowance::new());
        writers.publish_cloth(|_| vec![2]);
        let mut answer = |feed: &mut Feed| {
            let ready = vec![VERSION, kind::READY, 0, 0, 1, 0, 0, 0];
            taken(Message::Binary(ready.into()), feed, &mut allowance)
        };
        for _ in 0..100_000 {
            writers.publish_frame(|_, _| vec![4]);
            assert!(feed.frame().ends_with(&[vec![4].into()]));
            assert!(answer(&mut feed).is_ok_and(|passed| passed.is_none()));
        }
        let mut refused = (0..100_000).filter_map(|_| answer(&mut feed).err());
        let closing = refused.next().map(|closing| closing.code);
        assert_eq!(closing, Some(close_code::POLICY));
    }
}
