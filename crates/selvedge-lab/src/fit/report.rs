//! The files of a fit: a report for people and one for programs, and what was found as parts of scenes.

use std::fmt::{self, Write as _};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use selvedge_data::{StartSpec, StateChoice, StateRun, write_atomically};

use super::{Fitted, Number, Order};
use crate::folder::FITTED;
use crate::physics;

/// Part of a direction below which a number is not named.
const NAMED: f64 = 0.2;

/// Writes into `folder`, which exists: `report.md`, `run.safetensors`, of what was found `fabric.toml`,
/// `start.safetensors` and `motion.toml`, and at the end `fit.json`. Returns the files.
///
/// # Errors
/// A file that cannot be written.
pub fn write(folder: &Path, order: &Order, fitted: &Fitted) -> Result<Vec<PathBuf>> {
    let (scene, start) = (&fitted.scene, &fitted.start);
    let mut spec = order.loaded.spec.clone();
    let is_at_rest = spec.start == StartSpec::Rest;
    (spec.setting.material, spec.motion) = (scene.material.clone(), scene.motion.clone());
    spec.setting.environment = scene.environment;
    let mut wrote = Vec::new();
    let mut place = |name: &str| {
        wrote.push(folder.join(name));
        folder.join(name)
    };
    let has = |part| {
        order
            .numbers
            .iter()
            .any(|number| number.name.starts_with(part))
    };
    let text = |path: PathBuf, text: &[u8]| write_atomically(&path, |out| out.write_all(text));
    if has("material.") {
        text(
            place("fabric.toml"),
            toml::to_string(&scene.material)?.as_bytes(),
        )?;
    }
    if has("motion.") {
        text(
            place("motion.toml"),
            toml::to_string(&scene.motion)?.as_bytes(),
        )?;
    }
    if has("start.") {
        let path = place("start.safetensors");
        let states = vec![start.clone()];
        StateRun { states }.write(&path, &physics::provenance(&order.loaded.spec, scene)?)?;
        let mut choice = StateChoice::default();
        choice.file = path.to_string_lossy().into_owned();
        spec.start = StartSpec::State(choice.read(Path::new(""), start.positions.len())?.1);
    }
    let rest = if is_at_rest { &start.positions[..] } else { scene.mesh.positions() };
    let run = physics::trajectory(start.frame, &spec, scene, rest, fitted.positions.clone())?;
    run.write(&place("run.safetensors"))?;
    text(place("report.md"), page(fitted).as_bytes())?;
    text(place(FITTED), &serde_json::to_vec_pretty(fitted)?)?;
    Ok(wrote)
}

/// Four digits that count.
fn short(value: f64) -> String {
    let is_small = value != 0.0 && value.abs() < 0.1;
    if is_small { format!("{value:.3e}") } else { format!("{value:.4}") }
}

impl fmt::Display for Number {
    /// The name, and the value with its error.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit, value) = (&self.name, self.unit, self.value);
        let error = match self.error {
            Some(error) if self.is_scale => format!(" ± {:.2} %", 100.0 * error / value),
            Some(error) => format!(" ± {}", short(error)),
            None => String::new(),
        };
        let is_at_bound = self.bounds.contains(&value);
        let bound = if is_at_bound { "(at its bound)" } else { "" };
        let text = format!("{name} {}{error} {unit} {bound}", short(value));
        f.write_str(text.trim_end())
    }
}

fn page(fitted: &Fitted) -> String {
    let [rms, noise] = [fitted.rms, fitted.noise].map(|metres| 1e3 * metres);
    let ([runs, back], name) = (fitted.runs, &fitted.scene.name);
    let mut page = format!(
        "# Fit of {name}\n\n{} marks; root mean square distance of a coordinate {rms:.3} mm, noise {noise:.3} mm.\n\
        {runs} runs forward, {back} back, {} failed. Searches, distance from and to [mm]: {:.3?}.\n\n\
        | found | in the scene | bounds |\n|---|---|---|\n",
        fitted.marks, fitted.failed, fitted.searches
    );
    for number in &fitted.numbers {
        let ([low, high], first) = (number.bounds, short(number.first));
        let _ = writeln!(page, "| {number} | {first} | {low} to {high} |");
    }
    let Some(directions) = &fitted.directions else {
        return page + "\nInterrupted: the best numbers by then. What the data tell is unknown.\n";
    };
    page += "\n## What the data tell\n\nEigenvectors of the Gauss-Newton matrix, in parts of the bounds (of logarithms for \
        scales), and the error to which the data tell the numbers along each. Beyond a tenth of the \
        bounds they do not.\n\n| eigenvalue | error | | numbers |\n|---|---|---|---|\n";
    for direction in directions {
        let error = direction.error.map_or(f64::INFINITY, |error| 100.0 * error);
        let told = if direction.is_told { "told" } else { "**not told**" };
        let _ = write!(
            page,
            "| {:.3e} | {error:.2} % | {told} |",
            direction.eigenvalue
        );
        for (part, number) in direction.way.iter().zip(&fitted.numbers) {
            if part.abs() >= NAMED {
                let _ = write!(page, " {part:+.2} {}", number.name);
            }
        }
        page += " |\n";
    }
    page
}
