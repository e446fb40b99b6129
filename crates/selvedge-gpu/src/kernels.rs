//! The kernels, in WGSL, and the launches of them: functions that turn places of arrays into
//! parameters and workgroups. Sums run in a fixed order and without atomics.

use crate::gpu::{Launch, Region};

/// The place of an array that is not there.
const NONE: u32 = u32::MAX;

/// A kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Kernel {
    /// A matrix product.
    Product(ProductKind),
    /// Layer normalisation of rows, or of the messages into each vertex.
    Norm { of_messages: bool },
    /// A kernel by its name and the parts of its source after what all have.
    Written(&'static str, &'static [&'static str]),
}

/// A kernel that is written in these files.
macro_rules! written {
    ($name:literal: $($file:literal),+) => {
        Kernel::Written($name, &[$(include_str!(concat!("kernels/", $file, ".wgsl"))),+])
    };
}
/// One that computes its elements one by one.
macro_rules! elementwise {
    ($name:literal) => {
        written!($name: $name, "element")
    };
}

/// The kind of a matrix product.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct ProductKind {
    /// True where `a` lies transposed in memory, `[k, rows]`.
    a_transposed: bool,
    /// True where `b` lies transposed in memory, `[columns, k]`, as the weights of a linear layer.
    b_transposed: bool,
    epilogue: EpilogueKind,
    /// Rows and columns of a thread.
    size: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum EpilogueKind {
    Set,
    Add,
    Bias,
    BiasRelu,
    EndsRelu,
    Mask,
}

impl Kernel {
    /// Its name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Product(_) => "product",
            Self::Norm { .. } => "norm",
            Self::Written(name, _) => name,
        }
    }

    /// Its source.
    pub(crate) fn source(self) -> String {
        let common = include_str!("kernels/common.wgsl");
        match self {
            Self::Product(kind) => [common, &kind.source()].concat(),
            Self::Norm { of_messages } => {
                let (add_up, rows) = if of_messages {
                    (
                        "m[p.incoming + to * p.width + k] += update;",
                        "for (var k = lane; k < p.width; k += 64u) { m[p.incoming + row * p.width + k] = 0.0; }
    let end = index[p.first_arc + row + 1u];
    for (var arc = index[p.first_arc + row]; arc < end; arc++) { normalise(arc, row, lane); }",
                    )
                } else {
                    ("", "normalise(row, row, lane);")
                };
                let source = include_str!("kernels/norm.wgsl");
                let source = source.replace("ADD_UP", add_up).replace("ROWS", rows);
                [common, include_str!("kernels/sums.wgsl"), &source].concat()
            }
            Self::Written(_, parts) => [&[common], parts].concat().concat(),
        }
    }
}

