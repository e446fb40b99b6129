//! `selvedge view`: the live viewer.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use selvedge_data::{Trajectory, ending_of};
use selvedge_live::{NamedTrack, Opening, Replay, RunningServer, serve, start};
use selvedge_workshop::SceneWorkshop;
use serde_json::json;

use crate::cli::ViewArgs;
use crate::failure::wrong;
use crate::interrupt;
use crate::output::{Answer, Facts};

/// The scene to go live with from a recording.
const FALLBACK_SCENE: &str = "default";

/// Serves the viewer until Ctrl-C.
pub(crate) fn run(args: &ViewArgs) -> anyhow::Result<Answer> {
    let replay = replay(args)?;
    let scene = match replay {
        Some(_) => FALLBACK_SCENE,
        None => &args.subject,
    };
    let workshop = SceneWorkshop::new(scene, &args.model, args.machine.open()?)?;
    if replay.is_none() {
        // What is wrong with the scene is said here and now, not in the page.
        crate::scenes::open(scene)?;
    }
    let opening = Opening {
        order: workshop.first_order(),
        mover: args.show,
        replay,
    };
    let session = start(Box::new(workshop), opening, args.recordings.clone());
    let session = session.context("starting the session")?;
    let names = args.allow_host.clone();
    let server = serve(args.address, names, &session).with_context(|| {
        format!(
            "{}: cannot be listened at (another address with --address)",
            args.address
        )
    })?;
    let address = announce(&server, args);
    // A recording may be under way.
    interrupt::keep_results();
    while !interrupt::requested() {
        std::thread::sleep(Duration::from_millis(50));
    }
    server.close();
    session.close();
    let mut facts = Facts::new();
    facts.add("served", &address);
    let report = json!({ "address": address, "recordings": args.recordings });
    Ok(facts.answer(report))
}

/// Says where the page is, and opens it if that is wanted.
fn announce(server: &RunningServer, args: &ViewArgs) -> String {
    let address = format!("http://{}/", server.address());
    // Where standard error is closed nobody can be told.
    let _ = writeln!(std::io::stderr(), "the cloth is at {address} (Ctrl-C ends)");
    if args.open && !open_browser(&address) {
        let _ = writeln!(std::io::stderr(), "no browser was found: open it yourself");
    }
    address
}

/// Hands the address to the system's way of opening pages.
fn open_browser(address: &str) -> bool {
    let (program, arguments): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("cmd", &["/C", "start", ""])
    } else {
        ("xdg-open", &[])
    };
    let mut command = std::process::Command::new(program);
    command.args(arguments).arg(address);
    let silent = std::process::Stdio::null;
    command.stdout(silent()).stderr(silent()).spawn().is_ok()
}

/// The recordings to play, if it is recordings.
fn replay(args: &ViewArgs) -> anyhow::Result<Option<Replay>> {
    if ending_of(Path::new(&args.subject)) != "safetensors" {
        return match args.beside {
            Some(_) => Err(wrong("--beside needs a trajectory to stand beside")),
            None => Ok(None),
        };
    }
    let mut tracks = vec![track(Path::new(&args.subject))?];
    if let Some(beside) = &args.beside {
        tracks.push(track(beside)?);
    }
    Ok(Some(Replay::new(args.subject.clone(), tracks)?))
}

fn track(path: &Path) -> anyhow::Result<NamedTrack> {
    let trajectory = Arc::new(Trajectory::read(path)?);
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = name.into_owned();
    Ok(NamedTrack { name, trajectory })
}
