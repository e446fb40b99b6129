//! A stage and its prims, as far as nodes and meshes need them, whatever they were read from.

use glam::DMat4;

use super::super::node::{Rig, RigNode};
use super::meshes;
use super::operations::{Attribute, RESET, Samples, named, operations_of};

/// USD's own defaults.
const CODES_PER_SECOND: f64 = 24.0;
const METRES_PER_UNIT: f64 = 0.01;

/// Metadata of a stage.
pub(super) struct Stage {
    pub(super) codes_per_second: Option<f64>,
    pub(super) frames_per_second: Option<f64>,
    pub(super) start_code: Option<f64>,
    pub(super) end_code: Option<f64>,
    pub(super) metres_per_unit: f64,
    pub(super) is_z_up: bool,
}

impl Default for Stage {
    fn default() -> Self {
        Self {
            codes_per_second: None,
            frames_per_second: None,
            start_code: None,
            end_code: None,
            metres_per_unit: METRES_PER_UNIT,
            is_z_up: false,
        }
    }
}

impl Stage {
    /// Keeps a piece of metadata, a number or a token; others are passed over.
    pub(super) fn set(
        &mut self,
        key: &str,
        number: Option<f64>,
        token: &str,
    ) -> Result<(), String> {
        let number = number.filter(|number| number.is_finite());
        let finite = || number.ok_or_else(|| format!("{key} must be a finite number"));
        let positive = || match finite()? {
            number if number > 0.0 => Ok(number),
            number => Err(format!("{key} must be positive, found {number}")),
        };
        match (key, token) {
            ("timeCodesPerSecond", _) => self.codes_per_second = Some(positive()?),
            ("framesPerSecond", _) => self.frames_per_second = Some(positive()?),
            ("metersPerUnit", _) => self.metres_per_unit = positive()?,
            ("startTimeCode", _) => self.start_code = Some(finite()?),
            ("endTimeCode", _) => self.end_code = Some(finite()?),
            ("upAxis", "Y" | "Z") => self.is_z_up = token == "Z",
            ("upAxis", _) => return Err(format!("upAxis: expected Y or Z, found {token:?}")),
            _ => {}
        }
        Ok(())
    }

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
#[derive(Clone, Default)]
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
    /// Reason why it is not there, with all that is in it.
    pub(super) absence: Option<Absence>,
    /// Path of the prim in the same file that it is an instance of.
    pub(super) reference: Option<String>,
    pub(super) purpose: Option<String>,
    /// True where it has properties of `skel:`.
    pub(super) is_skinned: bool,
    /// True where its faces are all there is, and no cage of a subdivision surface.
    pub(super) is_polygonal: bool,
    /// True where its visibility has time samples.
    pub(super) is_timed: bool,
}

/// What is kept of a property.
pub(super) enum Kept {
    Nothing,
    /// The order of its operations.
    Order,
    /// The numbers of an operation.
    Operation,
    /// Numbers that make a mesh, under this name.
    Array(String),
}

/// Reasons why a prim is not there, the weakest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Absence {
    /// It is a guide, or a proxy of what is rendered.
    StandsIn,
    Invisible,
    /// It is an `over`: it changes what this file does not define.
    Undefined,
    /// It is a class, or the original of instances, and stands for nothing itself.
    Class,
    Inactive,
}

impl Prim {
    /// Keeps that it is not there.
    pub(super) fn is_absent(&mut self, why: Absence) {
        self.absence = self.absence.max(Some(why));
    }

    /// Keeps its specifier, other than `def`; what follows a node of it is told why it cannot.
    pub(super) fn specifies(&mut self, is_class: bool) {
        let (why, problem) = match is_class {
            true => (
                Absence::Class,
                "it is a class, which is no node itself: give the name of a prim that is defined (def)",
            ),
            false => (
                Absence::Undefined,
                "it is an over of what this file does not define: take the stage that has it whole, flattened (usdcat --flatten)",
            ),
        };
        self.is_absent(why);
        self.obstacle = Some(problem.to_owned());
    }

