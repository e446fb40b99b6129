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

/// A number that is to be found.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
    #[serde(skip)]
    what: What,
}

#[derive(Clone, Debug, PartialEq)]
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
    /// The scene `base` with these `values`, `[numbers]`.
    pub(super) fn of(base: &Scene, numbers: &[Number], values: &[f64]) -> Self {
        let (scene, start) = (base.clone(), [DVec3::ZERO; 3]);
        let mut trial = Self { scene, start };
        for (number, value) in numbers.iter().zip(values) {
            number.what.set(&mut trial, *value);
        }
        trial
    }

    /// The start `from`, moved and set in motion.
    pub(super) fn begin(&self, from: Checkpoint) -> Checkpoint {
        let [place, velocity, spin] = self.start;
        if self.start == [DVec3::ZERO; 3] {
            return from;
        }
        let (
            Checkpoint {
                frame, positions, ..
            },
            middle,
        ) = (&from, middle(&from.positions));
        let moved = |(p, v): (&DVec3, &DVec3)| *v + velocity + spin.cross(*p - middle);
        let velocities = positions.iter().zip(&from.velocities).map(moved).collect();
        Checkpoint::of(
            *frame,
            positions.iter().map(|p| *p + place).collect(),
            velocities,
        )
    }
}

fn middle(places: &[DVec3]) -> DVec3 {
    places.iter().sum::<DVec3>() / places.len() as f64
}

