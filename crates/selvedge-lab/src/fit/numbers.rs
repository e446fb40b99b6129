//! The numbers of a scene that are to be found: where each stands in it, its bounds, and what a gradient
//! says of it. A scene and its slopes are JSON of one shape, in which a number has pointers.

use std::collections::BTreeMap;

use anyhow::{Result, bail, ensure};
use glam::DVec3;
use selvedge::Gradient;
use selvedge_cloth::{Checkpoint, HandlePath, Scene};
use serde::Serialize;
use serde_json::{Value, json};

/// Numbers at most: each takes a run at the end.
const MOST: usize = 500;
/// What an order can name, with its unit. Those without one are factors of entries of a table.
const KEYS: [(&str, &str); 16] = [
    ("material.stretch", ""),
    ("material.stretch_columns", ""),
    ("material.stretch_entries", ""),
    ("material.bend", ""),
    ("material.bend_rows", ""),
    ("material.bend_entries", ""),
    ("material.density", "kg/m²"),
    ("material.damping", "s"),
    ("environment.air_density", "kg/m³"),
    ("environment.air_drag", "kg/(m² s)"),
    ("environment.wind", "m/s"),
    ("start.place", "m"),
    ("start.velocity", "m/s"),
    ("start.spin", "rad/s"),
    ("motion.translation", "m"),
    ("motion.rotation_deg", "°"),
];

/// Bounds by their keys: a part of an order.
pub(super) type Bounds = BTreeMap<String, [f64; 2]>;

/// A number that is to be found, and what was found.
#[derive(Clone, Debug, Serialize)]
pub struct Number {
    /// Its name: the key of the order, and which of several.
    pub name: String,
    /// Its unit; none of a factor.
    pub unit: &'static str,
    /// Its bounds.
    pub bounds: [f64; 2],
    /// What the scene has.
    pub first: f64,
    /// True where it is a scale: its logarithm is searched for.
    pub is_scale: bool,
    /// What was found.
    pub value: f64,
    /// Its standard error; infinite where the data do not tell it, and not a number where nobody has
    /// looked: null in JSON.
    pub error: f64,
    #[serde(skip)]
    pointers: Vec<String>,
}

/// What of a scene can be found.
fn document(scene: &Scene) -> Result<Value> {
    let zero = DVec3::ZERO;
    Ok(json!({
        "material": serde_json::to_value(&scene.material)?,
        "environment": serde_json::to_value(scene.environment)?,
        "start": { "place": zero, "velocity": zero, "spin": zero },
        "motion": serde_json::to_value(&scene.motion)?,
    }))
}

/// The scene `base` with numbers at these values, and its start, moved and set in motion.
pub(super) fn placed<'a>(
    base: &Scene,
    numbers: impl Iterator<Item = (&'a Number, f64)>,
) -> Result<(Scene, impl Fn(Checkpoint) -> Checkpoint)> {
    let (mut scene, mut document) = (base.clone(), document(base)?);
    for (number, value) in numbers {
        for pointer in &number.pointers {
            if let Some(slot) = document.pointer_mut(pointer) {
                let factor = slot.as_f64().filter(|_| number.unit.is_empty());
                *slot = json!(factor.unwrap_or(1.0) * value);
            }
        }
    }
    scene.material = serde_json::from_value(document["material"].take())?;
    scene.environment = serde_json::from_value(document["environment"].take())?;
    scene.motion = serde_json::from_value(document["motion"].take())?;
    let start = &document["start"];
    let [place, velocity, spin]: [DVec3; 3] =
        serde_json::from_value(json!([start["place"], start["velocity"], start["spin"]]))?;
    let begin = move |mut from: Checkpoint| {
        if [place, velocity, spin] == [DVec3::ZERO; 3] {
            return from;
        }
        let middle = middle(&from.positions);
        for (p, v) in from.positions.iter_mut().zip(&mut from.velocities) {
            *v += velocity + spin.cross(*p - middle);
            *p += place;
        }
        Checkpoint::of(from.frame, from.positions, from.velocities)
    };
    Ok((scene, begin))
}

