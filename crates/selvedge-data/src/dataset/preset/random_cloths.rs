//! Cloths drawn at random, each with a fabric, air, handles and a motion of its own.
//!
//! ```toml
//! [random_cloths]
//! train = 96                        # cloths to learn from, called drawn-0 and so on
//! test = 16                         # cloths to test on, called unseen-0 and so on
//! seed = 1
//! materials = ["gray-interlock"]    # the fabrics that are drawn from, and multiplied
//! [random_cloths.ranges]
//! shapes = ["square", "random"]     # see `ClothRanges`
//! vertices = [100, 1600]
//! ```

use super::config::{DrawnSetting, NamedCloth, NamedMotion};
use crate::dataset::Split;
use crate::scene::{GeneratorSpec, MaterialSource, MeshSpec, SceneProblem, field};
use selvedge_cloth::{ClothRanges, DrawError, DrawnCloth, Material, Mesh};
use serde::Deserialize;
use std::path::Path;

/// Most cloths that are drawn for a split.
const MOST_CLOTHS: u32 = 10_000;

/// The file's own words.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RandomCloths {
    train: u32,
    #[serde(default)]
    test: u32,
    seed: u64,
    materials: Vec<MaterialSource>,
    ranges: ClothRanges,
}

/// A drawn cloth with its only motion.
pub(super) struct Drawn {
    pub(super) split: Split,
    pub(super) cloth: NamedCloth,
    pub(super) mesh: Mesh,
    pub(super) motion: NamedMotion,
}

impl RandomCloths {
    /// Draws every cloth; material files are relative to `folder`.
    pub(super) fn draw(self, folder: &Path) -> Result<Vec<Drawn>, SceneProblem> {
        for (key, count) in [("train", self.train), ("test", self.test)] {
            if count > MOST_CLOTHS {
                let problem = format!("must be at most {MOST_CLOTHS}, found {count}");
                return Err(field(format!("random_cloths.{key}"), problem));
            }
        }
        let mut fabrics: Vec<Material> = Vec::with_capacity(self.materials.len());
        for source in &self.materials {
            fabrics.push(source.resolve(folder, &mut Vec::new())?);
        }
        let train = (0..self.train).map(|number| (Split::Train, "drawn", number, number));
        let test = (0..self.test).map(|k| (Split::Test, "unseen", k, self.train + k));
        train
            .chain(test)
            .map(|(split, family, name, number)| {
                let drawn = DrawnCloth::draw(&self.ranges, &fabrics, self.seed, number);
                let name = format!("{family}-{name}");
                drawn
                    .map(|cloth| of(split, name, cloth))
                    .map_err(|error| problem(&error))
            })
            .collect()
    }
}

fn problem(error: &DrawError) -> SceneProblem {
    let key = match error {
        DrawError::Bounds {
            field: "materials", ..
        } => "random_cloths",
        _ => "random_cloths.ranges",
    };
    field(key, error.to_string())
}

fn of(split: Split, name: String, cloth: DrawnCloth) -> Drawn {
    let generator = GeneratorSpec {
        kind: cloth.spec.shape,
        vertices: cloth.spec.vertices,
        size: cloth.spec.size,
        seed: cloth.spec.seed,
    };
    let mesh = MeshSpec::from(generator);
    Drawn {
        split,
        mesh: cloth.sheet.mesh,
        motion: NamedMotion {
            name: name.clone(),
            motion: cloth.motion,
            cloth: Some(name.clone()),
        },
        cloth: NamedCloth {
            name,
            mesh,
            handles: cloth.handles,
            drawn: Some(Box::new(DrawnSetting {
                schedule: cloth.schedule,
                material: cloth.material,
                environment: cloth.environment,
            })),
        },
    }
}
