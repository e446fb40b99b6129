//! The table of `kernels/backward.cu`: the layers of the network that are not products, backward.

use crate::kernels::{Access, Kernel, Parameter, Part, Shape, Width};

use Access::{In, InOut, Indices, Out};

const LATENT: Width = Width::Latents(1);
const ONE: Width = Width::Numbers(1);

const fn latent_rows(name: &'static str, access: Access) -> Parameter {
    Parameter::per_count(name, access, LATENT)
}

/// The file and its kernels.
pub static PART: Part = Part {
    name: "backward.cu",
    text: include_str!("backward.cu"),
    kernels: &[
        &NORM_BACKWARD,
        &MASK_RELU,
        &GATHER_INCOMING,
        &SUM_ENDS,
        &GATES_BACKWARD,
        &GATE_BIASES,
        &ADD,
    ],
};

/// Layer normalisation.
pub static NORM_BACKWARD: Kernel = Kernel {
    name: "norm_backward",
    shape: Shape::Row,
    parameters: &[
        latent_rows("gradient", InOut),
        latent_rows("normal", In),
        Parameter::per_count("inverse", In, ONE),
        Parameter::fixed("weight", In, LATENT),
        latent_rows("by_weight", Out),
    ],
};

/// ReLU.
pub static MASK_RELU: Kernel = Kernel {
    name: "mask_relu",
    shape: Shape::Element,
    parameters: &[
        Parameter::per_count("gradient", InOut, ONE),
        Parameter::per_count("kept", In, ONE),
    ],
};

/// The gradient of messages from those of arcs and of sums of messages.
pub static GATHER_INCOMING: Kernel = Kernel {
    name: "gather_incoming",
    shape: Shape::Row,
    parameters: &[
        latent_rows("edges", In),
        Parameter::any("incoming", In),
        Parameter::per_count("receivers", Indices, ONE),
        latent_rows("messages", Out),
    ],
};

/// The gradient of what vertices add to the first edge layer.
pub static SUM_ENDS: Kernel = Kernel {
    name: "sum_ends",
    shape: Shape::Row,
    parameters: &[
        Parameter::any("first", In),
        Parameter::any("first_arc", Indices),
        Parameter::any("twins", Indices),
        Parameter::per_count("sums", Out, Width::Latents(2)),
    ],
};

/// One step of a gated recurrent unit.
pub static GATES_BACKWARD: Kernel = Kernel {
    name: "gates_backward",
    shape: Shape::Row,
    parameters: &[
        Parameter::per_count("kept", In, Width::Latents(4)),
        latent_rows("before", In),
        latent_rows("state", InOut),
        Parameter::per_count("sums", Out, Width::Latents(4)),
    ],
};

/// The biases of a gated recurrent unit, an element per bias.
pub static GATE_BIASES: Kernel = Kernel {
    name: "gate_biases",
    shape: Shape::Element,
    parameters: &[
        Parameter::fixed("sums", In, Width::Latents(4)),
        Parameter::per_count("to_input", InOut, ONE),
        Parameter::per_count("to_recurrent", InOut, ONE),
    ],
};

/// Adds one array to another.
pub static ADD: Kernel = Kernel {
    name: "add",
    shape: Shape::Element,
    parameters: &[
        Parameter::per_count("to", InOut, ONE),
        Parameter::per_count("what", In, ONE),
    ],
};