impl What {
    /// The place of a number that is no factor.
    fn slot<'a>(&self, trial: &'a mut Trial) -> Option<&'a mut f64> {
        let Trial { scene, start } = trial;
        Some(match *self {
            Self::Table(..) => return None,
            Self::Density => &mut scene.material.density,
            Self::Damping => &mut scene.material.damping,
            Self::AirDensity => &mut scene.environment.air_density,
            Self::AirDrag => &mut scene.environment.air_drag,
            Self::Wind(axis) => &mut scene.environment.wind[axis],
            Self::Start(what, axis) => &mut start[what][axis],
            Self::Keyframe([group, keyframe, axis]) => match &mut scene.motion {
                Motion::Keyframes(motion) => {
                    let keyframe = &mut motion.groups[group].keyframes[keyframe];
                    if axis < 3 {
                        &mut keyframe.translation[axis]
                    } else {
                        &mut keyframe.rotation_deg
                    }
                }
                _ => return None,
            },
        })
    }

    fn set(&self, trial: &mut Trial, value: f64) {
        if let Some(slot) = self.slot(trial) {
            *slot = value;
        } else if let Self::Table(is_bend, entries) = self {
            let material = &mut trial.scene.material;
            let table = match is_bend {
                true => material.bend.0.as_flattened_mut(),
                false => material.stretch.0.as_flattened_mut(),
            };
            entries.iter().for_each(|entry| table[*entry] *= value);
        }
    }

    /// Which of several it is.
    fn which(&self) -> String {
        let axis = |axis: usize| ["x", "y", "z", ""][axis];
        match self {
            Self::Table(_, entries) => format!("{}", entries[0]),
            Self::Wind(a) | Self::Start(_, a) => axis(*a).to_owned(),
            Self::Keyframe([g, k, a]) => format!("group {g} keyframe {k} {}", axis(*a)),
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

    /// What `by`, the gradient of a run of `trial` from `start`, says of this number at `value`.
    pub(super) fn slope(
        &self,
        value: f64,
        trial: &Trial,
        start: &Checkpoint,
        by: &Gradient,
    ) -> f64 {
        let (material, fabric) = (&by.materials[0], &trial.scene.material);
        match self.what {
            What::Table(is_bend, ref entries) => {
                let (slopes, table) = match is_bend {
                    true => (material.bend.as_flattened(), fabric.bend.0.as_flattened()),
                    false => (
                        material.stretch.as_flattened(),
                        fabric.stretch.0.as_flattened(),
                    ),
                };
                entries
                    .iter()
                    .map(|entry| slopes[*entry] * table[*entry])
                    .sum::<f64>()
                    / value
            }
            What::Density => material.density,
            What::Damping => material.damping,
            What::AirDensity => by.air_density,
            What::AirDrag => by.air_drag,
            What::Wind(axis) => by.wind[axis],
            What::Start(0, axis) => by.start.positions.iter().sum::<DVec3>()[axis],
            What::Start(1, axis) => by.start.velocities.iter().sum::<DVec3>()[axis],
            What::Start(_, axis) => {
                let middle = middle(&start.positions);
                let pairs = start.positions.iter().zip(&by.start.velocities);
                pairs.map(|(p, by)| (*p - middle).cross(*by)).sum::<DVec3>()[axis]
            }
            What::Keyframe(_) => self.slope_of_path(value, trial, start.frame, &by.targets),
        }
    }

    /// The same of the motion: a path is linear in its translations, and smooth in its angles.
    fn slope_of_path(&self, value: f64, trial: &Trial, first: usize, by: &[Vec<DVec3>]) -> f64 {
        const STEP: f64 = 1e-3;
        let [before, after] = [-STEP, STEP].map(|step| {
            let mut moved = trial.clone();
            self.what.set(&mut moved, value + step);
            moved.scene.handle_path()
        });
        let (Ok(before), Ok(after)) = (before, after) else {
            return 0.0;
        };
        let (handles, rate) = (trial.scene.handles.len(), trial.scene.frame_rate);
        let mut sum = 0.0;
        for (frame, by) in by.iter().enumerate() {
            let samples = (by.len() / handles) as f64;
            for (k, by) in by.chunks(handles).enumerate() {
                let time = ((first + frame) as f64 + (k + 1) as f64 / samples) / rate;
                let moves = after.at(time).into_iter().zip(before.at(time));
                sum += moves
                    .zip(by)
                    .map(|((a, b), by)| (a - b).dot(*by))
                    .sum::<f64>();
            }
        }
        sum / (2.0 * STEP)
    }
}

/// Numbers of entries of a table of so many, those together that have one number in `of`.
fn tables(is_bend: bool, of: fn(usize) -> usize) -> Vec<What> {
    let count = if is_bend { 15 } else { 24 };
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    (0..count).for_each(|entry| groups.entry(of(entry)).or_default().push(entry));
    groups
        .into_values()
        .map(|entries| What::Table(is_bend, entries))
        .collect()
}

fn keyframes(scene: &Scene, axes: Range<usize>) -> Result<Vec<What>> {
    let Motion::Keyframes(motion) = &scene.motion else {
        bail!("motion: that of the scene has no keyframes: write it with [motion.groups]");
    };
    ensure!(
        scene
            .schedule
            .releases
            .iter()
            .all(|release| release.to.is_none()),
        "motion: cannot be fitted where a handle takes hold again, which it does where the cloth is then: remove `to` from its release"
    );
    let groups = motion.groups.iter().enumerate();
    let places = groups.flat_map(|(g, group)| (0..group.keyframes.len()).map(move |k| [g, k]));
    let all = places.flat_map(|[g, k]| axes.clone().map(move |axis| What::Keyframe([g, k, axis])));
    Ok(all.collect())
}

/// The numbers that the `parts` of an order name, each with its name.
pub(super) fn numbers(scene: &Scene, parts: [(&str, &Bounds); 4]) -> Result<Vec<Number>> {
    let mut all = Vec::new();
    let mut trial = Trial::of(scene, &[], &[]);
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
        let start = |what| {
            axes.clone()
                .map(move |axis| What::Start(what, axis))
                .collect()
        };
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
            "start.place" if scene.handles.is_empty() => ("m", false, start(0)),
            "start.place" => bail!("{key}: handles say where the cloth is: fit motion.translation"),
            "start.velocity" => ("m/s", false, start(1)),
            "start.spin" => ("rad/s", false, start(2)),
            "motion.translation" => ("m", false, keyframes(scene, axes)?),
            "motion.rotation_deg" => ("°", false, keyframes(scene, 3..4)?),
            _ => bail!("{key}: there is no such number; known are {KNOWN}"),
        };
        let rows = &scene.material.stretch.0;
        ensure!(
            stem != "material.stretch_entries" || rows.iter().any(|row| row != &rows[0]),
            "{key}: the table says the same at all strains: take stretch_columns"
        );
        let [low, high] = bounds;
        ensure!(
            low < high
                && high.is_finite()
                && low >= if is_scale { f64::MIN_POSITIVE } else { f64::MIN },
            "{key}: bounds are [least, most], of a scale positive; found [{low}, {high}]"
        );
        let is_one = found.len() == 1;
        for what in found {
            let name = if is_one { key.clone() } else { format!("{stem} {}", what.which()) };
            let first = what.slot(&mut trial).map_or(1.0, |slot| *slot);
            ensure!(
                (low..=high).contains(&first),
                "{name}: the scene has {first}, where the search begins, which is not within {low} to {high}: widen the bounds, or change the scene"
            );
            all.push(Number {
                name,
                unit,
                bounds,
                first,
                is_scale,
                what,
            });
        }
    }
    ensure!(
        (1..=MOST).contains(&all.len()),
        "{} numbers are to be fitted, 1 to {MOST} can be: give bounds, as in material = {{ stretch = [0.2, 5.0] }}",
        all.len()
    );
    Ok(all)
}
