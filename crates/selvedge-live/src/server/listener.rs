//! A listener with room for a number of connections. When it is full, a new one takes the place of
//! the oldest over which nothing has been sent yet; where there is none, others wait in the
//! system's queue. A connection without a request, or over which nothing is sent for long, is
//! closed: the silent take up no room.

use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep};

/// A first request comes within this time.
const FIRST: Duration = Duration::from_secs(5);
/// Something is sent over a connection within this time of the last.
const NEXT: Duration = Duration::from_secs(60);

pub(crate) struct BoundedListener {
    listener: TcpListener,
    room: Arc<Semaphore>,
    silent: Silent,
    /// Connections so far.
    count: u64,
}

/// Connections over which nothing has been sent yet, by their numbers: the oldest first.
#[derive(Clone, Default)]
struct Silent(Arc<Mutex<BTreeMap<u64, Option<Waker>>>>);

impl Silent {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Option<Waker>>> {
        // A panic elsewhere leaves the list as it was.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Strikes the oldest off and wakes it, to find that it is no longer there.
    fn give_up_oldest(&self) {
        let oldest = self.lock().pop_first();
        if let Some((_, Some(waker))) = oldest {
            waker.wake();
        }
    }
}

/// A connection that takes up room until it is dropped.
pub(crate) struct Connection {
    stream: TcpStream,
    /// When it is closed, if nothing is sent until then.
    deadline: Pin<Box<Sleep>>,
    _room: Option<OwnedSemaphorePermit>,
    number: u64,
    silent: Silent,
    /// True once something has been sent over it.
    is_heard: bool,
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.silent.lock().remove(&self.number);
    }
}

impl BoundedListener {
    pub(crate) fn new(listener: TcpListener, most: usize) -> Self {
        Self {
            listener,
            room: Arc::new(Semaphore::new(most)),
            silent: Silent::default(),
            count: 0,
        }
    }
}

impl Listener for BoundedListener {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        let (stream, address) = Listener::accept(&mut self.listener).await;
        if self.room.available_permits() == 0 {
            self.silent.give_up_oldest();
        }
        // The semaphore is never closed, so that there is always a permit in the end.
        let room = Arc::clone(&self.room).acquire_owned().await.ok();
        // Frames are whole messages: waiting to fill a packet only delays them. A connection that
        // refuses the setting works without.
        let _ = stream.set_nodelay(true);
        self.count += 1;
        let number = self.count;
        self.silent.lock().insert(number, None);
        let connection = Connection {
            stream,
            deadline: Box::pin(sleep(FIRST)),
            _room: room,
            number,
            silent: self.silent.clone(),
            is_heard: false,
        };
        (connection, address)
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

impl Connection {
    /// Returns `so_far`, or the end of waiting once the deadline has passed.
    fn in_time<T>(
        &mut self,
        so_far: Poll<io::Result<T>>,
        context: &mut Context<'_>,
    ) -> Poll<io::Result<T>> {
        if so_far.is_pending() && !self.is_heard {
            match self.silent.lock().get_mut(&self.number) {
                Some(waker) => *waker = Some(context.waker().clone()),
                // Another one has its place.
                None => return Poll::Ready(Err(io::ErrorKind::ConnectionAborted.into())),
            }
        }
        match so_far {
            Poll::Pending if self.deadline.as_mut().poll(context).is_ready() => {
                Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
            }
            other => other,
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        self.in_time(read, context)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        if written.is_ready() {
            if !self.is_heard {
                self.is_heard = true;
                self.silent.lock().remove(&self.number);
            }
            self.deadline.as_mut().reset(Instant::now() + NEXT);
        }
        self.in_time(written, context)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let flushed = Pin::new(&mut self.stream).poll_flush(context);
        self.in_time(flushed, context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::future::poll_fn;

    /// Writes until that is an error.
    async fn write_on(mut connection: Connection) -> io::ErrorKind {
        let bytes = vec![0_u8; 1 << 16];
        loop {
            let soon = Instant::now() + Duration::from_millis(50);
            connection.deadline.as_mut().reset(soon);
            let written =
                poll_fn(|context| Pin::new(&mut connection).poll_write(context, &bytes)).await;
            if let Err(error) = written {
                return error.kind();
            }
        }
    }

    #[test]
    fn a_connection_over_which_nothing_can_be_written_is_closed() {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        let kind = runtime.block_on(async {
            let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
            let address = listener.local_addr().unwrap();
            // Who connects and reads nothing.
            let _silent = TcpStream::connect(address).await.unwrap();
            let (stream, _) = listener.accept().await.unwrap();
            let connection = Connection {
                stream,
                deadline: Box::pin(sleep(FIRST)),
                _room: None,
                number: 1,
                silent: Silent::default(),
                is_heard: true,
            };
            tokio::time::timeout(Duration::from_secs(20), write_on(connection)).await
        });
        assert_eq!(kind.unwrap(), io::ErrorKind::TimedOut);
    }
}
