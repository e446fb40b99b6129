//! A listener with room for a number of connections. When it is full, others wait in the system's
//! queue. A connection without a request, or over which nothing is sent for long, is closed: the
//! silent take up no room.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
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

/// A listener with a bound.
pub(crate) struct BoundedListener {
    listener: TcpListener,
    room: Arc<Semaphore>,
}

/// A connection that takes up room until it is dropped.
pub(crate) struct Connection {
    stream: TcpStream,
    /// When it is closed, if nothing is sent until then.
    deadline: Pin<Box<Sleep>>,
    _room: Option<OwnedSemaphorePermit>,
}

impl BoundedListener {
    pub(crate) fn new(listener: TcpListener, most: usize) -> Self {
        Self {
            listener,
            room: Arc::new(Semaphore::new(most)),
        }
    }
}

impl Listener for BoundedListener {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        // The semaphore is never closed, so that there is always a permit in the end.
        let room = Arc::clone(&self.room).acquire_owned().await.ok();
        let (stream, address) = Listener::accept(&mut self.listener).await;
        // Frames are whole messages: waiting to fill a packet only delays them. A connection that
        // refuses the setting works without.
        let _ = stream.set_nodelay(true);
        let connection = Connection {
            stream,
            deadline: Box::pin(sleep(FIRST)),
            _room: room,
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
            };
            tokio::time::timeout(Duration::from_secs(20), write_on(connection)).await
        });
        assert_eq!(kind.unwrap(), io::ErrorKind::TimedOut);
    }
}