impl ProductKind {
    fn source(self) -> String {
        let size = self.size;
        let numbers = |of: &dyn Fn(usize) -> String, between: &str| {
            (0..size).map(of).collect::<Vec<_>>().join(between)
        };
        let axis = |k: usize| ["x", "y", "z", "w"][k];
        let rows = numbers(&|i| format!("a_at(a_row + {i}u, a_k, end)"), ", ");
        let columns = numbers(&|j| format!("b_at(b_k, b_column + {j}u, end)"), ", ");
        let sum = |i: usize| format!("sum[{i}] = fma(VEC(a.{}), b, sum[{i}]);", axis(i));
        let puts = |i: usize| {
            let put = |j: usize| {
                let value = format!("sum[{i}].{}", axis(j));
                format!("put({value}, row + {i}u, column + {j}u, group.z);")
            };
            numbers(&put, "\n    ")
        };
        // Neighbouring lanes read neighbouring numbers.
        let places = |transposed: bool| {
            if transposed { ["low", "high"] } else { ["high", "low"] }
        };
        let ([a_deep, a_wide], [b_deep, b_wide]) =
            (places(!self.a_transposed), places(self.b_transposed));
        let epilogue = match self.epilogue {
            EpilogueKind::Set => "value",
            EpilogueKind::Add => "m[at] + value",
            EpilogueKind::Bias => "value + m[p.bias + n]",
            EpilogueKind::BiasRelu => "max(value + m[p.bias + n], 0.0)",
            EpilogueKind::EndsRelu => {
                "max(value + m[p.ends + index[p.senders + row] * 2u * p.columns + n] + m[p.ends + \
                 (index[p.receivers + row] * 2u + 1u) * p.columns + n] + m[p.bias + n], 0.0)"
            }
            EpilogueKind::Mask => "select(0.0, value, m[p.mask + row * p.columns + n] > 0.0)",
        };
        let loads = if self.a_transposed { "a_memory(k, row)" } else { "a_memory(row, k)" };
        let b_load =
            if self.b_transposed { "m[first + n * ld + k]" } else { "m[first + k * ld + n]" };
        let source = include_str!("kernels/product.wgsl");
        [
            ("A_LOAD", loads),
            ("B_LOAD", b_load),
            ("A_DEEP", a_deep),
            ("A_WIDE", a_wide),
            ("B_DEEP", b_deep),
            ("B_WIDE", b_wide),
            ("A_ROWS", &rows),
            ("B_COLUMNS", &columns),
            ("SUMS", &numbers(&sum, "\n            ")),
            ("PUTS", &numbers(&puts, "\n    ")),
            ("EPILOGUE", epilogue),
            ("SIZE", &format!("{size}u")),
            ("VEC", &format!("vec{size}<f32>")),
        ]
        .into_iter()
        .fold(source.to_owned(), |source, (word, by)| {
            source.replace(word, by)
        })
    }
}

/// A matrix in memory, row by row: where it begins, and the numbers from one row to the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matrix {
    /// Where it begins.
    pub(crate) first: u32,
    /// Numbers from one row to the next.
    pub(crate) ld: usize,
}

impl Matrix {
    /// An array with rows of `ld` numbers.
    pub(crate) fn new(region: Region, ld: usize) -> Self {
        let first = region.first;
        Self { first, ld }
    }

    /// The same from column `column` on.
    pub(crate) fn columns_from(self, column: usize) -> Self {
        let first = self.first + column as u32;
        Self { first, ..self }
    }
}

/// A matrix whose columns from `split` on lie elsewhere.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pieces {
    first: Matrix,
    split: usize,
    second: Matrix,
}

impl From<Matrix> for Pieces {
    fn from(first: Matrix) -> Self {
        Self {
            first,
            split: u32::MAX as usize,
            second: first,
        }
    }
}

impl Pieces {
    /// `first` with `split` columns, then those of `second`.
    pub(crate) fn new(first: Matrix, split: usize, second: Matrix) -> Self {
        Self {
            first,
            split,
            second,
        }
    }
}

/// The fate of the sums of a product.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Epilogue {
    kind: EpilogueKind,
    /// Bias, mask, products of ends, senders and receivers.
    places: [u32; 5],
}

impl Epilogue {
    /// They are the result.
    pub(crate) const SET: Self = Self {
        kind: EpilogueKind::Set,
        places: [NONE; 5],
    };
    /// They are added to it.
    pub(crate) const ADD: Self = Self {
        kind: EpilogueKind::Add,
        ..Self::SET
    };

    /// Plus a bias.
    pub(crate) fn bias(bias: u32) -> Self {
        Self {
            kind: EpilogueKind::Bias,
            places: [bias, NONE, NONE, NONE, NONE],
        }
    }

    /// Plus a bias, then ReLU.
    pub(crate) fn bias_relu(bias: u32) -> Self {
        Self {
            kind: EpilogueKind::BiasRelu,
            ..Self::bias(bias)
        }
    }

