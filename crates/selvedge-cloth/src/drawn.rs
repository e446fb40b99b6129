//! Cloths drawn at random within bounds: mesh, fabric, handles, air and motion, for a model that is
//! to know many cloths. The same numbers give the same cloth on every machine but for the last
//! digits of powers.
//!
//! Every property is drawn by itself, so that all may come together. A cloth begins as its mesh
//! hangs, flat and at rest, and sags as it moves: there is no rest pose to be found for it.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3Swizzles};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::generate::{GenerateError, Shape, Sheet, SheetSpec, sheet};
use crate::motion::MOTION_RATE;
use crate::{
    Block, Environment, Gust, HandleSchedule, Isotropic, Material, Motion, RandomMotion, Release,
};

mod apart;

/// Peak speed of the paper's training motions `[m/s]`.
const TRAINED_SPEED: f64 = PI / 2.0;
/// Shortest horizontal line of handles that is turned, in parts of the cloth's size.
const LEAST_LINE: f64 = 0.1;
/// Poisson's ratios of isotropic sheets.
const POISSON: [f64; 2] = [0.1, 0.4];
/// Periods of gusts `[s]`.
const GUST_PERIOD: [f64; 2] = [1.0, 4.0];

/// Bounds within which cloths are drawn. A pair is the smallest and the largest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClothRanges {
    /// Shapes, each as likely as the others.
    pub shapes: Vec<Shape>,
    /// Vertices, uniform in their logarithm.
    pub vertices: [usize; 2],
    /// Size of the shape `[m]`, uniform.
    pub size: [f64; 2],
    /// Factors of a fabric's stretching stiffness, bending stiffness and damping, each drawn by
    /// itself, uniform in their logarithm.
    pub stiffness: [f64; 2],
    /// Factor of a fabric's mass per area, uniform in its logarithm.
    pub density: [f64; 2],
    /// Share of cloths whose fabric is made the same in every direction.
    pub isotropic: f64,
    /// Number of handles: as many cloths have at most two as more, if both are within the bounds.
    pub handles: [usize; 2],
    /// Share of cloths that some of their handles let go.
    pub released: f64,
    /// Largest peak speed of handles, in parts of that of the paper's training motions.
    pub speed: f64,
    /// Strongest wind `[m/s]`; half of the cloths have none.
    pub wind: f64,
    /// Strongest gusts, root mean square `[m/s]`; only cloths in wind have them, and half of those.
    pub gusts: f64,
    /// Duration of a motion `[s]`.
    pub duration: f64,
}

/// Bounds that no cloth can be drawn within.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum DrawError {
    #[error("{field} must be {expected}, found {found}")]
    Bounds {
        field: &'static str,
        expected: &'static str,
        found: String,
    },
    #[error("cloth {number}: {source}")]
    Sheet { number: u32, source: GenerateError },
}

/// A cloth that was drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnCloth {
    /// Numbers that the sheet is made from.
    pub spec: SheetSpec,
    /// The sheet, as it hangs at the start.
    pub sheet: Sheet,
    /// The held vertices.
    pub handles: Vec<u32>,
    /// Times at which handles let go.
    pub schedule: HandleSchedule,
    /// The fabric.
    pub material: Material,
    /// Gravity, air and wind.
    pub environment: Environment,
    /// Motion of the handles.
    pub motion: Motion,
}

impl ClothRanges {
    /// Checks every bound; `fabrics` is the number of fabrics to draw from.
    ///
    /// # Errors
    /// Names the field and what was found.
    pub fn validate(&self, fabrics: usize) -> Result<(), DrawError> {
        let error = |field, expected, found| {
            Err(DrawError::Bounds {
                field,
                expected,
                found,
            })
        };
        if fabrics == 0 {
            return error("materials", "at least one fabric", "none".to_owned());
        }
        if self.shapes.is_empty() {
            return error("shapes", "at least one shape", "none".to_owned());
        }
        for (field, [low, high], least) in [
            ("vertices", self.vertices, 30),
            ("handles", self.handles, 0),
        ] {
            if low < least || low > high || (field == "handles" && high > MOST_HANDLES) {
                let expected = match field {
                    "vertices" => "the smallest and the largest number, at least 30",
                    _ => "the smallest and the largest number, at most 17",
                };
                return error(field, expected, format!("[{low}, {high}]"));
            }
        }
        for (field, [low, high]) in [
            ("size", self.size),
            ("stiffness", self.stiffness),
            ("density", self.density),
        ] {
            if !(low > 0.0 && low <= high && high.is_finite()) {
                let expected = "the smallest and the largest, positive";
                return error(field, expected, format!("[{low}, {high}]"));
            }
        }
        for (field, share) in [("isotropic", self.isotropic), ("released", self.released)] {
            if !(0.0..=1.0).contains(&share) {
                return error(field, "a share between 0 and 1", share.to_string());
            }
        }
        for (field, found, [least, most], expected) in [
            ("speed", self.speed, [0.0, 10.0], "between 0 and 10"),
            ("wind", self.wind, [0.0, 100.0], "between 0 and 100 m/s"),
            ("gusts", self.gusts, [0.0, 100.0], "between 0 and 100 m/s"),
            (
                "duration",
                self.duration,
                [1.0, 600.0],
                "between 1 and 600 s",
            ),
        ] {
            if !(least..=most).contains(&found) {
                return error(field, expected, found.to_string());
            }
        }
        Ok(())
    }
}

