//! The files of a fit: a report for people and one for programs, and what was found as parts of scenes.

use std::fmt::{self, Write as _};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use selvedge_data::{StartSpec, StateChoice, StateRun, write_atomically};

use super::{Fitted, Found, Order};
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
    let mut text = |name: &str, text: String| -> Result<()> {
        wrote.push(folder.join(name));
        Ok(write_atomically(&folder.join(name), |out| {
            out.write_all(text.as_bytes())
        })?)
    };
    let has = |part| {
        order
            .numbers
            .iter()
            .any(|number| number.name.starts_with(part))
    };
    if has("material.") {
        text(
            "fabric.toml",
            toml::to_string(&scene.material).context("the fabric")?,
        )?;
    }
    if has("motion.") {
        text(
            "motion.toml",
            toml::to_string(&scene.motion).context("the motion")?,
        )?;
    }
    text("report.md", page(order, fitted))?;
    if has("start.") {
        let path = folder.join("start.safetensors");
        let states = StateRun {
            states: vec![start.clone()],
        };
        states.write(&path, &physics::provenance(&order.loaded.spec, scene)?)?;
        let file = path.to_string_lossy().into_owned();
        let choice = StateChoice {
            file,
            ..StateChoice::default()
        };
        spec.start = StartSpec::State(choice.read(Path::new(""), start.positions.len())?.1);
        wrote.push(path);
    }
    let rest = if is_at_rest { &start.positions[..] } else { scene.mesh.positions() };
    let run = physics::trajectory(start.frame, &spec, scene, rest, fitted.positions.clone())?;
    wrote.push(folder.join("run.safetensors"));
    run.write(&folder.join("run.safetensors"))?;
    let json = serde_json::to_vec_pretty(fitted)?;
    wrote.push(folder.join(FITTED));
    write_atomically(&folder.join(FITTED), |out| out.write_all(&json))?;
    Ok(wrote)
}

/// Four digits that count.
fn short(value: f64) -> String {
    if value != 0.0 && value.abs() < 0.1 {
        format!("{value:.3e}")
    } else {
        format!("{value:.4}")
    }
}

impl fmt::Display for Found {
    /// The name, and the value with its error.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit, value) = (&self.number.name, self.number.unit, self.value);
        write!(f, "{name} {}", short(value))?;
        match self.error {
            Some(error) if self.number.is_scale => write!(f, " ± {:.2} %", 100.0 * error / value)?,
            Some(error) => write!(f, " ± {}", short(error))?,
            None => {}
        }
        write!(f, "{}{unit}", if unit.is_empty() { "" } else { " " })?;
        f.write_str(if self.is_at_bound { ", at its bound" } else { "" })
    }
}

fn page(order: &Order, fitted: &Fitted) -> String {
    let Fitted {
        marks,
        rms,
        noise,
        runs: [runs, back],
        failed,
        ..
    } = fitted;
    let mut page = format!(
        "# Fit of {}\n\n{marks} marks; root mean square distance of a coordinate {:.3} mm, noise {:.3} mm ({}).\n\
        {runs} runs forward, {back} back, {failed} failed. Distances at the start and the end of each search [mm]:{}.\n\n",
        fitted.scene.name,
        1e3 * rms,
        1e3 * noise,
        if order.noise.is_some() { "as the order says" } else { "from what is left" },
        fitted
            .searches
            .iter()
            .fold(String::new(), |all, search| match search {
                Some([from, to]) => format!("{all} {:.3} to {:.3},", 1e3 * from, 1e3 * to),
                None => all + " failed,",
            })
            .trim_end_matches(',')
    );
    page += "| found | in the scene | bounds |\n|---|---|---|\n";
    for found in &fitted.numbers {
        let ([low, high], first) = (found.number.bounds, short(found.number.first));
        let _ = writeln!(page, "| {found} | {first} | {low} to {high} |");
    }
    let Some(directions) = &fitted.directions else {
        return page
            + "\nInterrupted: the best numbers by then. What the data tell was not looked at.\n";
    };
    page += "\n## What the data tell\n\nEigenvectors of the Gauss-Newton matrix, in parts of the bounds (of logarithms for \
        scales), and the error to which the data tell the numbers along each. Beyond a tenth of the \
        bounds they do not.\n\n| eigenvalue | error | | numbers |\n|---|---|---|---|\n";
    for direction in directions {
        let numbers = direction.way.iter().zip(&fitted.numbers);
        let named = numbers.filter(|(part, _)| part.abs() >= NAMED);
        let named = named.map(|(part, found)| format!("{part:+.2} {}", found.number.name));
        let named = named.collect::<Vec<_>>().join(", ");
        let error = direction
            .error
            .map_or("unbounded".to_owned(), |e| format!("{:.2} %", 100.0 * e));
        let told = if direction.is_told { "told" } else { "**not told**" };
        let _ = writeln!(
            page,
            "| {:.3e} | {error} | {told} | {named} |",
            direction.eigenvalue
        );
    }
    page
}
