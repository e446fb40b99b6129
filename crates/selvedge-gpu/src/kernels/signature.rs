//! Signatures of kernels, read from the C source while this crate is compiled. A signature that
//! cannot be read does not compile.
//!
//! A signature is a macro of `common.h`:
//!
//! ```c
//! KERNEL(norm, ROW, RING, const float *x EACH(LATENT), MAYBE OUT float *inverse EACH(1)) { … }
//! ```
//!
//! The second word is the kernel's [`Shape`]. A name in capitals alone (`RING`) is a list of
//! parameters that `common.h` defines. `const` arrays are read, arrays marked `OUT` are written as
//! a whole, other arrays are read and written. `MAYBE` allows a null pointer. `EACH(width)` is the
//! number of elements per element, row or block of a launch, `ALL(width)` the number of elements of
//! the whole array. A width is a product of a number, sizes of the network and counts of the
//! launch. The size of an array without either depends on what lies in other arrays.

use super::kernel::{Access, Extent, Factor, Kernel, Kind, MOST, Parameter, Shape, Width};
use crate::schedule::plan::Element;

impl Kernel {
    /// Reads the signature of the kernel `name` from a file of kernels.
    ///
    /// # Panics
    /// If the file has no such kernel, or its signature cannot be read. Kernels are statics, so
    /// that this is an error of the compiler.
    #[must_use]
    pub const fn of(file: &'static str, name: &'static str) -> Self {
        let mut scanner = Scanner::after_kernel(file, name);
        scanner.expect(b",");
        let shape = match scanner.token().as_bytes() {
            b"ELEMENT" => Shape::Element,
            b"ROW" => Shape::Row,
            _ => panic!("a shape: ELEMENT or ROW"),
        };
        let nothing = Parameter {
            name: "",
            kind: Kind::Count,
        };
        let kernel = Self {
            name,
            shape,
            parameters: [nothing; MOST],
            count: 0,
        };
        scanner.expect(b",");
        kernel.with_list(scanner)
    }

    /// Adds parameters up to the end of a list.
    const fn with_list(mut self, mut scanner: Scanner) -> Self {
        loop {
            let first = scanner.token();
            if let Some(list) = Scanner::after_list(first) {
                self = self.with_list(list);
            } else {
                self.parameters[self.count] = scanner.parameter(first);
                self.count += 1;
            }
            match scanner.token().as_bytes() {
                b"," => {}
                b")" | b"" => return self,
                _ => panic!("a comma or the end after a parameter"),
            }
        }
    }
}

/// The lists of parameters that several kernels begin with, one `#define` of one line each.
const LISTS: &str = include_str!("common.h");

/// A place in a C source.
struct Scanner {
    text: &'static str,
    at: usize,
}

impl Scanner {
    /// Behind the name of a kernel in its signature.
    const fn after_kernel(file: &'static str, name: &'static str) -> Self {
        let Some(at) = find(file, &[b"\nKERNEL(", name.as_bytes(), b","]) else {
            panic!("no kernel of this name");
        };
        Self {
            text: file,
            at: at - 1,
        }
    }

    /// At the beginning of a list of parameters that has a name; the list ends with its line.
    const fn after_list(name: &'static str) -> Option<Self> {
        if !name.as_bytes()[0].is_ascii_uppercase() || same(name, "MAYBE") || same(name, "OUT") {
            return None;
        }
        let Some(at) = find(LISTS, &[b"\n#define ", name.as_bytes(), b" "]) else {
            panic!("no list of parameters of this name");
        };
        let (_, rest) = LISTS.split_at(at);
        let mut end = 0;
        while rest.as_bytes()[end] != b'\n' {
            end += 1;
        }
        let (text, _) = rest.split_at(end);
        Some(Self { text, at: 0 })
    }

