//! The numbers of a scene that are to be found: where each stands in it, its bounds, and what a gradient
//! says of it.

use std::collections::BTreeMap;
use std::ops::Range;

use anyhow::{Result, bail, ensure};
use glam::DVec3;
use selvedge::Gradient;
use selvedge_cloth::{Checkpoint, Motion, Scene};
use serde::Serialize;

/// Numbers at most: each takes two runs at the end.
const MOST: usize = 500;
/// What an order can name.
const KNOWN: &str = "material.stretch, stretch_columns, stretch_entries, bend, bend_rows, \
    bend_entries, density, damping; environment.air_density, air_drag, wind; start.place, velocity, \
    spin; motion.translation, rotation_deg; of a vector also one axis, as wind_x";

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
    /// Its standard error; none where the data do not tell it, or nobody has looked.
    pub error: Option<f64>,
    #[serde(skip)]
    what: What,
}

#[derive(Clone, Debug)]
enum What {
    /// A factor of entries of the table of bending or, otherwise, of stretching.
    Table(bool, Vec<usize>),
    Density,
    Damping,
    AirDensity,
    AirDrag,
    Wind(usize),
    /// Place, velocity or spin, along an axis.
    Start(usize, usize),
    /// Of a group and a keyframe, its translation along an axis or, as the fourth, its angle.
    Keyframe([usize; 3]),
}

/// A scene with numbers in their places.
#[derive(Clone)]
pub(super) struct Trial {
    pub(super) scene: Scene,
    start: [DVec3; 3],
}

impl Trial {
    /// The scene `base` with numbers at these values.
    pub(super) fn of<'a>(base: &Scene, numbers: impl Iterator<Item = (&'a Number, f64)>) -> Self {
        let (scene, start) = (base.clone(), [DVec3::ZERO; 3]);
        let mut trial = Self { scene, start };
        numbers.for_each(|(number, value)| number.what.set(&mut trial, value));
        trial
    }

    /// The start `from`, moved and set in motion.
    pub(super) fn begin(&self, mut from: Checkpoint) -> Checkpoint {
        if self.start == [DVec3::ZERO; 3] {
            return from;
        }
        let [place, velocity, spin] = self.start;
        let middle = middle(&from.positions);
        for (p, v) in from.positions.iter_mut().zip(&mut from.velocities) {
            *v += velocity + spin.cross(*p - middle);
            *p += place;
        }
        Checkpoint::of(from.frame, from.positions, from.velocities)
    }

    fn table(&mut self, is_bend: bool) -> &mut [f64] {
        let material = &mut self.scene.material;
        match is_bend {
            true => material.bend.0.as_flattened_mut(),
            false => material.stretch.0.as_flattened_mut(),
        }
    }

    /// The slopes that `by` has of a run from `start`, in the places of the numbers; those of the
    /// motion are elsewhere.
    fn slopes(mut self, start: &Checkpoint, by: &Gradient) -> Self {
        let (material, scene) = (&by.materials[0], &mut self.scene);
        (scene.material.density, scene.material.damping) = (material.density, material.damping);
        (scene.material.stretch.0, scene.material.bend.0) = (material.stretch, material.bend);
        let air = &mut scene.environment;
        (air.air_density, air.air_drag, air.wind) = (by.air_density, by.air_drag, by.wind);
        let (middle, velocities) = (middle(&start.positions), &by.start.velocities);
        let turns = start.positions.iter().zip(velocities);
        let spin = turns.map(|(p, by)| (*p - middle).cross(*by)).sum();
        self.start = [
            by.start.positions.iter().sum(),
            velocities.iter().sum(),
            spin,
        ];
        self
    }
}

fn middle(places: &[DVec3]) -> DVec3 {
    places.iter().sum::<DVec3>() / places.len() as f64
}

