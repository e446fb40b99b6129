//! The files of a fit: a report for people and one for programs, and what was found as parts of scenes.

use std::fmt::{self, Write as _};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use selvedge_data::{StartSpec, StateChoice, StateRun, write_atomically};

use super::{Fitted, Found, Order};
use crate::event::End;
use crate::folder::FITTED;
use crate::physics;

/// Share of a direction below which a number is not named.
const NAMED: f64 = 0.2;

/// Writes into `folder`, which exists: `report.md`, `run.safetensors`, of what was found `fabric.toml`,
/// `start.safetensors` and `motion.toml`, and at the end `fit.json`. Returns the files.
///
/// # Errors
/// A file that cannot be written.
pub fn write(folder: &Path, order: &Order, fitted: &Fitted) -> Result<Vec<PathBuf>> {
    let mut wrote = Vec::new();
    let mut text = |name: &str, text: String| -> Result<()> {
        let path = folder.join(name);
        write_atomically(&path, |out| out.write_all(text.as_bytes()))?;
        wrote.push(path);
        Ok(())
    };
    let has = |part: &str| {
        order
            .numbers
            .iter()
            .any(|number| number.name.starts_with(part))
    };
    let (scene, mut spec) = (&fitted.scene, order.loaded.spec.clone());
    let mut material = scene.material.clone();
    if has("material.") {
        material.source = format!("{}; fitted in the scene {:?}", material.source, scene.name);
        text(
            "fabric.toml",
            toml::to_string(&material).context("writing the fabric")?,
        )?;
    }
    if has("motion.") {
        text(
            "motion.toml",
            toml::to_string(&scene.motion).context("writing the motion")?,
        )?;
    }
    text("report.md", page(order, fitted))?;
    spec.setting.material = material;
    spec.setting.environment = scene.environment;
    spec.motion = scene.motion.clone();
    let at_rest = spec.start == StartSpec::Rest;
    if has("start.") {
        let path = folder.join("start.safetensors");
        let states = StateRun {
            states: vec![fitted.start.clone()],
        };
        states.write(&path, &physics::provenance(&order.loaded.spec, scene)?)?;
        let file = path.to_string_lossy().into_owned();
        let choice = StateChoice {
            file,
            ..StateChoice::default()
        };
        spec.start = StartSpec::State(choice.read(Path::new(""), fitted.start.positions.len())?.1);
        wrote.push(path);
    }
    let rest = if at_rest { &fitted.start.positions[..] } else { scene.mesh.positions() };
    let first = fitted.start.frame;
    let run = physics::trajectory(first, &spec, scene, rest, fitted.positions.clone())?;
    let path = folder.join("run.safetensors");
    run.write(&path)?;
    wrote.push(path);
    let path = folder.join(FITTED);
    let json = serde_json::to_vec_pretty(fitted)?;
    write_atomically(&path, |out| out.write_all(&json))?;
    wrote.push(path);
    Ok(wrote)
}

impl Found {
    /// The value with its error.
    fn value_in_words(&self) -> String {
        let (value, unit) = (self.value, self.number.unit);
        let error = match self.error {
            Some(error) if self.number.is_scale => format!(" ± {:.1} %", 100.0 * error / value),
            Some(error) => format!(" ± {error:.4}"),
            None => String::new(),
        };
        format!("{value:.4}{error} {unit}").trim_end().to_owned()
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.number.name, self.value_in_words())
    }
}

fn page(order: &Order, fitted: &Fitted) -> String {
    let scene = &fitted.scene.name;
    let mut page = format!(
        "# Fit of {scene}\n\n{} marks in {} frames; root mean square distance of a coordinate {:.3} mm, noise {:.3} mm{}.\n",
        fitted.marks,
        order.frames() + 1,
        1e3 * fitted.rms,
        1e3 * fitted.noise,
        if order.noise.is_some() { "" } else { " (from what is left)" }
    );
    if fitted.end == End::Interrupted {
        page += "\nInterrupted: these are the best numbers by then, and nobody has looked at what the data tell.\n";
    }
    page += "\n| number | in the scene | found | bounds | |\n|---|---|---|---|---|\n";
    for found in &fitted.numbers {
        let Found {
            number,
            is_at_bound,
            ..
        } = found;
        let [low, high] = number.bounds;
        let (name, unit, first) = (&number.name, number.unit, number.first);
        let told = match (found.error, &fitted.directions) {
            _ if *is_at_bound => "at its bound",
            (None, Some(_)) => "not told",
            _ => "",
        };
        let value = found.value_in_words();
        let _ = writeln!(
            page,
            "| {name} | {first:.4} {unit} | {value} | {low} to {high} | {told} |"
        );
    }
    if let Some(directions) = &fitted.directions {
        page += "\n## What the data tell\n\nEigenvectors of the Gauss-Newton matrix, in parts of the bounds (of logarithms for scales): along each the \
            numbers are known to within its error. Beyond a tenth of the bounds the data do not tell it.\n\n\
            | eigenvalue | error | | numbers |\n|---|---|---|---|\n";
        for direction in directions {
            let numbers = direction.way.iter().zip(&fitted.numbers);
            let named = numbers.filter(|(part, _)| part.abs() >= NAMED);
            let named = named.map(|(part, found)| format!("{part:+.2} {}", found.number.name));
            let named = named.collect::<Vec<_>>().join(", ");
            let error = direction.error.map_or("unbounded".to_owned(), |error| {
                format!("{:.2} %", 100.0 * error)
            });
            let told = if direction.is_told { "told" } else { "**not told**" };
            let _ = writeln!(
                page,
                "| {:.3e} | {error} | {told} | {named} |",
                direction.eigenvalue
            );
        }
    }
    page += "\n## Searches\n\n| start | from | to | runs | runs back |\n|---|---|---|---|---|\n";
    for (number, search) in fitted.searches.iter().enumerate() {
        let start = if number == 0 { "the scene's".to_owned() } else { format!("random {number}") };
        let rms = search
            .rms
            .map(|both| both.map(|rms| format!("{:.3} mm", 1e3 * rms)));
        let [from, to] = rms.unwrap_or(["failed".to_owned(), String::new()]);
        let [runs, back] = search.runs;
        let _ = writeln!(page, "| {start} | {from} | {to} | {runs} | {back} |");
    }
    if fitted.failed > 0 {
        let _ = writeln!(
            page,
            "\n{} runs failed; the searches took shorter steps there.",
            fitted.failed
        );
    }
    page
}