    /// The next word or sign; nothing at the end.
    const fn token(&mut self) -> &'static str {
        let bytes = self.text.as_bytes();
        while self.at < bytes.len() && bytes[self.at].is_ascii_whitespace() {
            self.at += 1;
        }
        let first = self.at;
        while self.at < bytes.len() && is_word(bytes[self.at]) {
            self.at += 1;
        }
        if first == self.at && self.at < bytes.len() {
            self.at += 1;
        }
        self.between(first)
    }

    /// The text from `first` to here.
    const fn between(&self, first: usize) -> &'static str {
        let (text, _) = self.text.split_at(self.at);
        text.split_at(first).1
    }

    const fn expect(&mut self, sign: &[u8]) {
        let found = self.token().as_bytes();
        assert!(found.len() == 1 && found[0] == sign[0], "another sign");
    }

    /// The parameter that begins with the word `first`.
    const fn parameter(&mut self, first: &'static str) -> Parameter {
        let mut word = first;
        let (mut optional, mut out, mut constant) = (false, false, false);
        loop {
            match word.as_bytes() {
                b"MAYBE" => optional = true,
                b"OUT" => out = true,
                b"const" => constant = true,
                _ => break,
            }
            word = self.token();
        }
        let element = match word.as_bytes() {
            b"float" => Element::Float,
            b"unsigned" => Element::Index,
            b"double" => Element::Double,
            _ => panic!("a type: float, unsigned or double"),
        };
        let name = self.token();
        if !same(name, "*") {
            assert!(!(optional || out || constant), "marks of an array alone");
            let kind = match element {
                Element::Float => Kind::Number,
                Element::Index => Kind::Count,
                Element::Double => panic!("a number: float or unsigned"),
            };
            return Parameter { name, kind };
        }
        let access = match (constant, out) {
            (true, false) => Access::Read,
            (false, true) => Access::Write,
            (false, false) => Access::Update,
            (true, true) => panic!("a constant array is not written"),
        };
        let name = self.token();
        let extent = self.extent();
        Parameter {
            name,
            kind: Kind::Array {
                element,
                access,
                extent,
                optional,
            },
        }
    }

    /// The mark of size behind a name, if there is one.
    const fn extent(&mut self) -> Extent {
        let before = self.at;
        let word = self.token();
        let each = same(word, "EACH");
        if !each && !same(word, "ALL") {
            self.at = before;
            return Extent::Any;
        }
        self.expect(b"(");
        let width = self.width();
        if each {
            Extent::PerCount(width)
        } else {
            Extent::Fixed(width)
        }
    }

    /// A product of a number and names, up to the closing parenthesis.
    const fn width(&mut self) -> Width {
        let mut width = Width {
            number: 1,
            factors: [Factor::One; 2],
        };
        let mut names = 0;
        loop {
            let word = self.token();
            if let Some(number) = number(word) {
                width.number *= number;
            } else {
                width.factors[names] = Factor::named(word);
                names += 1;
            }
            match self.token().as_bytes() {
                b"*" => {}
                b")" => return width,
                _ => panic!("a product of a number and at most two names"),
            }
        }
    }
}

impl Factor {
    const fn named(word: &'static str) -> Self {
        match word.as_bytes() {
            b"LATENT" => Self::Latent,
            b"NODE_WIDTH" => Self::NodeColumns,
            b"EDGE_WIDTH" => Self::EdgeColumns,
            [first, ..] if first.is_ascii_lowercase() => Self::Count(word),
            _ => panic!("a width: LATENT, NODE_WIDTH, EDGE_WIDTH or a count"),
        }
    }
}

/// Behind the first place where all of some parts follow each other.
const fn find(text: &str, parts: &[&[u8]]) -> Option<usize> {
    let mut first = 0;
    while first < text.len() {
        if let Some(end) = behind(text.as_bytes(), first, parts) {
            return Some(end);
        }
        first += 1;
    }
    None
}

/// Behind all of some parts, if they are at `first`.
const fn behind(bytes: &[u8], first: usize, parts: &[&[u8]]) -> Option<usize> {
    let (mut at, mut part) = (first, 0);
    while part < parts.len() {
        let mut k = 0;
        while k < parts[part].len() {
            if at >= bytes.len() || bytes[at] != parts[part][k] {
                return None;
            }
            at += 1;
            k += 1;
        }
        part += 1;
    }
    Some(at)
}

const fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && behind(a.as_bytes(), 0, &[b.as_bytes()]).is_some()
}

const fn number(word: &str) -> Option<usize> {
    let bytes = word.as_bytes();
    let (mut value, mut k) = (0, 0);
    while k < bytes.len() {
        if !bytes[k].is_ascii_digit() {
            return None;
        }
        value = 10 * value + (bytes[k] - b'0') as usize;
        k += 1;
    }
    if bytes.is_empty() { None } else { Some(value) }
}

const fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::Sizes;

    const FILE: &str = "// A comment on KERNEL(first, ELEMENT, float *x).\n\
        KERNEL(first_of_all, ELEMENT, unsigned count) {}\n\
        KERNEL(first, ROW,\n\
        \x20      RING, const float *x EACH(3 * LATENT), MAYBE OUT double *y EACH(1),\n\
        \x20      unsigned *z ALL(2 * slots * NODE_WIDTH), const unsigned *any, float scale) {}\n";
    static FIRST: Kernel = Kernel::of(FILE, "first");

    #[test]
    fn a_signature_is_read_with_the_list_that_it_begins_with() {
        assert_eq!((FIRST.name, FIRST.shape), ("first", Shape::Row));
        let names: Vec<&str> = FIRST.parameters().iter().map(|p| p.name).collect();
        assert_eq!(names[..4], ["positions", "newest", "slots", "vertices"]);
        assert_eq!(names[4..], ["x", "y", "z", "any", "scale"]);
        let array = |element, access, extent, optional| Kind::Array {
            element,
            access,
            extent,
            optional,
        };
        let width = |number, factors| Width { number, factors };
        let expected = [
            array(
                Element::Float,
                Access::Read,
                Extent::PerCount(width(3, [Factor::Latent, Factor::One])),
                false,
            ),
            array(
                Element::Double,
                Access::Write,
                Extent::PerCount(width(1, [Factor::One; 2])),
                true,
            ),
            array(
                Element::Index,
                Access::Update,
                Extent::Fixed(width(2, [Factor::Count("slots"), Factor::NodeColumns])),
                false,
            ),
            array(Element::Index, Access::Read, Extent::Any, false),
            Kind::Number,
        ];
        let found: Vec<Kind> = FIRST.parameters()[4..].iter().map(|p| p.kind).collect();
        assert_eq!(found, expected);
        let types = FIRST.parameters()[4..].iter().map(Parameter::c_type);
        let types: Vec<&str> = types.collect();
        let expected = [
            "const float *",
            "double *",
            "unsigned *",
            "const unsigned *",
            "float ",
        ];
        assert_eq!(types, expected);
        let sizes = Sizes {
            latent: 16,
            node_width: 5,
            edge_width: 4,
        };
        let slots = |count| move |name: &str| (name == "slots").then_some(count);
        let wide = width(2, [Factor::Count("slots"), Factor::NodeColumns]);
        assert_eq!(wide.of(sizes, slots(3)), Some(30));
        assert_eq!(wide.of(sizes, |_| None), None);
    }

    #[test]
    fn a_kernel_that_is_not_there_and_a_type_that_is_none_are_found() {
        for (file, name) in [
            (FILE, "second"),
            ("\nKERNEL(x, ROW, long *y) {}", "x"),
            ("\nKERNEL(x, LINE, float *y) {}", "x"),
            ("\nKERNEL(x, ROW, const OUT float *y) {}", "x"),
            ("\nKERNEL(x, ROW, float *y EACH(WIDTH)) {}", "x"),
            ("\nKERNEL(x, ROW, float *y; float *z) {}", "x"),
        ] {
            let read = std::panic::catch_unwind(|| Kernel::of(file, name));
            assert!(read.is_err(), "{file}");
        }
    }
}
