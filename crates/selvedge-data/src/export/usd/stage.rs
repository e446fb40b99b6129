//! A stage of USD before it is written: prims, their properties, and values that are made when they
//! are wanted.

use std::io;

use glam::{Vec2, Vec3};

/// Points `[points]` in the frame taken as a number.
pub(super) type Frame<'a> = Box<dyn Fn(usize) -> io::Result<Vec<Vec3>> + 'a>;

/// A stage: metadata and prims.
pub(super) struct Stage<'a> {
    /// Letter of the axis that points up.
    pub(super) up: &'static str,
    /// Time codes per second.
    pub(super) rate: f64,
    /// Text about the stage.
    pub(super) made_by: &'a str,
    /// Time codes of the samples, from 0.
    pub(super) codes: Vec<usize>,
    /// Prims of the root, the default one first.
    pub(super) prims: Vec<Prim<'a>>,
}

pub(super) struct Prim<'a> {
    pub(super) name: String,
    /// Type of the schema.
    pub(super) kind: &'static str,
    /// True for the root of a model.
    pub(super) is_component: bool,
    /// Schemas that are applied to it.
    pub(super) applies: Vec<&'static str>,
    pub(super) properties: Vec<Property<'a>>,
    pub(super) children: Vec<Prim<'a>>,
}

/// A property of a prim.
pub(super) struct Property<'a> {
    pub(super) name: &'static str,
    /// Name of its type; empty for a relationship.
    pub(super) kind: &'static str,
    pub(super) is_uniform: bool,
    /// Number of values that there are: per vertex, per corner of a face, one.
    pub(super) interpolation: Option<&'static str>,
    pub(super) value: Value<'a>,
}

/// A value of a property.
pub(super) enum Value<'a> {
    /// Declared without a value.
    Nothing,
    Flag(bool),
    Token(&'static str),
    Tokens(&'static [&'static str]),
    Number(f32),
    Whole(Vec<i32>),
    Pairs(Vec<Vec2>),
    Triple(Vec3),
    Triples(Vec<Vec3>),
    /// Lists by the time code.
    Frames(Frame<'a>),
    /// A place in double precision by the time code.
    Places(Box<dyn Fn(usize) -> Vec3 + 'a>),
    /// The path of a prim that a relationship leads to.
    Target(String),
    /// The path of a property that this one is connected to.
    Source(String),
}

impl<'a> Prim<'a> {
    /// A prim without properties.
    pub(super) fn new(name: impl Into<String>, kind: &'static str) -> Self {
        Self {
            name: name.into(),
            kind,
            is_component: false,
            applies: Vec::new(),
            properties: Vec::new(),
            children: Vec::new(),
        }
    }

    /// Adds a property of this type and name.
    pub(super) fn add(
        &mut self,
        kind: &'static str,
        name: &'static str,
        value: Value<'a>,
    ) -> &mut Property<'a> {
        let number = self.properties.len();
        self.properties.push(Property {
            name,
            kind,
            is_uniform: false,
            interpolation: None,
            value,
        });
        &mut self.properties[number]
    }

    /// Adds a property that never varies over time.
    pub(super) fn add_uniform(&mut self, kind: &'static str, name: &'static str, value: Value<'a>) {
        self.add(kind, name, value).is_uniform = true;
    }
}
