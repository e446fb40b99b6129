//! The numbers of a scene that are to be found: where each stands in it, its bounds, and what a gradient
//! says of it.

use anyhow::{Result, bail, ensure};
use glam::DVec3;
use selvedge::Gradient;
use selvedge_cloth::{Checkpoint, Motion, Scene};
use serde::{Deserialize, Serialize};

/// Numbers at most: each takes two runs at the end.
const MOST: usize = 500;

type Bounds = Option<[f64; 2]>;

/// The part `material` of an order. Multipliers are of the scene's own tables.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MaterialFile {
    stretch: Bounds,
    bend: Bounds,
    stretch_columns: Bounds,
    bend_rows: Bounds,
    stretch_entries: Bounds,
    bend_entries: Bounds,
    density: Bounds,
    damping: Bounds,
}

/// The part `environment` of an order.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct EnvironmentFile {
    air_density: Bounds,
    air_drag: Bounds,
    wind: Bounds,
}

/// The part `start` of an order.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct StartFile {
    place: Bounds,
    velocity: Bounds,
    spin: Bounds,
}

/// The part `motion` of an order.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MotionFile {
    translation: Bounds,
    rotation_deg: Bounds,
    /// Numbers of the keyframes of each group; all where there are none.
    keyframes: Option<Vec<usize>>,
    /// Axes of the translations; all where there are none.
    axes: Option<Vec<Axis>>,
}

/// An axis of the world.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Axis {
    X,
    Y,
    Z,
}

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
    Stretch(Vec<[usize; 2]>),
    Bend(Vec<[usize; 2]>),
    Density,
    Damping,
    AirDensity,
    AirDrag,
    Wind(usize),
    Place(usize),
    Velocity(usize),
    Spin(usize),
    /// Of a group, a keyframe and an axis.
    Translation([usize; 3]),
    Turn([usize; 2]),
}

/// A scene with numbers in their places.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    pub(super) scene: Scene,
    place: DVec3,
    velocity: DVec3,
    spin: DVec3,
}

impl Trial {
    /// The scene `base` with these `values`, `[numbers]`.
    pub(super) fn of(base: &Scene, numbers: &[Number], values: &[f64]) -> Self {
        let mut trial = Self {
            scene: base.clone(),
            place: DVec3::ZERO,
            velocity: DVec3::ZERO,
            spin: DVec3::ZERO,
        };
        for (number, value) in numbers.iter().zip(values) {
            number.what.set(&mut trial, *value);
        }
        trial
    }

    /// The start `from`, moved and set in motion.
    pub(super) fn begin(&self, from: Checkpoint) -> Checkpoint {
        if [self.place, self.velocity, self.spin] == [DVec3::ZERO; 3] {
            return from;
        }
        let middle = middle(&from.positions);
        let pairs = from.positions.iter().zip(&from.velocities);
        let velocities = pairs.map(|(p, v)| *v + self.velocity + self.spin.cross(*p - middle));
        let velocities = velocities.collect();
        let positions = from.positions.iter().map(|p| *p + self.place).collect();
        Checkpoint::of(from.frame, positions, velocities)
    }
}

fn middle(places: &[DVec3]) -> DVec3 {
    places.iter().sum::<DVec3>() / places.len() as f64
}

