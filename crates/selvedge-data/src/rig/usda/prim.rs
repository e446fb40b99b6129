//! A stage and its prims, as far as nodes and meshes need them, whatever they were read from.

use glam::DMat4;

use super::super::node::{Rig, RigNode};
use super::operations::{Attribute, RESET, Samples, named, operations_of};

/// USD's own defaults.
const CODES_PER_SECOND: f64 = 24.0;
const METRES_PER_UNIT: f64 = 0.01;

/// Metadata of a stage.
pub(super) struct Stage {
    pub(super) codes_per_second: Option<f64>,
    pub(super) frames_per_second: Option<f64>,
    pub(super) start_code: Option<f64>,
    pub(super) metres_per_unit: f64,
    pub(super) is_z_up: bool,
}

impl Default for Stage {
    fn default() -> Self {
        Self {
            codes_per_second: None,
            frames_per_second: None,
            start_code: None,
            metres_per_unit: METRES_PER_UNIT,
            is_z_up: false,
        }
    }
}

impl Stage {
    /// Time codes per second.
    pub(super) fn rate(&self) -> f64 {
        let codes = self.codes_per_second.or(self.frames_per_second);
        codes.unwrap_or(CODES_PER_SECOND)
    }

    /// Transform from the world of the stage to ours.
    fn world(&self) -> DMat4 {
        let scale = DMat4::from_scale(glam::DVec3::splat(self.metres_per_unit));
        match self.is_z_up {
            true => DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2) * scale,
            false => scale,
        }
    }
}

/// A prim under way.
#[derive(Default)]
pub(super) struct Prim {
    pub(super) name: String,
    pub(super) parent: Option<usize>,
    /// Operations, and arrays that make a mesh by the names of [`super::meshes`].
    pub(super) attributes: Vec<Attribute>,
    pub(super) order: Option<Vec<String>>,
    pub(super) obstacle: Option<String>,
    /// What it brings from elsewhere, which is not read.
    pub(super) composed: Option<String>,
    /// Type of the prim.
    pub(super) kind: String,
    /// True where it is a class, which stands for nothing itself.
    pub(super) is_class: bool,
    pub(super) is_invisible: bool,
    /// Its own purpose.
    pub(super) purpose: Option<String>,
    /// True where it has properties of `skel:`.
    pub(super) is_skinned: bool,
}

impl Prim {
    /// Keeps what it brings from elsewhere, which is not read.
    pub(super) fn composes(&mut self, what: &str) {
        let problem = format!(
            "it has {what}, which are not followed here: flatten the stage (usdcat --flatten)"
        );
        self.obstacle.get_or_insert(problem.clone());
        self.composed.get_or_insert(problem);
    }

    /// Keeps what an attribute with a token says of the prim.
    pub(super) fn says(&mut self, name: &str, token: &str) {
        match name {
            "visibility" => self.is_invisible = token == "invisible",
            "purpose" => self.purpose = Some(token.to_owned()),
            _ => {}
        }
    }

    /// The first numbers of an array that makes a mesh.
    pub(super) fn array(&self, name: &str) -> Option<&[f64]> {
        match &named(&self.attributes, name)?.samples {
            Samples::Constant(numbers) => Some(numbers),
            Samples::Timed(samples) => Some(&samples.first()?.1),
        }
    }

    /// Takes the samples of an array by their time codes; none where it has one value.
    pub(super) fn take_samples(&mut self, name: &str) -> Vec<(f64, Vec<f64>)> {
        let own = self.attributes.iter_mut().filter(|a| a.name == name);
        let mut samples = own.filter_map(|attribute| match &mut attribute.samples {
            Samples::Timed(samples) => Some(std::mem::take(samples)),
            Samples::Constant(_) => None,
        });
        samples.next().unwrap_or_default()
    }
}

/// The rig of these prims.
pub(super) fn rig(prims: &[Prim], stage: &Stage) -> Rig {
    let rate = stage.rate();
    let attributes = prims.iter().flat_map(|prim| &prim.attributes);
    let codes = attributes.flat_map(|attribute| attribute.samples.codes());
    let first = codes.chain(stage.start_code).reduce(f64::min);
    Rig {
        nodes: prims.iter().map(|prim| node(prim, rate)).collect(),
        world: stage.world(),
        start: first.unwrap_or_default() / rate,
        warnings: Vec::new(),
    }
}

fn node(prim: &Prim, rate: f64) -> RigNode {
    let mut obstacle = prim.obstacle.clone();
    let operations = match operations_of(&prim.attributes, prim.order.as_deref(), rate) {
        Ok(operations) => operations,
        Err(problem) => {
            obstacle = obstacle.or(Some(problem));
            Vec::new()
        }
    };
    let stands_alone = prim.order.iter().flatten().any(|op| op == RESET);
    RigNode {
        name: prim.name.clone(),
        parent: if stands_alone { None } else { prim.parent },
        operations,
        obstacle,
    }
}
