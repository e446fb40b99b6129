//! The source of the kernels for one network: sizes as definitions, a prelude for the compiler at
//! hand, signatures from tables, and the bodies from `kernels/`.
//!
//! The bodies are C99 that is also CUDA C. A kernel does its work for one *element* (`ELEMENT`), one
//! *row* (`ROW`: on a GPU a warp, whose `LANES` take the row's columns in turns from `LANE` on and
//! join their sums by `SUM_OVER_LANES`), or one *block* (`BLOCK`, whose `THREADS` meet at `BARRIER`).
//! On the host all of them have one lane and one thread. What a kernel is called with stands in a table
//! here and not in its source, so that source, schedules and both launchers agree.

pub mod backward;
pub mod layers;
mod signature;

use std::fmt::Write;

pub use signature::{Access, Extent, Kernel, Parameter, Part, Shape, Sizes, Width};

/// Who compiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    /// NVRTC.
    Cuda,
    /// The C compiler of this machine.
    Host,
}

/// Threads of a block on a GPU, for elements and rows; 8 warps.
pub const BLOCK_THREADS: u32 = 256;

/// Threads of a block on a GPU where a block is what a kernel works on.
pub const WIDE_BLOCK_THREADS: u32 = 1024;

/// Lanes of a warp.
pub const WARP: u32 = 32;

/// All kernels for one network.
#[derive(Clone, Debug)]
pub struct Program {
    sizes: Sizes,
    definitions: Vec<(String, String)>,
    parts: Vec<&'static Part>,
}

impl Program {
    /// A program for networks of these sizes, with no kernels yet.
    #[must_use]
    pub fn new(sizes: Sizes) -> Self {
        let mut program = Self {
            sizes,
            definitions: Vec::new(),
            parts: Vec::new(),
        };
        program.define("LATENT", sizes.latent);
        program.define("NODE_WIDTH", sizes.node_width);
        program.define("EDGE_WIDTH", sizes.edge_width);
        program
    }

    /// The sizes that it is for.
    #[must_use]
    pub fn sizes(&self) -> Sizes {
        self.sizes
    }

    /// Adds a definition that all kernels see.
    pub fn define(&mut self, name: &str, value: impl ToString) {
        let definition = (name.to_owned(), value.to_string());
        if !self.definitions.contains(&definition) {
            self.definitions.push(definition);
        }
    }

    /// Adds kernels, once.
    pub fn add(&mut self, part: &'static Part) {
        if !self.parts.iter().any(|known| known.name == part.name) {
            self.parts.push(part);
        }
    }

    /// All kernels.
    pub fn kernels(&self) -> impl Iterator<Item = &'static Kernel> + '_ {
        self.parts.iter().flat_map(|part| part.kernels).copied()
    }

    /// The source.
    #[must_use]
    pub fn text(&self, dialect: Dialect) -> String {
        let mut text = String::new();
        for (name, value) in &self.definitions {
            // Writing to a string does not fail.
            let _ = writeln!(text, "#define {name} {value}");
        }
        text.push_str(match dialect {
            Dialect::Cuda => include_str!("cuda.h"),
            Dialect::Host => include_str!("host.h"),
        });
        text.push_str(include_str!("common.h"));
        for kernel in self.kernels() {
            let _ = writeln!(
                text,
                "#define SIGNATURE_{} INNER void of_{}({})",
                kernel.name,
                kernel.name,
                inner_parameters(kernel)
            );
        }
        for part in &self.parts {
            let _ = writeln!(text, "#line 1 \"{}\"", part.name);
            text.push_str(part.text);
        }
        for kernel in self.kernels() {
            match dialect {
                Dialect::Cuda => cuda_entry(&mut text, kernel),
                Dialect::Host => host_entry(&mut text, kernel),
            }
        }
        if dialect == Dialect::Host {
            text.push_str(include_str!("host_product.c"));
        }
        text
    }
}

fn index_name(shape: Shape) -> &'static str {
    match shape {
        Shape::Element => "ELEMENT",
        Shape::Row => "ROW",
        Shape::Block => "BLOCK",
    }
}

fn declarations(kernel: &Kernel) -> impl Iterator<Item = String> {
    let parameters = kernel.parameters.iter();
    parameters.map(|p| format!("{}{}", p.access.c_type(), p.name))
}

fn inner_parameters(kernel: &Kernel) -> String {
    let index = format!("const unsigned {}", index_name(kernel.shape));
    let all: Vec<String> = std::iter::once(index).chain(declarations(kernel)).collect();
    all.join(", ")
}

fn names(kernel: &Kernel) -> String {
    kernel
        .parameters
        .iter()
        .map(|p| format!(", {}", p.name))
        .collect()
}

/// What the driver launches: which element, row or block a thread belongs to.
fn cuda_entry(text: &mut String, kernel: &Kernel) {
    let index = match kernel.shape {
        Shape::Element => "blockIdx.x * blockDim.x + threadIdx.x",
        Shape::Row => "(blockIdx.x * blockDim.x + threadIdx.x) / LANES",
        Shape::Block => "blockIdx.x",
    };
    let threads = match kernel.shape {
        Shape::Element | Shape::Row => BLOCK_THREADS,
        Shape::Block => WIDE_BLOCK_THREADS,
    };
    let declarations: String = declarations(kernel).map(|d| format!(", {d}")).collect();
    let (name, names) = (kernel.name, names(kernel));
    // With the bound the compiler takes no more registers than a block of so many threads has.
    let _ = writeln!(
        text,
        "extern \"C\" __global__ void __launch_bounds__({threads})\n\
         run_{name}(unsigned count{declarations}) {{\n    \
         const unsigned index = {index};\n    \
         if (index < count) of_{name}(index{names});\n}}"
    );
}

/// What the host calls: arguments behind pointers, as the driver of a GPU takes them.
fn host_entry(text: &mut String, kernel: &Kernel) {
    let (name, names) = (kernel.name, names(kernel));
    let _ = writeln!(text, "void run_{name}(void **arguments, unsigned count) {{");
    for (number, (declaration, parameter)) in
        declarations(kernel).zip(kernel.parameters).enumerate()
    {
        let c_type = parameter.access.c_type();
        let _ = writeln!(text, "    {declaration} = *({c_type}*)arguments[{number}];");
    }
    let _ = writeln!(
        text,
        "    for (unsigned index = 0; index < count; ++index) of_{name}(index{names});\n}}"
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::layers;

    #[test]
    fn signatures_entries_and_bodies_agree() {
        let mut program = Program::new(Sizes {
            latent: 48,
            node_width: 16,
            edge_width: 10,
        });
        program.add(&layers::PART);
        program.add(&layers::PART);
        let cuda = program.text(Dialect::Cuda);
        assert!(cuda.contains("#define LATENT 48\n"));
        for kernel in program.kernels() {
            let body = format!("KERNEL({})", kernel.name);
            assert_eq!(cuda.matches(&body).count(), 1, "{body}");
            let entry = format!("\nrun_{}(unsigned count, ", kernel.name);
            assert_eq!(cuda.matches(&entry).count(), 1, "{entry}");
        }
        let bodies = cuda
            .lines()
            .filter(|line| line.starts_with("KERNEL("))
            .count();
        assert_eq!(bodies, program.kernels().count());
    }
}