/// Most handles that are drawn: those along the upper edge of the mesh `triangle`.
const MOST_HANDLES: usize = 17;

impl DrawnCloth {
    /// Draws cloth `number` of the family `seed` within `ranges`, of one of `fabrics`.
    ///
    /// # Errors
    /// [`DrawError`] names the bound that is wrong, or the sheet that cannot be made.
    pub fn draw(
        ranges: &ClothRanges,
        fabrics: &[Material],
        seed: u64,
        number: u32,
    ) -> Result<Self, DrawError> {
        ranges.validate(fabrics.len())?;
        let mut draws = Draws(ChaCha8Rng::seed_from_u64(seed));
        draws.0.set_stream(u64::from(number));
        let [fewest, most] = ranges.vertices.map(|count| count as f64);
        let spec = SheetSpec {
            shape: *draws.one_of(&ranges.shapes),
            vertices: draws.logarithmic([fewest, most]).round() as usize,
            size: draws.uniform(ranges.size),
            // Kept in JSON and TOML, whose integers are signed.
            seed: u64::from(draws.0.next_u32()),
        };
        let sheet = sheet(&spec).map_err(|source| DrawError::Sheet { number, source })?;
        let material = draws.fabric(ranges, fabrics);
        let handles = draws.handles(ranges, &sheet);
        let environment = draws.air(ranges);
        let start: Vec<DVec3> = handles
            .iter()
            .map(|&vertex| sheet.mesh.positions()[vertex as usize])
            .collect();
        let motion = draws.motion(ranges, &start, spec.size, number);
        let schedule = draws.schedule(ranges, handles.len());
        Ok(Self {
            spec,
            sheet,
            handles,
            schedule,
            material,
            environment,
            motion,
        })
    }
}

/// A stream of random numbers, and what is drawn from it.
struct Draws(ChaCha8Rng);