impl What {
    /// The place of a number that is no factor.
    fn slot<'a>(&self, trial: &'a mut Trial) -> Option<&'a mut f64> {
        let Trial { scene, start } = trial;
        Some(match (self, &mut scene.motion) {
            (Self::Density, _) => &mut scene.material.density,
            (Self::Damping, _) => &mut scene.material.damping,
            (Self::AirDensity, _) => &mut scene.environment.air_density,
            (Self::AirDrag, _) => &mut scene.environment.air_drag,
            (Self::Wind(axis), _) => &mut scene.environment.wind[*axis],
            (Self::Start(what, axis), _) => &mut start[*what][*axis],
            (Self::Keyframe([group, keyframe, axis]), Motion::Keyframes(motion)) => {
                let keyframe = &mut motion.groups[*group].keyframes[*keyframe];
                match axis {
                    3 => &mut keyframe.rotation_deg,
                    _ => &mut keyframe.translation[*axis],
                }
            }
            _ => return None,
        })
    }

    fn set(&self, trial: &mut Trial, value: f64) {
        if let Self::Table(is_bend, entries) = self {
            let table = trial.table(*is_bend);
            entries.iter().for_each(|entry| table[*entry] *= value);
        } else if let Some(slot) = self.slot(trial) {
            *slot = value;
        }
    }

    /// Which of several it is.
    fn which(&self) -> String {
        match self {
            Self::Table(_, entries) => format!("[{}]", entries[0]),
            Self::Wind(a) | Self::Start(_, a) => ["x", "y", "z"][*a].to_owned(),
            Self::Keyframe([g, k, a]) => format!("[{g}][{k}] {}", ["x", "y", "z", ""][*a]),
            _ => String::new(),
        }
    }
}

impl Number {
    /// Its value at a part of its bounds.
    pub(super) fn at(&self, part: f64) -> f64 {
        let [low, high] = self.bounds;
        let value = match self.is_scale {
            true => low * libm::exp(part * libm::log(high / low)),
            false => low + part * (high - low),
        };
        value.clamp(low, high)
    }

    /// The part of its bounds at which the scene has it.
    pub(super) fn part(&self) -> f64 {
        let [low, high] = self.bounds;
        match self.is_scale {
            true => libm::log(self.first / low) / libm::log(high / low),
            false => (self.first - low) / (high - low),
        }
    }

    /// Derivative of the value by the part.
    pub(super) fn rate(&self, value: f64) -> f64 {
        let [low, high] = self.bounds;
        if self.is_scale { value * libm::log(high / low) } else { high - low }
    }
}

/// What `by`, the gradient of a run of `trial` from `start`, says of numbers at these values.
pub(super) fn slopes<'a>(
    numbers: impl Iterator<Item = (&'a Number, f64)>,
    trial: &Trial,
    start: &Checkpoint,
    by: &Gradient,
) -> Vec<f64> {
    let (mut here, mut slopes) = (trial.clone(), trial.clone().slopes(start, by));
    let slope = |(number, value): (&Number, f64)| match &number.what {
        What::Table(is_bend, entries) => {
            let (table, slopes) = (here.table(*is_bend), slopes.table(*is_bend));
            entries.iter().map(|k| table[*k] * slopes[*k]).sum::<f64>() / value
        }
        What::Keyframe(_) => slope_of_path(&number.what, value, trial, start.frame, &by.targets),
        what => what.slot(&mut slopes).map_or(0.0, |slope| *slope),
    };
    numbers.map(slope).collect()
}

/// The same of a number of the motion: a path is linear in its translations, and smooth in its angles.
fn slope_of_path(what: &What, value: f64, trial: &Trial, first: usize, by: &[Vec<DVec3>]) -> f64 {
    const STEP: f64 = 1e-3;
    let paths = [-STEP, STEP].map(|step| {
        let mut moved = trial.clone();
        what.set(&mut moved, value + step);
        moved.scene.handle_path()
    });
    let [Ok(before), Ok(after)] = paths else {
        return 0.0;
    };
    let (handles, rate) = (trial.scene.handles.len(), trial.scene.frame_rate);
    let mut sum = 0.0;
    for (frame, by) in by.iter().enumerate() {
        let samples = (by.len() / handles) as f64;
        for (k, by) in by.chunks(handles).enumerate() {
            let time = ((first + frame) as f64 + (k + 1) as f64 / samples) / rate;
            let (after, before) = (after.at(time), before.at(time));
            let moves = after.iter().zip(before).zip(by);
            sum += moves.map(|((a, b), by)| (*a - b).dot(*by)).sum::<f64>();
        }
    }
    sum / (2.0 * STEP)
}

