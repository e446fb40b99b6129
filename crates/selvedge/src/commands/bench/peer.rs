//! Another program that runs the same networks, asked run by run so that both are measured on the
//! same machine in the same minutes.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use anyhow::{Context, bail, ensure};
use selvedge_cloth::{Arc, Topology};
use selvedge_model::ModelSpec;
use serde_json::json;

/// The other program at work.
pub(crate) struct Peer {
    command: String,
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

impl Peer {
    /// Starts `command` (a program and its arguments, split at spaces) and tells it the network.
    ///
    /// # Errors
    /// When it cannot be started, or does not get ready.
    pub(crate) fn start(
        command: &str,
        spec: &ModelSpec,
        topology: &Topology,
        threads: usize,
    ) -> anyhow::Result<Self> {
        Self::start_many(command, spec, topology, 1, threads)
    }

    /// The same for several such cloths side by side.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub(crate) fn start_many(
        command: &str,
        spec: &ModelSpec,
        topology: &Topology,
        cloths: usize,
        threads: usize,
    ) -> anyhow::Result<Self> {
        let mut words = command.split_whitespace();
        let Some(program) = words.next() else {
            bail!("--against names no program");
        };
        let mut child = Command::new(program)
            .args(words)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("starting {command:?}"))?;
        let (Some(to), Some(from)) = (child.stdin.take(), child.stdout.take()) else {
            bail!("{command:?} has no input or no output");
        };
        let mut peer = Self {
            command: command.to_owned(),
            child,
            to,
            from: BufReader::new(from),
        };
        let arcs = topology.arcs();
        let vertices = topology.vertex_count();
        let all = |end: fn(&Arc) -> u32| -> Vec<u32> {
            let cloth = |cloth: usize| {
                arcs.iter()
                    .map(move |arc| end(arc) + (cloth * vertices) as u32)
            };
            (0..cloths).flat_map(cloth).collect()
        };
        let (senders, receivers) = (all(|arc| arc.sender.0), all(|arc| arc.receiver.0));
        let network = json!({
            "spec": spec,
            "vertices": cloths * vertices,
            "node_width": spec.node_width(),
            "edge_width": spec.edge_width(),
            "senders": senders,
            "receivers": receivers,
            "threads": threads,
        });
        let answer = peer.ask(&network.to_string())?;
        ensure!(
            answer == "ready",
            "{command:?} answered {answer:?} instead of ready"
        );
        Ok(peer)
    }

    /// The other program's time of one "frame" or "step" `[ms]`.
    ///
    /// # Errors
    /// When it does not answer with a number.
    pub(crate) fn run(&mut self, what: &str) -> anyhow::Result<f64> {
        let answer = self.ask(what)?;
        let elapsed_ms: f64 = answer
            .parse()
            .with_context(|| format!("{:?} answered {answer:?} to {what:?}", self.command))?;
        ensure!(elapsed_ms > 0.0, "{:?} answered {answer:?}", self.command);
        Ok(elapsed_ms)
    }

    fn ask(&mut self, line: &str) -> anyhow::Result<String> {
        let context = || format!("asking {:?}", self.command);
        writeln!(self.to, "{line}").with_context(context)?;
        self.to.flush().with_context(context)?;
        let mut answer = String::new();
        self.from.read_line(&mut answer).with_context(context)?;
        ensure!(
            !answer.is_empty(),
            "{:?} ended without an answer: it may say why above",
            self.command
        );
        Ok(answer.trim().to_owned())
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
