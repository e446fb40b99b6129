//! Kernels as schedules and launchers see them: name, shape and parameters. `signature` reads them
//! from the C source.

use selvedge_model::ModelSpec;

use crate::schedule::plan::Element;

/// The unit of work of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A thread each.
    Element,
    /// A warp each.
    Row,
}

/// The use that a kernel makes of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reads it.
    Read,
    /// Writes all of it.
    Write,
    /// Reads and writes it.
    Update,
}

impl Access {
    /// True where the kernel depends on the values that were there before.
    #[must_use]
    pub fn reads(self) -> bool {
        self != Self::Write
    }

    /// True where the kernel leaves other values.
    #[must_use]
    pub fn writes(self) -> bool {
        self != Self::Read
    }
}

/// A factor of a [`Width`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Factor {
    /// Nothing but the width's number.
    One,
    /// The width of a latent vector.
    Latent,
    /// The columns of a vertex.
    NodeColumns,
    /// The columns of an arc.
    EdgeColumns,
    /// The value of a count with this name in the same launch.
    Count(&'static str),
}

/// A number of elements: a number times up to two factors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width {
    pub(super) number: usize,
    pub(super) factors: [Factor; 2],
}

impl Width {
    /// The number of elements, for a network and the counts of a launch. None where a count is
    /// missing.
    #[must_use]
    pub fn of(self, sizes: Sizes, count: impl Fn(&str) -> Option<usize>) -> Option<usize> {
        let mut product = self.number;
        for factor in self.factors {
            product *= match factor {
                Factor::One => 1,
                Factor::Latent => sizes.latent,
                Factor::NodeColumns => sizes.node_width,
                Factor::EdgeColumns => sizes.edge_width,
                Factor::Count(name) => count(name)?,
            };
        }
        Some(product)
    }
}

/// The size of an array that a kernel takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// A width for each element or row of the launch.
    PerCount(Width),
    /// One width.
    Fixed(Width),
    /// A size that depends on the contents of other arrays.
    Any,
}

/// The kind of value that a parameter takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A pointer to an array.
    Array {
        /// The type of its elements.
        element: Element,
        /// The use that is made of it.
        access: Access,
        /// The size of it.
        extent: Extent,
        /// True where a null pointer is allowed.
        optional: bool,
    },
    /// A `u32`.
    Count,
    /// An `f32`.
    Number,
}

/// A parameter of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The name in the source.
    pub name: &'static str,
    /// The kind of its values.
    pub kind: Kind,
}

impl Parameter {
    /// The type in C.
    pub(super) fn c_type(&self) -> &'static str {
        let (element, access) = match self.kind {
            Kind::Array {
                element, access, ..
            } => (element, access),
            Kind::Count => return "unsigned ",
            Kind::Number => return "float ",
        };
        match (element, access) {
            (Element::Float, Access::Read) => "const float *",
            (Element::Float, _) => "float *",
            (Element::Index, Access::Read) => "const unsigned *",
            (Element::Index, _) => "unsigned *",
            (Element::Double, Access::Read) => "const double *",
            (Element::Double, _) => "double *",
        }
    }
}

/// The most parameters of a kernel.
pub(super) const MOST: usize = 32;

/// A kernel as schedules and launchers see it. An array that one launch reads and one that it
/// writes may be the same region, and do not overlap otherwise.
#[derive(Debug, PartialEq, Eq)]
pub struct Kernel {
    /// The name in the source.
    pub name: &'static str,
    /// The unit of work.
    pub shape: Shape,
    pub(super) parameters: [Parameter; MOST],
    pub(super) count: usize,
}

impl Kernel {
    /// The parameters after the number of elements, rows or blocks, in the order of the source.
    #[must_use]
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters[..self.count]
    }
}

/// Sizes of a network that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Width of a latent vector.
    pub latent: usize,
    /// Columns of a vertex.
    pub node_width: usize,
    /// Columns of an arc.
    pub edge_width: usize,
}

impl Sizes {
    /// The sizes of a spec.
    #[must_use]
    pub fn of(spec: &ModelSpec) -> Self {
        Self {
            latent: spec.latent,
            node_width: spec.node_width(),
            edge_width: spec.edge_width(),
        }
    }
}