    /// Plus a bias and the products of the ends of an arc, then ReLU: products of each vertex as a
    /// sender and as a receiver, `[vertices, 2 columns]`; the senders; the receivers.
    pub(crate) fn ends_relu(bias: u32, of: [Region; 3]) -> Self {
        let [ends, senders, receivers] = of.map(|region| region.first);
        Self {
            kind: EpilogueKind::EndsRelu,
            places: [bias, NONE, ends, senders, receivers],
        }
    }

    /// Zero where this array, the output of a ReLU, is zero.
    pub(crate) fn mask(kept: Region) -> Self {
        Self {
            kind: EpilogueKind::Mask,
            places: [NONE, kept.first, NONE, NONE, NONE],
        }
    }
}

/// Sizes of a matrix product.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sizes {
    /// Rows of the result.
    pub(crate) rows: usize,
    /// Its columns.
    pub(crate) columns: usize,
    /// Terms of each sum.
    pub(crate) k: usize,
}

/// Parameters of a product, before they are launched.
struct Product {
    sizes: Sizes,
    chunk: usize,
    a: Pieces,
    a_transposed: bool,
    b: Pieces,
    b_transposed: bool,
    ones: u32,
    c: Matrix,
    epilogue: Epilogue,
}

impl Product {
    /// A product in one part, of `a` as it lies.
    fn plain(
        sizes: Sizes,
        a: Pieces,
        (b, b_transposed): (Pieces, bool),
        c: Matrix,
        epilogue: Epilogue,
    ) -> Launch {
        let product = Self {
            sizes,
            chunk: sizes.k,
            a,
            a_transposed: false,
            b,
            b_transposed,
            ones: NONE,
            c,
            epilogue,
        };
        product.launch()
    }

    fn launch(self) -> Launch {
        let Sizes { rows, columns, k } = self.sizes;
        let parts = k.div_ceil(self.chunk.max(1)).max(1);
        // Large tiles where there are enough of them to fill a card.
        let tiles = |size: usize| [columns, rows].map(|n| n.div_ceil(16 * size));
        let [x, y] = tiles(4);
        let size = if x * y * parts >= 256 { 4 } else { 2 };
        let [x, y] = tiles(size);
        let pieces = |of: Pieces| {
            let [first, second] = [of.first, of.second].map(|at| [at.first, at.ld as u32]);
            [&first[..], &[of.split as u32], &second].concat()
        };
        let mut parameters = vec![rows as u32, columns as u32, k as u32, self.chunk as u32];
        parameters.extend(pieces(self.a));
        parameters.extend(pieces(self.b));
        parameters.extend([self.ones, self.c.first, self.c.ld as u32]);
        parameters.push((rows * columns) as u32);
        parameters.extend(self.epilogue.places);
        Launch {
            kernel: Kernel::Product(ProductKind {
                a_transposed: self.a_transposed,
                b_transposed: self.b_transposed,
                epilogue: self.epilogue.kind,
                size,
            }),
            parameters,
            groups: [x, y, parts].map(|n| n as u32),
        }
    }
}

/// A linear layer: rows of `x` times the transpose of `weight`, `[columns, k]`. The rows of the
/// weight may be in two pieces.
pub(crate) fn linear(
    sizes: Sizes,
    x: Pieces,
    weight: Pieces,
    out: Matrix,
    epilogue: Epilogue,
) -> Launch {
    Product::plain(sizes, x, (weight, true), out, epilogue)
}

/// The gradient of a linear layer's input: rows of `gradient` times `weight`, `[k, columns]`.
pub(crate) fn linear_to_input(
    sizes: Sizes,
    gradient: Pieces,
    weight: Matrix,
    out: Matrix,
    epilogue: Epilogue,
) -> Launch {
    Product::plain(sizes, gradient, (weight.into(), false), out, epilogue)
}

/// Rows of a chunk in a sum over `rows` rows: at most 64 chunks.
fn chunk_of(rows: usize) -> usize {
    rows.div_ceil(64).max(256).next_multiple_of(16)
}