impl What {
    fn set(&self, trial: &mut Trial, value: f64) {
        let (material, air) = (&mut trial.scene.material, &mut trial.scene.environment);
        match self {
            Self::Stretch(entries) => entries
                .iter()
                .for_each(|&[r, c]| material.stretch.0[r][c] *= value),
            Self::Bend(entries) => entries
                .iter()
                .for_each(|&[r, c]| material.bend.0[r][c] *= value),
            Self::Density => material.density = value,
            Self::Damping => material.damping = value,
            Self::AirDensity => air.air_density = value,
            Self::AirDrag => air.air_drag = value,
            Self::Wind(axis) => air.wind[*axis] = value,
            Self::Place(axis) => trial.place[*axis] = value,
            Self::Velocity(axis) => trial.velocity[*axis] = value,
            Self::Spin(axis) => trial.spin[*axis] = value,
            Self::Translation(_) | Self::Turn(_) => {
                let Motion::Keyframes(motion) = &mut trial.scene.motion else {
                    return;
                };
                match *self {
                    Self::Translation([g, k, axis]) => {
                        motion.groups[g].keyframes[k].translation[axis] = value
                    }
                    Self::Turn([g, k]) => motion.groups[g].keyframes[k].rotation_deg = value,
                    _ => {}
                }
            }
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
    ) -> Result<f64> {
        let (material, fabric) = (&by.materials[0], &trial.scene.material);
        Ok(match &self.what {
            What::Stretch(entries) => {
                let one = |&[r, c]: &[usize; 2]| material.stretch[r][c] * fabric.stretch.0[r][c];
                entries.iter().map(one).sum::<f64>() / value
            }
            What::Bend(entries) => {
                let one = |&[r, c]: &[usize; 2]| material.bend[r][c] * fabric.bend.0[r][c];
                entries.iter().map(one).sum::<f64>() / value
            }
            What::Density => material.density,
            What::Damping => material.damping,
            What::AirDensity => by.air_density,
            What::AirDrag => by.air_drag,
            What::Wind(axis) => by.wind[*axis],
            What::Place(axis) => by.start.positions.iter().sum::<DVec3>()[*axis],
            What::Velocity(axis) => by.start.velocities.iter().sum::<DVec3>()[*axis],
            What::Spin(axis) => {
                let middle = middle(&start.positions);
                let pairs = start.positions.iter().zip(&by.start.velocities);
                pairs.map(|(p, by)| (*p - middle).cross(*by)).sum::<DVec3>()[*axis]
            }
            What::Translation(_) | What::Turn(_) => {
                // A path is linear in its translations, and smooth in its angles.
                const STEP: f64 = 1e-3;
                let path = |step: f64| {
                    let mut moved = trial.clone();
                    self.what.set(&mut moved, value + step);
                    moved.scene.handle_path()
                };
                let (before, after) = (path(-STEP)?, path(STEP)?);
                let mut sum = 0.0;
                for (frame, by) in by.targets.iter().enumerate() {
                    let handles = trial.scene.handles.len();
                    for (k, by) in by.chunks(handles).enumerate() {
                        let samples = trial.scene.physics.substeps;
                        let frames =
                            (start.frame + frame) as f64 + (k + 1) as f64 / f64::from(samples);
                        let time = frames / trial.scene.frame_rate;
                        let places = after.at(time).into_iter().zip(before.at(time));
                        sum += places
                            .zip(by)
                            .map(|((a, b), by)| (a - b).dot(*by))
                            .sum::<f64>();
                    }
                }
                sum / (2.0 * STEP)
            }
        })
    }
}

/// The numbers of an order, in the order of its keys here.
pub(super) fn numbers(
    scene: &Scene,
    material: &MaterialFile,
    environment: &EnvironmentFile,
    start: &StartFile,
    motion: &MotionFile,
) -> Result<Vec<Number>> {
    let mut all = Vec::new();
    let mut add = |name: String, unit, bounds, first, is_scale: bool, what| -> Result<()> {
        let [low, high]: [f64; 2] = bounds;
        ensure!(
            low.is_finite() && high.is_finite() && low < high,
            "{name}: bounds are [least, most]; found [{low}, {high}]"
        );
        ensure!(
            !is_scale || low > 0.0,
            "{name}: the lower bound must be positive; found {low}"
        );
        ensure!(
            (low..=high).contains(&first),
            "{name}: the scene has {first}, where the search begins, and the bounds are {low} to {high}: widen them, or change the scene"
        );
        all.push(Number {
            name,
            unit,
            bounds,
            first,
            is_scale,
            what,
        });
        Ok(())
    };
    let table = |rows: usize, columns: usize| {
        (0..rows).flat_map(move |r| (0..columns).map(move |c| [r, c]))
    };
    let fabric = &scene.material;
    if let Some(bounds) = material.stretch {
        add(
            "material.stretch".into(),
            "",
            bounds,
            1.0,
            true,
            What::Stretch(table(6, 4).collect()),
        )?;
    }
    if let Some(bounds) = material.bend {
        add(
            "material.bend".into(),
            "",
            bounds,
            1.0,
            true,
            What::Bend(table(3, 5).collect()),
        )?;
    }
    for (column, name) in ["uu", "uv", "vv", "shear"].iter().enumerate() {
        let Some(bounds) = material.stretch_columns else {
            break;
        };
        let entries = table(6, 4).filter(|entry| entry[1] == column).collect();
        add(
            format!("material.stretch_columns {name}"),
            "",
            bounds,
            1.0,
            true,
            What::Stretch(entries),
        )?;
    }
    for (row, degrees) in [0, 45, 90].iter().enumerate() {
        let Some(bounds) = material.bend_rows else {
            break;
        };
        let entries = table(3, 5).filter(|entry| entry[0] == row).collect();
        add(
            format!("material.bend_rows {degrees}°"),
            "",
            bounds,
            1.0,
            true,
            What::Bend(entries),
        )?;
    }
    if let Some(bounds) = material.stretch_entries {
        let rows = &fabric.stretch.0;
        ensure!(
            rows.iter().any(|row| row != &rows[0]),
            "material.stretch_entries: the table of {} says the same at all strains, and is a linear sheet: take stretch_columns",
            fabric.name
        );
        for [r, c] in table(6, 4) {
            let name = format!("material.stretch_entries [{r}][{c}]");
            add(name, "", bounds, 1.0, true, What::Stretch(vec![[r, c]]))?;
        }
    }
    for [r, c] in table(3, 5) {
        let Some(bounds) = material.bend_entries else {
            break;
        };
        add(
            format!("material.bend_entries [{r}][{c}]"),
            "",
            bounds,
            1.0,
            true,
            What::Bend(vec![[r, c]]),
        )?;
    }
    let air = &scene.environment;
    for (bounds, name, unit, first, is_scale, what) in [
        (
            material.density,
            "material.density",
            "kg/m²",
            fabric.density,
            true,
            What::Density,
        ),
        (
            material.damping,
            "material.damping",
            "s",
            fabric.damping,
            false,
            What::Damping,
        ),
        (
            environment.air_density,
            "environment.air_density",
            "kg/m³",
            air.air_density,
            false,
            What::AirDensity,
        ),
        (
            environment.air_drag,
            "environment.air_drag",
            "kg/(m² s)",
            air.air_drag,
            false,
            What::AirDrag,
        ),
    ] {
        if let Some(bounds) = bounds {
            add(name.into(), unit, bounds, first, is_scale, what)?;
        }
    }
    for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
        for (bounds, name, unit, first, what) in [
            (
                environment.wind,
                "environment.wind",
                "m/s",
                air.wind[axis],
                What::Wind(axis),
            ),
            (start.place, "start.place", "m", 0.0, What::Place(axis)),
            (
                start.velocity,
                "start.velocity",
                "m/s",
                0.0,
                What::Velocity(axis),
            ),
            (start.spin, "start.spin", "rad/s", 0.0, What::Spin(axis)),
        ] {
            if let Some(bounds) = bounds {
                add(format!("{name} {letter}"), unit, bounds, first, false, what)?;
            }
        }
    }
    ensure!(
        start.place.is_none() || scene.handles.is_empty(),
        "start.place: the scene has handles, which say where the cloth is: fit motion.translation, or remove the handles"
    );
    if motion.translation.is_some() || motion.rotation_deg.is_some() {
        let Motion::Keyframes(moves) = &scene.motion else {
            bail!(
                "motion: the scene's motion has no keyframes: write [motion.groups], or [motion.inline] with kind = \"keyframes\""
            );
        };
        ensure!(
            scene
                .schedule
                .releases
                .iter()
                .all(|release| release.to.is_none()),
            "motion: a handle that takes hold again does so where the cloth is then, and its motion cannot be fitted: remove `to` from its release"
        );
        for (g, group) in moves.groups.iter().enumerate() {
            let chosen = motion.keyframes.clone();
            for k in chosen.unwrap_or_else(|| (0..group.keyframes.len()).collect()) {
                let Some(keyframe) = group.keyframes.get(k) else {
                    bail!(
                        "motion.keyframes: there is no keyframe {k}: group {g} has {}, from 0",
                        group.keyframes.len()
                    );
                };
                let axes = motion.axes.clone();
                for axis in axes.unwrap_or_else(|| vec![Axis::X, Axis::Y, Axis::Z]) {
                    let Some(bounds) = motion.translation else {
                        break;
                    };
                    let name = format!("motion.translation of group {g}, keyframe {k}, {axis:?}");
                    let axis = axis as usize;
                    add(
                        name,
                        "m",
                        bounds,
                        keyframe.translation[axis],
                        false,
                        What::Translation([g, k, axis]),
                    )?;
                }
                if let Some(bounds) = motion.rotation_deg {
                    let name = format!("motion.rotation_deg of group {g}, keyframe {k}");
                    add(
                        name,
                        "°",
                        bounds,
                        keyframe.rotation_deg,
                        false,
                        What::Turn([g, k]),
                    )?;
                }
            }
        }
    }
    ensure!(
        !all.is_empty(),
        "nothing is to be fitted: give bounds of a number, as [material] stretch = [0.2, 5.0]"
    );
    ensure!(
        all.len() <= MOST,
        "{} numbers are to be fitted, {MOST} at most: leave some out",
        all.len()
    );
    Ok(all)
}
