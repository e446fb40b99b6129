//! The files of a fit: a report for people and one for programs, and what was found as parts of scenes.

use std::fmt::{self, Write as _};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use selvedge_data::{StartSpec, StateChoice, StateRun, write_atomically};
use serde_json::{Value, json};

use super::{Fit, Number};
use crate::folder::FITTED;
use crate::physics;

/// Part of a direction below which a number is not named.
const NAMED: f64 = 0.2;

impl Fit {
    /// Writes into `folder`, which exists: `report.md`, `run.safetensors`, of what was found `fabric.toml`,
    /// `start.safetensors` and `motion.toml`, and at the end `fit.json`. Returns the files; none where
    /// nothing was found.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let mut wrote = Vec::new();
        let Some(made) = &self.made else {
            return Ok(wrote);
        };
        let (scene, start) = (&made.scene, &made.start);
        let mut spec = self.loaded.spec.clone();
        let is_at_rest = spec.start == StartSpec::Rest;
        (spec.setting.material, spec.motion) = (scene.material.clone(), scene.motion.clone());
        spec.setting.environment = scene.environment;
        let mut place = |name: &str| {
            wrote.push(folder.join(name));
            folder.join(name)
        };
        let numbers = self.numbers.iter().map(|number| &number.name);
        let has = |part| numbers.clone().any(|name| name.starts_with(part));
        let text = |path: PathBuf, text: &[u8]| write_atomically(&path, |out| out.write_all(text));
        if has("material.") {
            let fabric = toml::to_string(&scene.material)?;
            text(place("fabric.toml"), fabric.as_bytes())?;
        }
        if has("motion.") {
            let motion = toml::to_string(&scene.motion)?;
            text(place("motion.toml"), motion.as_bytes())?;
        }
        if has("start.") {
            let path = place("start.safetensors");
            let states = vec![start.clone()];
            StateRun { states }.write(&path, &physics::provenance(&self.loaded.spec, scene)?)?;
            let choice = StateChoice {
                file: path.to_string_lossy().into_owned(),
                ..StateChoice::default()
            };
            spec.start = StartSpec::State(choice.read(Path::new(""), start.positions.len())?.1);
        }
        let rest = if is_at_rest { &start.positions[..] } else { scene.mesh.positions() };
        let run = physics::trajectory(start.frame, &spec, scene, rest, made.positions.clone())?;
        run.write(&place("run.safetensors"))?;
        text(place("report.md"), self.report().as_bytes())?;
        text(place(FITTED), &serde_json::to_vec_pretty(&self.json())?)?;
        Ok(wrote)
    }

    /// What was found, for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "scene": self.loaded.scene.name,
            "numbers": self.numbers,
            "marks": self.marks.len(),
            // At the start and the end of each search, and of a coordinate [mm].
            "searches": self.searches,
            "noise": self.noise,
            "runs": self.runs[0],
            "runs_back": self.runs[1],
            "failed": self.failures.len(),
            "directions": self.directions,
        })
    }

    /// What was found, for people: in Markdown.
    #[must_use]
    pub fn report(&self) -> String {
        let ([runs, back], name) = (self.runs, &self.loaded.scene.name);
        let left = self.made.as_ref().map_or(0.0, |made| made.value().sqrt());
        let mut page = format!(
            "# Fit of {name}\n\n{left:.3} mm off per coordinate of {} marks, noise {:.3} mm. {runs} runs, {back} also \
            back, {} failed; searches from and to [mm]: {:.3?}.\n\n\
            | found | in the scene | bounds |\n|---|---|---|\n",
            self.marks.len(),
            self.noise.unwrap_or(0.0),
            self.failures.len(),
            self.searches
        );
        for number in &self.numbers {
            let ([low, high], first) = (number.bounds, short(number.first));
            let _ = writeln!(page, "| {number} | {first} | {low} to {high} |");
        }
        if let Some(why) = self.failures.last() {
            let _ = writeln!(page, "\nThe last run that failed: {why:#}.");
        }
        let Some(directions) = &self.directions else {
            return page + "\nInterrupted: the best by then. What the data tell is unknown.\n";
        };
        page += "\n| numbers, in parts of their bounds | told to | eigenvalue |\n|---|---|---|\n";
        for direction in directions {
            let numbers = direction.way.iter().zip(&self.numbers);
            let named = numbers.filter(|(part, _)| part.abs() >= NAMED);
            let named = named.map(|(part, number)| format!("{part:+.2} {}", number.name));
            let named = named.collect::<Vec<_>>().join(" ");
            let told = if direction.is_told { "" } else { ": not told" };
            let (error, eigenvalue) = (100.0 * direction.error, direction.eigenvalue);
            let _ = writeln!(page, "| {named} | {error:.2} %{told} | {eigenvalue:.2e} |");
        }
        page
    }
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
            error if error.is_nan() => String::new(),
            error if self.is_scale => format!(" ± {:.2} %", 100.0 * error / value),
            error => format!(" ± {}", short(error)),
        };
        let is_at_bound = self.bounds.contains(&value);
        let bound = if is_at_bound { "(at its bound)" } else { "" };
        let text = format!("{name} {}{error} {unit} {bound}", short(value));
        f.write_str(text.trim_end())
    }
}