/// Room for the parts of the gradient of a linear layer, and of a layer normalisation, which takes
/// less.
pub(crate) fn part_numbers(rows: usize, inputs: usize, outputs: usize) -> usize {
    rows.div_ceil(chunk_of(rows)) * outputs * (inputs + 1)
}

/// The gradient of a linear layer's weight `[outputs, inputs]`, and of its bias, added to `weight`
/// and `bias`, from the gradient of its output and its input.
pub(crate) struct ToWeights {
    /// Rows of the batch.
    pub(crate) rows: usize,
    /// Columns of the input.
    pub(crate) inputs: usize,
    /// Columns of the output.
    pub(crate) outputs: usize,
    /// Its gradient.
    pub(crate) gradient: Pieces,
    /// The input.
    pub(crate) x: Pieces,
    /// The gradient of the weight.
    pub(crate) weight: Matrix,
    /// That of the bias, where it is not added by another product.
    pub(crate) bias: Option<u32>,
    /// Room for parts.
    pub(crate) parts: Region,
}

impl ToWeights {
    /// The launches.
    pub(crate) fn launches(self) -> [Launch; 2] {
        let columns = self.inputs + usize::from(self.bias.is_some());
        let ones = self.bias.map_or(NONE, |_| self.inputs as u32);
        let chunk = chunk_of(self.rows);
        let product = Product {
            sizes: Sizes {
                rows: self.outputs,
                columns,
                k: self.rows,
            },
            chunk,
            a: self.gradient,
            a_transposed: true,
            b: self.x,
            b_transposed: false,
            ones,
            c: Matrix::new(self.parts, columns),
            epilogue: Epilogue::SET,
        };
        let add = AddParts {
            count: self.outputs * columns,
            columns,
            ones,
            parts: self.rows.div_ceil(chunk),
            from: self.parts,
            to: self.weight,
            bias: self.bias.unwrap_or(NONE),
        };
        [product.launch(), add.launch()]
    }
}

struct AddParts {
    count: usize,
    columns: usize,
    ones: u32,
    parts: usize,
    from: Region,
    to: Matrix,
    bias: u32,
}

impl AddParts {
    fn launch(self) -> Launch {
        let parameters = vec![
            self.columns as u32,
            self.ones,
            self.parts as u32,
            self.from.first,
            self.to.first,
            self.to.ld as u32,
            self.bias,
        ];
        elements(elementwise!("add_parts"), self.count, parameters)
    }
}

/// One step of a layer of gated recurrent units.
pub(crate) struct Gates {
    /// Rows.
    pub(crate) rows: usize,
    /// Columns of a state.
    pub(crate) hidden: usize,
    /// The input.
    pub(crate) input: Matrix,
    /// The state before, zero where it is not given.
    pub(crate) before: Option<Region>,
    /// Room for the state after.
    pub(crate) after: Region,
    /// Room for r, z, n and the recurrent part of n.
    pub(crate) kept: Option<Region>,
    /// `weight_ih`, `weight_hh`, `bias_ih`, `bias_hh`.
    pub(crate) weights: [u32; 4],
}

impl Gates {
    /// The launch.
    pub(crate) fn launch(self) -> Launch {
        let place = |region: Option<Region>| region.map_or(NONE, |region| region.first);
        let mut parameters = vec![self.rows as u32, self.hidden as u32, self.input.ld as u32];
        parameters.extend([self.input.first, place(self.before)]);
        parameters.extend([self.after.first, place(self.kept)]);
        parameters.extend(self.weights);
        let tiles = [self.hidden, self.rows].map(|n| n.div_ceil(32) as u32);
        Launch {
            kernel: written!("gates": "gates"),
            parameters,
            groups: [tiles[0], tiles[1], 1],
        }
    }
}

