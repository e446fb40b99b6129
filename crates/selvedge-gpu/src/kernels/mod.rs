//! The kernels, each file of C beside the Rust file that names its kernels, and the source that a
//! device compiles for one network: definitions of sizes, a prelude for the compiler, the kernels,
//! and an entry for each.
//!
//! The C is C99 that is also CUDA C. A kernel works on one *element* (`ELEMENT`) or one *row*
//! (`ROW`). On a GPU a row belongs to a warp: its `LANES` take the columns in turn from `LANE` on
//! and join their sums by `SUM_OVER_LANES`. The host has one lane. The signature in the C source is
//! the only list of a kernel's parameters: `signature` reads it for schedules and launchers.

pub mod adam;
pub mod backward;
pub mod features;
pub mod features_backward;
mod gates;
mod kernel;
pub mod layers;
pub mod losses;
pub mod motion;
mod signature;

use std::fmt::Write;

pub use kernel::{Access, Extent, Factor, Kernel, Kind, Parameter, Shape, Sizes, Width};

/// Declares the kernels of a file as statics, and the file itself as `PART`.
macro_rules! part {
    ($file:literal: $($kernel:ident = $name:literal),+ $(,)?) => {
        /// The file and its kernels.
        pub static PART: $crate::kernels::Part = $crate::kernels::Part {
            name: $file,
            text: TEXT,
            kernels: &[$(&$kernel),+],
        };
        const TEXT: &str = include_str!($file);
        $(
            #[doc = concat!("The kernel `", $name, "` of `", $file, "`.")]
            pub static $kernel: $crate::kernels::Kernel = $crate::kernels::Kernel::of(TEXT, $name);
        )+
    };
}
use part;

/// A compiler of kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    /// NVRTC.
    Cuda,
    /// The C compiler of this machine.
    Host,
}

/// Threads of a block on a GPU; 8 warps.
pub const BLOCK_THREADS: u32 = 256;

/// Lanes of a warp.
pub const WARP: u32 = 32;

/// A file of kernels.
#[derive(Debug)]
pub struct Part {
    /// The name of the file.
    pub name: &'static str,
    /// Its contents.
    pub text: &'static str,
    /// The kernels in it.
    pub kernels: &'static [&'static Kernel],
}

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
        for (name, value) in gates::definitions() {
            program.define(&name, value);
        }
        program
    }

    /// The sizes of its networks.
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

    /// Adds the kernels of a file, once.
    pub fn add(&mut self, part: &'static Part) {
        if !self.parts.iter().any(|known| known.name == part.name) {
            self.parts.push(part);
        }
    }

    /// All kernels.
    pub fn kernels(&self) -> impl Iterator<Item = &'static Kernel> + '_ {
        self.parts.iter().flat_map(|part| part.kernels).copied()
    }

    /// The source for a compiler.
    #[must_use]
    pub fn text(&self, dialect: Dialect) -> String {
        let mut text = self.definitions();
        text.push_str(match dialect {
            Dialect::Cuda => include_str!("cuda.h"),
            Dialect::Host => include_str!("host.h"),
        });
        text.push_str(include_str!("common.h"));
        text.push_str(include_str!("wide.h"));
        for part in &self.parts {
            // Writing to a string does not fail.
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

    /// The definitions that the files of kernels are compiled with.
    fn definitions(&self) -> String {
        let lines = self.definitions.iter();
        lines
            .map(|(name, value)| format!("#define {name} {value}\n"))
            .collect()
    }
}

fn declarations(kernel: &Kernel) -> impl Iterator<Item = String> {
    let parameters = kernel.parameters().iter();
    parameters.map(|p| format!("{}{}", p.c_type(), p.name))
}

fn names(kernel: &Kernel) -> String {
    let parameters = kernel.parameters().iter();
    parameters.map(|p| format!(", {}", p.name)).collect()
}

/// Writes the function that the driver launches, which finds the element or row of a thread.
fn cuda_entry(text: &mut String, kernel: &Kernel) {
    let index = match kernel.shape {
        Shape::Element => "blockIdx.x * blockDim.x + threadIdx.x",
        Shape::Row => "(blockIdx.x * blockDim.x + threadIdx.x) / LANES",
    };
    let declarations: String = declarations(kernel).map(|d| format!(", {d}")).collect();
    let (name, names) = (kernel.name, names(kernel));
    // With the bound the compiler takes no more registers than a block of so many threads has.
    let _ = writeln!(
        text,
        "extern \"C\" __global__ void __launch_bounds__({BLOCK_THREADS})\n\
         run_{name}(unsigned count{declarations}) {{\n    \
         const unsigned index = {index};\n    \
         if (index < count) of_{name}(index{names});\n}}"
    );
}

/// Writes the function that the host calls, with its arguments behind pointers as the driver of a
/// GPU takes them.
fn host_entry(text: &mut String, kernel: &Kernel) {
    let (name, names) = (kernel.name, names(kernel));
    let _ = writeln!(text, "void run_{name}(void **arguments, unsigned count) {{");
    for (number, (declaration, parameter)) in
        declarations(kernel).zip(kernel.parameters()).enumerate()
    {
        let c_type = parameter.c_type();
        let _ = writeln!(text, "    {declaration} = *({c_type}*)arguments[{number}];");
    }
    let _ = writeln!(
        text,
        "    for (unsigned index = 0; index < count; ++index) of_{name}(index{names});\n}}"
    );
}

#[cfg(test)]
mod tests;