impl Draws {
    fn unit(&mut self) -> f64 {
        const SCALE: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.0.next_u64() >> 11) as f64 * SCALE
    }

    fn is(&mut self, share: f64) -> bool {
        self.unit() < share
    }

    fn uniform(&mut self, range: [f64; 2]) -> f64 {
        range[0] + (range[1] - range[0]) * self.unit()
    }

    fn logarithmic(&mut self, range: [f64; 2]) -> f64 {
        self.uniform(range.map(f64::ln)).exp()
    }

    /// A number from `low` to `high`, both included.
    fn whole(&mut self, low: usize, high: usize) -> usize {
        low + (self.unit() * (high - low + 1) as f64) as usize
    }

    fn one_of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.whole(0, all.len() - 1)]
    }

    /// Uniform on the unit sphere: its height is uniform (Archimedes).
    fn direction(&mut self) -> DVec3 {
        let (height, angle) = (self.uniform([-1.0, 1.0]), self.uniform([0.0, TAU]));
        let radius = (1.0 - height * height).sqrt();
        DVec3::new(radius * angle.cos(), height, radius * angle.sin())
    }

    /// One of the fabrics, multiplied; or a sheet that is as stiff, but the same in every
    /// direction.
    fn fabric(&mut self, ranges: &ClothRanges, fabrics: &[Material]) -> Material {
        let mut material = self.one_of(fabrics).clone();
        let [stretch, bend, damping] = [(); 3].map(|()| self.logarithmic(ranges.stiffness));
        let density = self.logarithmic(ranges.density);
        let ratio = self.uniform(POISSON);
        let is_isotropic = self.is(ranges.isotropic);
        material.name += ", drawn";
        if is_isotropic {
            let sheet = alike(&material, ratio);
            material.stretch = sheet.stretch_table();
            material.bend = sheet.bend_table();
            material.name += ", isotropic";
        }
        material.density *= density;
        material.damping *= damping;
        material.multiplied(stretch, bend)
    }

    fn handles(&mut self, ranges: &ClothRanges, sheet: &Sheet) -> Vec<u32> {
        let [fewest, most] = ranges.handles;
        let (few, many) = (fewest..=most.min(2), fewest.max(3)..=most);
        let is_few = !few.is_empty() && (many.is_empty() || self.is(0.5));
        let range = if is_few { few } else { many };
        let count = self.whole(*range.start(), *range.end());
        let corners = &sheet.labels["upper-corners"];
        match (self.whole(0, 2), count) {
            (_, 0) => Vec::new(),
            (0, 1) => vec![corners[self.whole(0, 1)]],
            (0, 2) => corners.clone(),
            // Evenly from the left corner to the right one.
            (1, 2..) => {
                let [left, right] = [corners[0], corners[1]].map(f64::from);
                let step = (right - left) / (count - 1) as f64;
                let along = (0..count).map(|k| (left + step * k as f64).round() as u32);
                let mut along: Vec<u32> = along.collect();
                along.dedup();
                along
            }
            _ => self.spread(&sheet.labels["boundary"], count),
        }
    }

    /// Up to `count` distinct vertices of `all`, in the order in which they are drawn.
    fn spread(&mut self, all: &[u32], count: usize) -> Vec<u32> {
        let mut left = all.to_vec();
        let count = count.min(left.len());
        let mut chosen = Vec::with_capacity(count);
        for _ in 0..count {
            let place = self.whole(0, left.len() - 1);
            chosen.push(left.swap_remove(place));
        }
        chosen
    }

    fn air(&mut self, ranges: &ClothRanges) -> Environment {
        let (direction, speed) = (self.direction(), self.uniform([0.0, ranges.wind]));
        let (gusts, period) = (self.uniform([0.0, ranges.gusts]), self.uniform(GUST_PERIOD));
        let seed = u64::from(self.0.next_u32());
        let (is_windy, is_gusty) = (self.is(0.5), self.is(0.5));
        let gust = Gust {
            speed: DVec3::splat(gusts),
            period,
            seed,
        };
        match is_windy {
            true => Environment {
                wind: speed * direction,
                gust: (is_gusty && gusts > 0.0).then_some(gust),
                ..Environment::default()
            },
            false => Environment::default(),
        }
    }

    /// All handles together, in moves and turns; or groups of them apart, by keyframes.
    fn motion(&mut self, ranges: &ClothRanges, start: &[DVec3], size: f64, number: u32) -> Motion {
        let seed = u64::from(self.0.next_u32());
        let is_apart = self.is(0.5);
        match start.len() {
            0 => Motion::Blocks {
                blocks: vec![Block::still(whole_frames(ranges.duration))],
            },
            2.. if is_apart => {
                Motion::Keyframes(self.apart(start, size, ranges.speed, ranges.duration))
            }
            _ => {
                let random = RandomMotion {
                    seed,
                    number: u64::from(number),
                    duration: whole_frames(ranges.duration),
                    speed: ranges.speed,
                };
                let mut motion = random.motion();
                // A turn is about a vertical axis through the line from the first to the last.
                let [first, last] = [start[0], start[start.len() - 1]].map(|place| place.xz());
                if let Motion::Blocks { blocks } = &mut motion
                    && first.distance(last) < LEAST_LINE * size
                {
                    blocks.iter_mut().for_each(|block| block.rotation = None);
                }
                motion
            }
        }
    }

    /// Some handles let go in the middle of the motion, and half of them take hold again.
    fn schedule(&mut self, ranges: &ClothRanges, handles: usize) -> HandleSchedule {
        let from = self.uniform([0.2, 0.6]) * ranges.duration;
        let (lasts, takes_hold) = (self.uniform([0.3, 1.5]), self.is(0.5));
        let count = self.whole(1, handles.max(1));
        if handles == 0 || !self.is(ranges.released) {
            return HandleSchedule::default();
        }
        let mut list: Vec<usize> = (0..handles).collect();
        while list.len() > count {
            let place = self.whole(0, list.len() - 1);
            list.remove(place);
        }
        HandleSchedule {
            releases: vec![Release {
                handles: list,
                from: whole_frames(from),
                to: takes_hold.then(|| whole_frames(from + lasts)),
            }],
        }
    }
}

/// The isotropic sheet whose stiffness along and in bending is the mean of the fabric's.
fn alike(material: &Material, ratio: f64) -> Isotropic {
    let rows = &material.stretch.0;
    let along: f64 = rows.iter().map(|row| (row[0] + row[2]) / 2.0).sum();
    // The law doubles the table: 2 k = E h/(1 - ν²).
    let membrane = 2.0 * along / rows.len() as f64;
    let bend = material.bend.0.as_flattened();
    // ke = 4 D, and D = C h²/12.
    let plate = bend.iter().sum::<f64>() / bend.len() as f64 / 4.0;
    let thickness = (12.0 * plate / membrane).sqrt();
    Isotropic {
        youngs_modulus: membrane * (1.0 - ratio * ratio) / thickness,
        poissons_ratio: ratio,
        thickness,
    }
}

/// `seconds` to whole frames of 1/60 s.
fn whole_frames(seconds: f64) -> f64 {
    (seconds * MOTION_RATE).round() / MOTION_RATE
}

#[cfg(test)]
mod tests;
