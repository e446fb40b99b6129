//! The web server: the page, and one socket for each that watches.
//!
//! One thread serves all. It keeps nothing per page but the messages on their way to it. The
//! numbers of pages and of messages per second are bounded, and so is the length of a message.

mod gate;
mod page;
mod socket;

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::JoinHandle;

use axum::Router;
use axum::body::Body;
use axum::extract::{Request, State, WebSocketUpgrade};
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::any;
use axum::serve::ListenerExt;
use tokio::sync::{Semaphore, watch};

use self::gate::Gate;
use crate::protocol::{LONGEST, SUBPROTOCOL};
use crate::session::{RunningSession, SessionPort};

/// Pages that may watch at once.
pub const MOST_PAGES: usize = 32;

/// A server that runs.
pub struct RunningServer {
    address: SocketAddr,
    stop: watch::Sender<bool>,
    thread: JoinHandle<()>,
}

/// The session that is served, and the counters of its pages: what all connections share.
#[derive(Clone)]
struct Shared {
    session: SessionPort,
    gate: Arc<Gate>,
    /// Room for pages that watch.
    places: Arc<Semaphore>,
    next_client: Arc<AtomicU32>,
    /// True when the server ends.
    stop: watch::Receiver<bool>,
    viewers: Arc<watch::Sender<usize>>,
}

/// Starts to serve `session` at `address`; `names` are those under which the program may be addressed,
/// beside `localhost` and addresses in numbers.
pub fn serve(
    address: SocketAddr,
    names: Vec<String>,
    session: &RunningSession,
) -> io::Result<RunningServer> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let (stop, stopped) = watch::channel(false);
    let shared = Shared {
        session: session.port().clone(),
        gate: Arc::new(Gate { names }),
        places: Arc::new(Semaphore::new(MOST_PAGES)),
        next_client: Arc::new(AtomicU32::new(1)),
        stop: stopped,
        viewers: Arc::new(watch::channel(0).0),
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let thread = std::thread::Builder::new()
        .name("server".to_owned())
        .spawn(move || runtime.block_on(answer(listener, shared)))?;
    Ok(RunningServer {
        address,
        stop,
        thread,
    })
}

impl RunningServer {
    /// The address at which the server listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Closes every socket and ends.
    pub fn close(self) {
        self.stop.send_replace(true);
        // A server that has panicked has said so on standard error.
        let _ = self.thread.join();
    }
}

async fn answer(listener: TcpListener, shared: Shared) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else {
        return;
    };
    // A frame is not to wait for the next. Without it, it is only late.
    let listener = listener.tap_io(|stream| drop(stream.set_nodelay(true)));
    let mut stop = shared.stop.clone();
    let routes = Router::new()
        .route("/socket", any(open_socket))
        .fallback(file)
        .layer(from_fn_with_state(shared.clone(), guard))
        .with_state(shared);
    let serving = axum::serve(listener, routes);
    tokio::select! {
        _ = serving => {}
        _ = stop.wait_for(|stop| *stop) => {
            // The farewell to the pages is on its way.
            tokio::time::sleep(std::time::Duration::from_millis(100)).await;
        }
    }
}

/// Refuses requests to other names, and tells browsers the bounds of the page.
async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    if let Err(refusal) = shared.gate.check(request.headers()) {
        return (StatusCode::FORBIDDEN, refusal.text()).into_response();
    }
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    for (name, value) in [
        (
            header::CONTENT_SECURITY_POLICY,
            "default-src 'self'; img-src 'self' blob: data:; media-src blob:; \
             style-src 'self' 'unsafe-inline'; object-src 'none'; base-uri 'none'; \
             form-action 'none'; frame-ancestors 'none'",
        ),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-cache"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// A file of the page, if there is one at exactly this path.
async fn file(request: Request) -> Response {
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return (StatusCode::METHOD_NOT_ALLOWED, "only GET is answered").into_response();
    }
    match page::at(request.uri().path()) {
        Some((kind, bytes)) => ([(header::CONTENT_TYPE, kind)], Body::from(bytes)).into_response(),
        None => (StatusCode::NOT_FOUND, "there is no such file").into_response(),
    }
}

async fn open_socket(
    State(shared): State<Shared>,
    upgrade: Result<WebSocketUpgrade, axum::extract::ws::rejection::WebSocketUpgradeRejection>,
    request: Request,
) -> Response {
    if let Err(refusal) = shared.gate.check_socket(request.headers()) {
        return (StatusCode::FORBIDDEN, refusal.text()).into_response();
    }
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade.protocols([SUBPROTOCOL]),
        Err(rejection) => return rejection.into_response(),
    };
    if upgrade.selected_protocol().is_none() {
        let problem = format!("this program speaks {SUBPROTOCOL}: reload the page");
        return (StatusCode::BAD_REQUEST, problem).into_response();
    }
    let Ok(place) = Arc::clone(&shared.places).try_acquire_owned() else {
        let problem = format!("{MOST_PAGES} pages watch already: close one");
        return (StatusCode::SERVICE_UNAVAILABLE, problem).into_response();
    };
    let client = shared.next_client.fetch_add(1, Ordering::Relaxed);
    upgrade
        .max_message_size(LONGEST)
        .max_frame_size(LONGEST)
        .write_buffer_size(0)
        .on_upgrade(move |socket| async move {
            socket::watch(socket, client, shared).await;
            drop(place);
        })
}
