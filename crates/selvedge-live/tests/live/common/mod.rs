//! A session of a cloth that anyone can predict, served to a client that speaks the wire by hand.

use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use glam::Vec3;
use selvedge_live::{Mover, Opening, RunningServer, RunningSession, serve, start};
use serde_json::Value;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::Request;
use tungstenite::{Message, WebSocket};

#[path = "../../../src/test_cloth.rs"]
mod test_cloth;

pub(crate) use test_cloth::CORNERS;
use test_cloth::{TestWorkshop, order};

/// Time that anything may take: a busy machine may stand still for seconds.
const PATIENCE: Duration = Duration::from_secs(40);

/// A name under which the server may be addressed.
pub(crate) const NAME: &str = "studio.example";

/// A session that is served.
pub(crate) struct Served {
    pub(crate) session: RunningSession,
    pub(crate) server: RunningServer,
}

/// Serves a session of which a step takes `cost`, recording to `folder`.
pub(crate) fn served(cost: Duration, folder: PathBuf) -> Served {
    let opening = Opening {
        order: order("corners"),
        mover: Mover::Physics,
        replay: None,
    };
    let workshop = Box::new(TestWorkshop {
        cost,
        ..TestWorkshop::default()
    });
    let session = start(workshop, opening, folder).unwrap();
    let address = SocketAddr::from(([127, 0, 0, 1], 0));
    let server = serve(address, vec![NAME.to_owned()], &session).unwrap();
    Served { session, server }
}

/// Serves a session whose steps take no time.
pub(crate) fn quick() -> Served {
    served(Duration::ZERO, std::env::temp_dir())
}

impl Served {
    pub(crate) fn close(self) {
        self.server.close();
        self.session.close();
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.server.address()).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_write_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    pub(crate) fn request(&self) -> Request<()> {
        let uri = format!("ws://{}/socket", self.server.address());
        let mut request = uri.into_client_request().unwrap();
        let headers = request.headers_mut();
        headers.insert("Sec-WebSocket-Protocol", "selvedge.v3".parse().unwrap());
        request
    }

    /// A page that has come in.
    pub(crate) fn page(&self) -> Page {
        let (socket, _) = tungstenite::client(self.request(), self.connect()).unwrap();
        Page { socket }
    }

    /// A page that has seen the cloth: what it does before that is done to nothing.
    pub(crate) fn ready_page(&self) -> Page {
        let mut page = self.page();
        page.frame(|_| true);
        page
    }

    /// The status with which a request for a socket is answered.
    pub(crate) fn status(&self, change: impl FnOnce(&mut Request<()>)) -> u16 {
        let mut request = self.request();
        change(&mut request);
        match tungstenite::client(request, self.connect()) {
            Ok(_) => 101,
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
                response.status().as_u16()
            }
            Err(error) => panic!("{error}"),
        }
    }
}

/// The client's side of the wire.
pub(crate) struct Page {
    pub(crate) socket: WebSocket<TcpStream>,
}

/// A frame as it came.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    pub(crate) number: u32,
    pub(crate) drag: [u32; 2],
    pub(crate) handles: Vec<u32>,
    pub(crate) tracks: Vec<Vec<Vec3>>,
}

impl Page {
    pub(crate) fn send(&mut self, kind: u8, body: &[u8]) {
        let bytes = [&[3, kind, 0, 0], body].concat();
        self.socket.send(Message::Binary(bytes.into())).unwrap();
    }

    pub(crate) fn command(&mut self, json: &str) {
        self.send(19, json.as_bytes());
    }

    pub(crate) fn drag(&mut self, number: u32, vertex: u32, goal: Vec3) {
        let mut body = Vec::new();
        for word in [number, 1, vertex] {
            body.extend(word.to_le_bytes());
        }
        for part in goal.to_array() {
            body.extend(part.to_le_bytes());
        }
        self.send(17, &body);
    }

    /// Holds keys down that push this way, of which one is full.
    pub(crate) fn keys(&mut self, direction: Vec3) {
        let [x, y, z] = direction.to_array();
        let body: Vec<u8> = [x, y, z, 0.0]
            .iter()
            .flat_map(|part: &f32| part.to_le_bytes())
            .collect();
        self.send(18, &body);
    }

    /// The next binary message; frames are acknowledged.
    pub(crate) fn next(&mut self) -> Result<Vec<u8>, tungstenite::Error> {
        loop {
            match self.socket.read()? {
                Message::Binary(bytes) => {
                    if bytes[1] == 4 {
                        let number = bytes[8..12].to_vec();
                        self.send(16, &number);
                    }
                    return Ok(bytes.to_vec());
                }
                Message::Close(Some(frame)) => panic!("closed: {} {}", frame.code, frame.reason),
                _ => {}
            }
        }
    }

    /// The next frame for which `wanted`.
    pub(crate) fn frame(&mut self, wanted: impl Fn(&Frame) -> bool) -> Frame {
        self.until(4, read_frame, wanted)
    }

    /// The next state for which `wanted`.
    pub(crate) fn state(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        let read = |bytes: &[u8]| serde_json::from_slice(&bytes[4..]).unwrap();
        self.until(3, read, wanted)
    }

    /// The next message of this kind for which `wanted`.
    fn until<T>(&mut self, kind: u8, read: impl Fn(&[u8]) -> T, wanted: impl Fn(&T) -> bool) -> T {
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            let bytes = self.next().unwrap();
            let message = (bytes[1] == kind).then(|| read(&bytes));
            if let Some(message) = message.filter(&wanted) {
                return message;
            }
        }
        panic!("no such message of kind {kind} came");
    }

    /// Code and reason with which the server closes.
    pub(crate) fn closed(mut self) -> (u16, String) {
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            match self.socket.read() {
                Ok(Message::Close(Some(frame))) => {
                    return (frame.code.into(), frame.reason.to_string());
                }
                Ok(_) => {}
                // What was still being sent was cut off.
                Err(error) => return (0, error.to_string()),
            }
        }
        panic!("the server did not close");
    }
}

fn read_frame(bytes: &[u8]) -> Frame {
    let word =
        |place: usize| u32::from_le_bytes(bytes[4 * place..4 * place + 4].try_into().unwrap());
    let [handles, tracks, vertices] = [6, 7, 8].map(|place| word(place) as usize);
    let point = |place: usize| Vec3::from_array([0, 1, 2].map(|k| f32::from_bits(word(place + k))));
    let first = 11 + 4 * handles;
    let track = |t: usize| {
        (0..vertices)
            .map(|v| point(first + 3 * (t * vertices + v)))
            .collect()
    };
    Frame {
        number: word(2),
        drag: [word(4), word(5)],
        handles: (0..handles).map(|h| word(11 + 4 * h)).collect(),
        tracks: (0..tracks).map(track).collect(),
    }
}