/// Factors of the entries of a table, those together that have one number in `of`.
fn tables(is_bend: bool, of: fn(usize) -> usize) -> Vec<What> {
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    let count = if is_bend { 15 } else { 24 };
    (0..count).for_each(|entry| groups.entry(of(entry)).or_default().push(entry));
    let groups = groups.into_values();
    groups
        .map(|entries| What::Table(is_bend, entries))
        .collect()
}

fn keyframes(scene: &Scene, axes: Range<usize>) -> Result<Vec<What>> {
    let Motion::Keyframes(motion) = &scene.motion else {
        bail!("motion: that of the scene has no keyframes: write it with [motion.groups]");
    };
    let mut releases = scene.schedule.releases.iter();
    ensure!(
        releases.all(|release| release.to.is_none()),
        "motion: a handle takes hold again, where the cloth is then: remove `to` from its release"
    );
    let mut all = Vec::new();
    for (g, group) in motion.groups.iter().enumerate() {
        for k in 0..group.keyframes.len() {
            all.extend(axes.clone().map(|axis| What::Keyframe([g, k, axis])));
        }
    }
    Ok(all)
}

/// The numbers that the `parts` of an order name.
pub(super) fn numbers(scene: &Scene, parts: [(&str, &Bounds); 4]) -> Result<Vec<Number>> {
    let mut all = Vec::new();
    let mut trial = Trial::of(scene, std::iter::empty());
    let keys = parts
        .iter()
        .flat_map(|(part, keys)| keys.iter().map(move |key| (part, key)));
    for (part, (key, &bounds)) in keys {
        let key = format!("{part}.{key}");
        let (stem, axes) = match key.rsplit_once('_') {
            Some((stem, "x")) => (stem, 0..1),
            Some((stem, "y")) => (stem, 1..2),
            Some((stem, "z")) => (stem, 2..3),
            _ => (&*key, 0..3),
        };
        let of_start = |what| move |axis| What::Start(what, axis);
        let (unit, is_scale, found): (_, _, Vec<What>) = match stem {
            "material.stretch" => ("", true, tables(false, |_| 0)),
            "material.stretch_columns" => ("", true, tables(false, |entry| entry % 4)),
            "material.stretch_entries" => ("", true, tables(false, |entry| entry)),
            "material.bend" => ("", true, tables(true, |_| 0)),
            "material.bend_rows" => ("", true, tables(true, |entry| entry / 5)),
            "material.bend_entries" => ("", true, tables(true, |entry| entry)),
            "material.density" => ("kg/m²", true, vec![What::Density]),
            "material.damping" => ("s", false, vec![What::Damping]),
            "environment.air_density" => ("kg/m³", false, vec![What::AirDensity]),
            "environment.air_drag" => ("kg/(m² s)", false, vec![What::AirDrag]),
            "environment.wind" => ("m/s", false, axes.map(What::Wind).collect()),
            "start.place" => ("m", false, axes.map(of_start(0)).collect()),
            "start.velocity" => ("m/s", false, axes.map(of_start(1)).collect()),
            "start.spin" => ("rad/s", false, axes.map(of_start(2)).collect()),
            "motion.translation" => ("m", false, keyframes(scene, axes)?),
            "motion.rotation_deg" => ("°", false, keyframes(scene, 3..4)?),
            _ => bail!("{key}: there is no such number; known are {KNOWN}"),
        };
        let (rows, [low, high]) = (&scene.material.stretch.0, bounds);
        let is_law = rows.iter().any(|row| row != &rows[0]);
        let problem = match stem {
            "start.place" if !scene.handles.is_empty() => "handles say where the cloth is",
            "material.stretch_entries" if !is_law => "the table has one row: take stretch_columns",
            _ if !(low < high && high.is_finite()) => "bounds are [least, most]",
            _ if is_scale && low <= 0.0 => "the lower bound must be positive",
            _ => "",
        };
        ensure!(problem.is_empty(), "{key} = [{low}, {high}]: {problem}");
        let is_one = found.len() == 1;
        for what in found {
            let first = what.slot(&mut trial).map_or(1.0, |slot| *slot);
            let name = if is_one { key.clone() } else { format!("{stem} {}", what.which()) };
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
                error: None,
                what,
            });
        }
    }
    ensure!(
        (1..=MOST).contains(&all.len()),
        "{} numbers are to be found, 1 to {MOST} can be: give bounds, as material.stretch = [0.2, 5]",
        all.len()
    );
    Ok(all)
}