fn middle(places: &[DVec3]) -> DVec3 {
    places.iter().sum::<DVec3>() / places.len() as f64
}

impl Number {
    /// Its value at a part of its bounds.
    pub(super) fn at(&self, part: f64) -> f64 {
        let [low, high] = self.bounds;
        let scale = || low * libm::exp(part * libm::log(high / low));
        let value = if self.is_scale { scale() } else { low + part * (high - low) };
        value.clamp(low, high)
    }

    /// The part of its bounds at which the scene has it.
    pub(super) fn part(&self) -> f64 {
        let [low, high] = self.bounds;
        let way = |to: f64| if self.is_scale { libm::log(to / low) } else { to - low };
        way(self.first) / way(high)
    }

    /// Derivative of the value by the part.
    pub(super) fn rate(&self, value: f64) -> f64 {
        let [low, high] = self.bounds;
        if self.is_scale { value * libm::log(high / low) } else { high - low }
    }

    /// Derivative of the sum of the targets, each times its slope in `by`, by this number of the motion: a
    /// path is linear in its translations, and smooth in its angles.
    fn slope_of_path(&self, value: f64, scene: &Scene, first: usize, by: &Gradient) -> Result<f64> {
        const STEP: f64 = 1e-3;
        let path = |step| -> Result<HandlePath> {
            let (moved, _) = placed(scene, [(self, value + step)].into_iter())?;
            Ok(moved.handle_path()?)
        };
        let (before, after) = (path(-STEP)?, path(STEP)?);
        let (handles, mut sum) = (scene.handles.len(), 0.0);
        for (frame, by) in by.targets.iter().enumerate() {
            let samples = (by.len() / handles) as f64;
            for (k, by) in by.chunks(handles).enumerate() {
                let frames = (first + frame) as f64 + (k + 1) as f64 / samples;
                let [after, before] =
                    [&after, &before].map(|path| path.at(frames / scene.frame_rate));
                let moves = after.iter().zip(before).zip(by);
                sum += moves.map(|((a, b), by)| (*a - b).dot(*by)).sum::<f64>();
            }
        }
        Ok(sum / (2.0 * STEP))
    }
}

/// What `by`, the gradient of a run of `scene` from `start`, says of numbers at these values.
pub(super) fn slopes<'a>(
    numbers: impl Iterator<Item = (&'a Number, f64)>,
    scene: &Scene,
    start: &Checkpoint,
    by: &Gradient,
) -> Result<Vec<f64>> {
    let (here, fabric) = (document(scene)?, &by.materials[0]);
    let (middle, velocities) = (middle(&start.positions), &by.start.velocities);
    let turns = start.positions.iter().zip(velocities);
    let slopes = json!({
        "material": {
            "density": fabric.density, "damping": fabric.damping,
            "stretch": fabric.stretch, "bend": fabric.bend,
        },
        "environment": { "air_density": by.air_density, "air_drag": by.air_drag, "wind": by.wind },
        "start": {
            "place": by.start.positions.iter().sum::<DVec3>(),
            "velocity": velocities.iter().sum::<DVec3>(),
            "spin": turns.map(|(p, by)| (*p - middle).cross(*by)).sum::<DVec3>(),
        },
    });
    let read =
        |of: &Value, pointer: &str| of.pointer(pointer).and_then(Value::as_f64).unwrap_or(0.0);
    let slope = |(number, value): (&Number, f64)| match number.unit {
        _ if number.name.starts_with("motion") => {
            number.slope_of_path(value, scene, start.frame, by)
        }
        "" => {
            let entry = |at: &String| read(&slopes, at) * read(&here, at) / value;
            Ok(number.pointers.iter().map(entry).sum())
        }
        _ => Ok(read(&slopes, &number.pointers[0])),
    };
    numbers.map(slope).collect()
}

/// The pointers of all numbers below `path`.
fn leaves(value: &Value, path: String, into: &mut Vec<String>) {
    match value {
        Value::Number(_) => into.push(path),
        Value::Array(all) => {
            let all = all.iter().enumerate();
            all.for_each(|(key, value)| leaves(value, format!("{path}/{key}"), into));
        }
        Value::Object(all) => {
            for (key, value) in all {
                leaves(value, format!("{path}/{key}"), into);
            }
        }
        _ => {}
    }
}