/// Workgroups for `count` rows, one each.
fn each(count: usize) -> [u32; 3] {
    let x = count.clamp(1, 32768);
    [x as u32, count.div_ceil(x).max(1) as u32, 1]
}

fn elements(kernel: Kernel, count: usize, others: Vec<u32>) -> Launch {
    let mut parameters = vec![count as u32];
    parameters.extend(others);
    Launch {
        kernel,
        parameters,
        groups: each(count.div_ceil(64)),
    }
}

/// A layer normalisation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Norm {
    /// Rows.
    pub(crate) rows: usize,
    /// Columns.
    pub(crate) width: usize,
    /// The rows; normalised in place, before weight and shift.
    pub(crate) x: Region,
    /// Room for one over the deviation.
    pub(crate) inverse: Region,
    /// The weights, after which the shifts lie.
    pub(crate) weight: u32,
}

/// The sums of messages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Messages {
    /// Vertices.
    pub(crate) vertices: usize,
    /// The first arc into each.
    pub(crate) first_arc: Region,
    /// Room for the sums.
    pub(crate) incoming: Region,
}

impl Norm {
    /// The normalised rows, added to `before` where that is given, go to `after`; as messages, they
    /// are also added up for each vertex.
    pub(crate) fn launch(
        self,
        before: Option<Region>,
        after: Region,
        sums: Option<Messages>,
    ) -> Launch {
        let rows = sums.map_or(self.rows, |sums| sums.vertices);
        let (first_arc, incoming) = sums.map_or((NONE, NONE), |sums| {
            (sums.first_arc.first, sums.incoming.first)
        });
        Launch {
            kernel: Kernel::Norm {
                of_messages: sums.is_some(),
            },
            parameters: vec![
                rows as u32,
                self.width as u32,
                self.x.first,
                self.inverse.first,
                self.weight,
                self.weight + self.width as u32,
                before.map_or(NONE, |before| before.first),
                after.first,
                first_arc,
                incoming,
            ],
            groups: each(rows),
        }
    }

    /// From the gradient of the result to that of the rows, `out`, and of weight and shift, which
    /// are added at `to_weight`.
    pub(crate) fn backward(
        self,
        gradient: Region,
        out: Region,
        to_weight: u32,
        parts: Region,
    ) -> [Launch; 3] {
        let [rows, width] = [self.rows, self.width];
        let sums = vec![self.inverse.first, self.weight, out.first];
        let mut parameters = vec![rows as u32, width as u32, gradient.first, self.x.first];
        parameters.extend(sums);
        let back = Launch {
            kernel: written!("norm backward": "sums", "norm_backward"),
            parameters,
            groups: each(rows),
        };
        let chunk = chunk_of(rows);
        let count = rows.div_ceil(chunk);
        let parameters = vec![
            rows as u32,
            width as u32,
            chunk as u32,
            gradient.first,
            self.x.first,
            parts.first,
        ];
        let sums = elements(elementwise!("norm_sums"), count * width, parameters);
        let add = AddParts {
            count: 2 * width,
            columns: 2 * width,
            ones: NONE,
            parts: count,
            from: parts,
            to: Matrix {
                first: to_weight,
                ld: 0,
            },
            bias: NONE,
        };
        [back, sums, add.launch()]
    }
}

/// Gradients of messages, `[arcs, width]`, from those of arcs and of the sums of vertices.
pub(crate) fn messages_backward(
    arcs: Region,
    width: usize,
    incoming: Region,
    receivers: Region,
    out: Region,
) -> Launch {
    let places = [arcs, incoming, receivers, out].map(|region| region.first);
    let mut parameters = vec![width as u32];
    parameters.extend(places);
    elements(elementwise!("messages"), arcs.count, parameters)
}

/// Gradients of the products of vertices, `[vertices, 2 width]`, from those of arcs.
pub(crate) fn sum_ends(
    arcs: Region,
    width: usize,
    first_arc: Region,
    reverse_arcs: Region,
    out: Region,
) -> Launch {
    let places = [arcs, first_arc, reverse_arcs, out].map(|region| region.first);
    let mut parameters = vec![width as u32];
    parameters.extend(places);
    elements(elementwise!("sum_ends"), out.count / 2, parameters)
}

