//! The viewer as a trial runs it: the program in a process of its own, and pages without a browser
//! that take up its frames and pull its handles about.

use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::Child;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_live::protocol;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

use crate::program::Program;

/// A page gives up when nothing comes for so long.
pub(crate) const SILENCE: Duration = Duration::from_secs(60);

/// The time of the viewer, in hundredths of a second, and the end of all pages.
#[derive(Default)]
pub(crate) struct Shared {
    pub(crate) now: AtomicU32,
    pub(crate) stop: AtomicBool,
}

/// The program `selvedge view`, which is ended when it is no longer needed.
pub(crate) struct Viewer {
    child: Child,
    pub(crate) address: SocketAddr,
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Viewer {
    /// Serves the scene `push.toml` in `folder`, moved by physics.
    pub(crate) fn start(program: &Program, folder: &Path) -> Result<Self> {
        // A port that is free now.
        let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
        let address = SocketAddr::from(([127, 0, 0, 1], port));
        let call = format!("view push.toml --show physics --address {address} --recordings kept");
        let child = program.command(folder, &call).spawn()?;
        let mut viewer = Self { child, address };
        let until = Instant::now() + SILENCE;
        while TcpStream::connect(address).is_err() {
            ensure!(viewer.is_alive()?, "the viewer ended early");
            ensure!(Instant::now() < until, "the viewer does not answer");
            thread::sleep(Duration::from_millis(50));
        }
        Ok(viewer)
    }

    /// The number of its process.
    pub(crate) fn process(&self) -> String {
        self.child.id().to_string()
    }

    /// Returns true while it runs.
    pub(crate) fn is_alive(&mut self) -> Result<bool> {
        Ok(self.child.try_wait()?.is_none())
    }
}

/// A page that takes up frames and pulls handles about.
pub(crate) fn page(address: SocketAddr, number: u32, seed: u64, shared: &Shared) -> Result<()> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(u64::from(number));
    let mut socket = connect(address).with_context(|| format!("page {number}"))?;
    if number == 0 {
        send(&mut socket, 19, br#"{"do":"rate","rate":4.0}"#)?;
    }
    let mut drags = 0_u32;
    while !shared.stop.load(Ordering::SeqCst) {
        let Message::Binary(bytes) = socket.read()? else {
            continue;
        };
        if bytes.get(1) != Some(&4) {
            continue;
        }
        let word = |k: usize| -> [u8; 4] {
            let part = bytes.get(4 + 4 * k..8 + 4 * k).unwrap_or(&[0; 4]);
            <[u8; 4]>::try_from(part).unwrap_or_default()
        };
        shared.now.fetch_max(
            (100.0 * f32::from_le_bytes(word(2))) as u32,
            Ordering::SeqCst,
        );
        send(&mut socket, 16, &word(1))?;
        let handles = u32::from_le_bytes(word(5));
        if handles > 0 && rng.random_ratio(1, 20) {
            let chosen = 8 + 4 * rng.random_range(0..handles as usize);
            let goal = Vec3::from_array([1, 2, 3].map(|k| f32::from_le_bytes(word(chosen + k))));
            let shift = Vec3::from_array([0; 3].map(|_| rng.random_range(-0.02..0.02)));
            drags += 1;
            let mut drag = [drags.to_le_bytes(), 1_u32.to_le_bytes(), word(chosen)].concat();
            let goal = (goal + shift).clamp(Vec3::splat(-1.0), Vec3::splat(1.0));
            drag.extend(goal.to_array().map(f32::to_le_bytes).concat());
            send(&mut socket, 17, &drag)?;
        }
    }
    Ok(())
}

fn connect(address: SocketAddr) -> Result<WebSocket<TcpStream>> {
    let mut request = format!("ws://{address}/socket").into_client_request()?;
    let protocol = format!("selvedge.v{}", protocol::VERSION).parse()?;
    request
        .headers_mut()
        .insert("Sec-WebSocket-Protocol", protocol);
    let stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(SILENCE))?;
    let (socket, _) =
        tungstenite::client(request, stream).map_err(|error| anyhow::anyhow!("{error}"))?;
    Ok(socket)
}

fn send(socket: &mut WebSocket<TcpStream>, kind: u8, body: &[u8]) -> Result<()> {
    let message = [&[protocol::VERSION, kind, 0, 0], body].concat();
    Ok(socket.send(Message::Binary(message.into()))?)
}