    /// Keeps what it brings from elsewhere, which is not read.
    pub(super) fn composes(&mut self, what: &str) {
        let problem = format!(
            "it has {what}, which are not followed here: flatten the stage (usdcat --flatten)"
        );
        self.obstacle.get_or_insert(problem.clone());
        self.composed.get_or_insert(problem);
    }

    /// Keeps that its reference to a prim of the same file is not followed.
    pub(super) fn composes_within(&mut self, path: &str) {
        let problem = format!(
            "its reference to <{path}> is not followed here: set instanceable = false and flatten the stage (usdcat --flatten), or export .glb"
        );
        self.obstacle.get_or_insert(problem.clone());
        self.composed.get_or_insert(problem);
    }

    /// The same prim within another one.
    pub(super) fn copy(&self, parent: Option<usize>) -> Self {
        Self {
            parent,
            ..self.clone()
        }
    }

    /// Takes from the prim that it refers to what it does not have itself.
    pub(super) fn takes(&mut self, other: Self) {
        for attribute in other.attributes {
            if named(&self.attributes, &attribute.name).is_none() {
                self.attributes.push(attribute);
            }
        }
        if self.kind.is_empty() {
            self.kind = other.kind;
        }
        if let Some(problem) = other.composed {
            self.obstacle.get_or_insert(problem.clone());
            self.composed.get_or_insert(problem);
        }
        self.order = self.order.take().or(other.order);
        self.purpose = self.purpose.take().or(other.purpose);
        let is_invisible = other.absence == Some(Absence::Invisible);
        self.absence = self.absence.max(is_invisible.then_some(Absence::Invisible));
        self.is_skinned |= other.is_skinned;
        self.is_polygonal |= other.is_polygonal;
        self.is_timed |= other.is_timed;
    }

    /// Keeps what the type, the name and the token (if it is one) of a property say of the prim, and
    /// says what of its value is to be kept; of arrays only where they are wanted.
    pub(super) fn takes_property(
        &mut self,
        kind: &str,
        name: &str,
        token: Option<&str>,
        is_timed: bool,
        wants_arrays: bool,
    ) -> Kept {
        if name == "xformOpOrder" {
            return Kept::Order;
        }
        match (name, token) {
            ("visibility", Some("invisible")) => self.is_absent(Absence::Invisible),
            ("subdivisionScheme", Some(token)) => self.is_polygonal = token == "none",
            ("purpose", Some(token)) => self.purpose = Some(token.to_owned()),
            _ => {}
        }
        self.is_skinned |= meshes::is_of_skeleton(name);
        self.is_timed |= name == "visibility" && is_timed;
        match meshes::array_of(kind, name).filter(|_| wants_arrays) {
            Some(array) => Kept::Array(array),
            None if name.starts_with("xformOp:") => Kept::Operation,
            None => Kept::Nothing,
        }
    }

    /// Keeps that an operation gets its value from another property.
    pub(super) fn connects(&mut self, name: &str) {
        let problem = format!("its {name} is not understood here: bake it to samples");
        self.obstacle = Some(problem);
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

pub(super) fn rig(prims: &[Prim], stage: &Stage) -> Rig {
    let rate = stage.rate();
    let attributes = prims.iter().flat_map(|prim| &prim.attributes);
    let codes = attributes.flat_map(|attribute| attribute.samples.codes());
    let ends = codes.fold(None, |ends: Option<[f64; 2]>, code| {
        let [first, last] = ends.unwrap_or([code; 2]);
        Some([first.min(code), last.max(code)])
    });
    // A range that ends before it begins, or begins after the last key, says nothing.
    let is_range = |start: &f64| {
        let last = ends.map_or(f64::INFINITY, |ends| ends[1]);
        *start <= stage.end_code.unwrap_or(f64::INFINITY).min(last)
    };
    let start = stage.start_code.filter(is_range);
    let first = start.or(ends.map(|ends| ends[0]));
    Rig {
        nodes: prims.iter().map(|prim| node(prim, rate)).collect(),
        world: stage.world(),
        start: first.unwrap_or_default() / rate,
        warnings: Vec::new(),
        meshes: Vec::new(),
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