/// One step of gated recurrent units backward.
pub(crate) fn gates_backward(
    width: usize,
    kept: Region,
    before: Option<Region>,
    state: Region,
    out: Region,
) -> Launch {
    let before = before.map_or(NONE, |before| before.first);
    let parameters = vec![width as u32, kept.first, before, state.first, out.first];
    elements(elementwise!("gates_backward"), state.count, parameters)
}

/// The fate of what was there before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Onto {
    /// It is replaced.
    Set,
    /// It is added to.
    Add,
}

/// Dropout of rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dropout {
    /// Probability of a zero.
    pub(crate) rate: f64,
    /// Frames of the window.
    pub(crate) steps: usize,
    /// The cloth of each row.
    pub(crate) cloths: Region,
    /// The number of each row in its cloth.
    pub(crate) rows: Region,
    /// The seed of each cloth, lower half first.
    pub(crate) seeds: Region,
}

impl Dropout {
    /// The launch for step `step`.
    pub(crate) fn launch(
        self,
        width: usize,
        step: usize,
        from: Region,
        to: Region,
        onto: Onto,
    ) -> Launch {
        // As selvedge_model rounds them.
        let scale = (1.0 / (1.0 - self.rate)) as f32;
        let threshold = (self.rate * (1_u64 << 32) as f64) as u32;
        let mut parameters = vec![width as u32, self.steps as u32, step as u32];
        parameters.extend([threshold, scale.to_bits(), from.first, to.first]);
        let places = [self.cloths, self.rows, self.seeds];
        parameters.extend(places.map(|region| region.first));
        parameters.push(u32::from(onto == Onto::Add));
        elements(elementwise!("dropout"), from.count, parameters)
    }
}

/// The optimiser's arrays, each of the weights' size but for the last three.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Adam {
    /// The weights.
    pub(crate) weights: Region,
    /// Their gradient.
    pub(crate) gradient: Region,
    /// First moments.
    pub(crate) first: Region,
    /// Second moments.
    pub(crate) second: Region,
    /// The running mean of the weights.
    pub(crate) mean: Region,
    /// The limit of the norm, the rates and the part of the mean, [`Adam::RATES`] numbers.
    pub(crate) rates: Region,
    /// Room for the norm of the gradient and its clipping factor.
    pub(crate) norm: Region,
    /// Room for sums of squares, [`Adam::pieces`] numbers.
    pub(crate) squares: Region,
}

impl Adam {
    /// Numbers of the rates.
    pub(crate) const RATES: usize = 9;

    /// The sums of squares of so many weights.
    pub(crate) fn pieces(weights: usize) -> usize {
        weights.div_ceil(4096)
    }

    /// A step.
    pub(crate) fn launches(self) -> [Launch; 3] {
        let (count, pieces) = (self.weights.count, Self::pieces(self.weights.count));
        let [gradient, squares, rates, norm] =
            [self.gradient, self.squares, self.rates, self.norm].map(|region| region.first);
        let of_pieces = Launch {
            kernel: written!("squares": "sums", "squares"),
            parameters: vec![pieces as u32, count as u32, gradient, squares],
            groups: each(pieces),
        };
        let length = Launch {
            kernel: written!("length": "sums", "length"),
            parameters: vec![pieces as u32, squares, rates, norm],
            groups: [1; 3],
        };
        let places = [
            self.weights,
            self.gradient,
            self.first,
            self.second,
            self.mean,
        ];
        let mut parameters = places.map(|region| region.first).to_vec();
        parameters.extend([rates, norm]);
        [
            of_pieces,
            length,
            elements(elementwise!("adam"), count, parameters),
        ]
    }
}