/// The numbers that the `parts` of an order name.
pub(super) fn numbers(scene: &Scene, parts: [(&str, &Bounds); 4]) -> Result<Vec<Number>> {
    let (document, mut places, mut all) = (document(scene)?, Vec::new(), Vec::new());
    leaves(&document, String::new(), &mut places);
    let keys = parts
        .iter()
        .flat_map(|(part, keys)| keys.iter().map(move |key| (part, key)));
    for (part, (key, &bounds)) in keys {
        let key = format!("{part}.{key}");
        let (stem, axis) = match key.rsplit_once('_') {
            Some((stem, axis @ ("x" | "y" | "z"))) => (stem, Some(axis)),
            _ => (&*key, None),
        };
        let known = KEYS.iter().find(|(known, _)| *known == stem);
        let Some((_, unit)) = known else {
            let known = KEYS.map(|key| key.0).join(", ");
            bail!("{key}: there is no such number; known are {known}, and one axis, as wind_x");
        };
        // By the names of the numbers, the places of each.
        let mut found: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for place in &places {
            let name = place[1..].replace('/', ".");
            let letter = |index: &str| ["x", "y", "z"].get(index.parse::<usize>().ok()?).copied();
            let (above, last) = name.rsplit_once('.').unwrap_or_default();
            let (table, row) = above.rsplit_once('.').unwrap_or_default();
            let name = match stem.strip_prefix(table) {
                Some("") => stem.to_owned(),
                Some("_columns") => format!("{stem} {last}"),
                Some("_rows") => format!("{stem} {row}"),
                Some("_entries") => format!("{stem} {row}.{last}"),
                _ if name == stem || name.starts_with("motion") && name.ends_with(&stem[6..]) => {
                    name
                }
                _ if above == stem || name.starts_with("motion") && above.ends_with(&stem[6..]) => {
                    let letter = letter(last).unwrap_or_default();
                    if axis.is_some_and(|axis| axis != letter) {
                        continue;
                    }
                    format!("{above}_{letter}")
                }
                _ => continue,
            };
            found.entry(name).or_default().push(place.clone());
        }
        let rows = &scene.material.stretch.0;
        let is_law = rows.iter().any(|row| row != &rows[0]);
        let mut releases = scene.schedule.releases.iter();
        let is_again = releases.any(|release| release.to.is_some());
        let is_held = !scene.handles.is_empty();
        let is_scale = unit.is_empty() || stem == "material.density";
        let [low, high] = bounds;
        let problem = match *part {
            _ if found.is_empty() => "the scene's motion has no keyframes",
            "start" if stem == "start.place" && is_held => "handles say where it is",
            "motion" if is_again => "a handle takes hold again: remove `to` from its release",
            "material" if stem.ends_with("h_entries") && !is_law => "a linear table: take columns",
            _ if !(low < high && high.is_finite()) => "bounds are [least, most]",
            _ if is_scale && low <= 0.0 => "the lower bound must be positive",
            _ => "",
        };
        ensure!(problem.is_empty(), "{key} = [{low}, {high}]: {problem}");
        for (name, pointers) in found {
            let value = document.pointer(&pointers[0]).and_then(Value::as_f64);
            let first = if unit.is_empty() { 1.0 } else { value.unwrap_or(0.0) };
            ensure!(
                (low..=high).contains(&first),
                "{name}: the search begins at the scene's {first}, beyond the bounds {low} to {high}: change these, or the scene"
            );
            all.push(Number {
                name,
                unit,
                bounds,
                first,
                is_scale,
                value: first,
                error: f64::NAN,
                pointers,
            });
        }
    }
    let count = all.len();
    ensure!(
        (1..=MOST).contains(&count),
        "{count} numbers are to be found, 1 to {MOST} can be: give bounds, as material.stretch = [0.2, 5]"
    );
    Ok(all)
}
