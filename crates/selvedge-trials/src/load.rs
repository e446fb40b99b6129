//! Load on the viewer: half-open connections, many pages, and requests without end. A page must be
//! answered soon all the same, and the cloth must go on.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};

use crate::fuzz::SCENE;
use crate::program::Program;
use crate::viewer::{self, Shared, Viewer};

/// Requests that are timed under each load.
const REQUESTS: usize = 20;
/// A page that takes longer is delayed.
const LONGEST: Duration = Duration::from_secs(3);
/// Threads that ask without end.
const ASKERS: usize = 4;
/// Time in which the cloth is looked at.
const SPAN: Duration = Duration::from_secs(5);

/// One kind of load.
struct Load {
    name: &'static str,
    half_open: usize,
    pages: u32,
    askers: usize,
}

/// Returns false where a page was delayed, or the cloth stood still.
///
/// # Errors
/// A viewer that failed.
pub(crate) fn run(half_open: usize, pages: u32, seed: u64) -> Result<bool> {
    let folder = tempfile::tempdir().context("a folder to work in")?;
    std::fs::write(folder.path().join("push.toml"), SCENE)?;
    let program = Program::find()?;
    println!("| load | page, ms: median | most | frames per second of the cloth | held |");
    println!("|---|---|---|---|---|");
    let mut holds = true;
    let load = |name, half_open, pages, askers| Load {
        name,
        half_open,
        pages,
        askers,
    };
    for load in [
        load("one page", 0, 1, 0),
        load("half-open connections", half_open, 1, 0),
        load("pages", 0, pages, 0),
        load("requests without end", 0, 1, ASKERS),
        load("all of these", half_open, pages, ASKERS),
    ] {
        holds &= trial(&program, folder.path(), &load, seed)?;
    }
    Ok(holds)
}

fn trial(program: &Program, folder: &Path, load: &Load, seed: u64) -> Result<bool> {
    let mut viewer = Viewer::start(program, folder)?;
    let address = viewer.address;
    let shared = Shared::default();
    let (asked, over) = (AtomicU64::new(0), AtomicBool::new(false));
    let frames = AtomicU32::new(0);
    let measured = thread::scope(|scope| -> Result<(Vec<Duration>, f64)> {
        for number in 0..load.pages {
            let shared = &shared;
            scope.spawn(move || {
                if let Err(error) = viewer::page(address, number, seed, shared) {
                    eprintln!("{}: {error:#}", load.name);
                    shared.failed.store(true, Ordering::SeqCst);
                }
            });
        }
        for _ in 0..load.askers {
            scope.spawn(|| {
                while !over.load(Ordering::SeqCst) {
                    // One that is refused is asked for again.
                    asked.fetch_add(u64::from(ask(address).is_ok()), Ordering::SeqCst);
                }
            });
        }
        let measured = under(address, load, &shared);
        frames.store(shared.now.load(Ordering::SeqCst), Ordering::SeqCst);
        over.store(true, Ordering::SeqCst);
        shared.stop.store(true, Ordering::SeqCst);
        measured
    });
    let (mut times, rate) = measured?;
    ensure!(viewer.is_alive()?, "{}: the viewer ended", load.name);
    times.sort();
    let milliseconds = |time: &Duration| 1e3 * time.as_secs_f64();
    let most = times.last().copied().unwrap_or(Duration::MAX);
    let failed = shared.failed.load(Ordering::SeqCst);
    let held = most < LONGEST && rate > 1.0 && !failed;
    println!(
        "| {} ({} half-open, {} pages, {} asking, {} answers) | {:.1} | {:.1} | {rate:.1} | {} |",
        load.name,
        load.half_open,
        load.pages,
        load.askers,
        asked.load(Ordering::SeqCst),
        times.get(times.len() / 2).map_or(f64::NAN, milliseconds),
        milliseconds(&most),
        if held { "yes" } else { "NO" }
    );
    Ok(held)
}

/// Times of requests for the page under this load, and frames per second of the cloth.
fn under(address: SocketAddr, load: &Load, shared: &Shared) -> Result<(Vec<Duration>, f64)> {
    let silent: Vec<TcpStream> = (0..load.half_open)
        .map(|number| -> Result<TcpStream> {
            let mut stream = TcpStream::connect(address)?;
            if number % 2 == 1 {
                // The beginning of a request, and no more.
                stream.write_all(b"GET / HTTP/1.1\r\nHost: ")?;
            }
            Ok(stream)
        })
        .collect::<Result<_>>()?;
    let mut times = Vec::new();
    for _ in 0..REQUESTS {
        let began = Instant::now();
        ask(address).context("a request for the page")?;
        times.push(began.elapsed());
    }
    drop(silent);
    let before = (shared.now.load(Ordering::SeqCst), Instant::now());
    thread::sleep(SPAN);
    let hundredths = shared.now.load(Ordering::SeqCst) - before.0;
    let simulated = f64::from(hundredths) / 100.0;
    Ok((times, 60.0 * simulated / before.1.elapsed().as_secs_f64()))
}

/// Asks for the page and reads it.
fn ask(address: SocketAddr) -> Result<()> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(2 * LONGEST))?;
    write!(
        stream,
        "GET / HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n"
    )?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer)?;
    ensure!(answer.starts_with("HTTP/1.1 200"), "not answered with 200");
    ensure!(answer.contains("</html>"), "not answered whole");
    Ok(())
}
