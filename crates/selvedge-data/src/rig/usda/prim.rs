//! A stage and its prims, as far as nodes and meshes need them, whatever they were read from.

use glam::DMat4;

use super::super::node::{Rig, RigNode};
use super::meshes;
use super::operations::{Attribute, RESET, Samples, named, operations_of};
use crate::rig::track::ends;

/// USD's own defaults.
const CODES_PER_SECOND: f64 = 24.0;
const METRES_PER_UNIT: f64 = 0.01;

/// Metadata of a stage.
#[derive(Default)]
pub(super) struct Stage {
    codes_per_second: Option<f64>,
    frames_per_second: Option<f64>,
    start_code: Option<f64>,
    end_code: Option<f64>,
    metres_per_unit: Option<f64>,
    is_z_up: bool,
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
            ("metersPerUnit", _) => self.metres_per_unit = Some(positive()?),
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
        let unit = self.metres_per_unit.unwrap_or(METRES_PER_UNIT);
        let scale = DMat4::from_scale(glam::DVec3::splat(unit));
        if self.is_z_up {
            DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2) * scale
        } else {
            scale
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
        let (why, problem) = if is_class {
            (
                Absence::Class,
                "it is a class, which is no node itself: give the name of a prim that is defined (def)",
            )
        } else {
            (
                Absence::Undefined,
                "it is an over of what this file does not define: take the stage that has it whole, flattened (usdcat --flatten)",
            )
        };
        self.is_absent(why);
        self.obstacle = Some(problem.to_owned());
    }

    /// Keeps what it brings from elsewhere, which is not read.
    pub(super) fn composes(&mut self, what: &str) {
        self.lacks(format!(
            "it has {what}, which are not followed here: flatten the stage (usdcat --flatten)"
        ));
    }

    /// Keeps the first reason why what it brings from elsewhere is not read.
    pub(super) fn lacks(&mut self, problem: String) {
        self.obstacle.get_or_insert(problem.clone());
        self.composed.get_or_insert(problem);
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
            self.lacks(problem);
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
        let samples = &named(&self.attributes, name)?.samples;
        samples.first().map(|sample| sample.1.as_slice())
    }

    /// Takes the samples of an array by their time codes; none where it has one value.
    pub(super) fn take_samples(&mut self, name: &str) -> Samples {
        let mut attributes = self.attributes.iter_mut();
        let own = attributes.find(|attribute| attribute.is_timed && attribute.name == name);
        own.map(|attribute| std::mem::take(&mut attribute.samples))
            .unwrap_or_default()
    }
}

pub(super) fn rig(prims: &[Prim], stage: &Stage) -> Rig {
    let rate = stage.rate();
    let attributes = prims.iter().flat_map(|prim| &prim.attributes);
    let timed = attributes.filter(|attribute| attribute.is_timed);
    let ends = ends(timed.flat_map(|timed| timed.samples.iter().map(|sample| sample.0)));
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
