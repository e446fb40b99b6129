//! Passes of a network over a union of cloths on a GPU: the place where features go up and
//! accelerations come down, and gradients the other way.

use std::ops::Range;
use std::sync::Arc;

use selvedge_model::{ClothSize, Connectivity, Dropout as CpuDropout, ModelSpec, Network, Window};
use selvedge_train::{AdamRates, Learned};

use crate::gpu::{Gpu, GpuError, Memory, Plan, Purpose, Region, Schedule};
use crate::kernels::{Adam, Dropout};
use crate::network::{Both, Frame, Graph, Lowering};

/// A frame on the GPU.
struct FramePass {
    input: Both,
    output: Region,
    /// The seeds of vertices and of arcs.
    seeds: Option<Both>,
    forward: Schedule,
    /// The way back without and with the gradient of the features.
    backward: Option<[Schedule; 2]>,
}

/// What a training has beside its frames.
struct TrainingArrays {
    /// The gradient of the output.
    output: Region,
    /// Those of the features.
    input: Both,
    adam: Adam,
    step: Schedule,
}

/// A network on the cloths of a union.
pub struct Passes {
    memory: Memory,
    weights: Region,
    frames: Vec<FramePass>,
    training: Option<TrainingArrays>,
}

/// Passes that go back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Training {
    /// Frames that go forward before all of them go back.
    pub frames: usize,
    /// Probability of a zero between the layers of a recurrent encoder.
    pub dropout: f64,
}

impl Passes {
    /// Passes over `graph`, for a training or to be used. The weights have to be written before the
    /// first pass, and the moments before the first step; those of `before`, passes of the same
    /// network, go on.
    ///
    /// # Errors
    /// When there is too little memory, or the GPU fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        network: &Network,
        graph: &Connectivity,
        training: Option<Training>,
        before: Option<&Self>,
    ) -> Result<Self, GpuError> {
        let mut plan = Plan::default();
        // First and in this order: other passes of the network find them at the same places.
        let count = network.parameter_count();
        let weights = plan.numbers(count);
        let adam = training.map(|_| Adam {
            weights,
            gradient: plan.numbers(count),
            first: plan.numbers(count),
            second: plan.numbers(count),
            mean: plan.numbers(count),
            rates: plan.numbers(Adam::RATES),
            norm: plan.numbers(2),
            squares: plan.numbers(Adam::pieces(count)),
        });
        let lasting = plan.mark();
        let dropout = training.filter(|training| training.dropout > 0.0);
        let masks = dropout.map(|training| Masks::new(&mut plan, graph.cloths(), training.dropout));
        let arcs = Graph::new(&mut plan, graph);
        let count = training.map_or(1, |training| training.frames);
        let steps = network.spec().window();
        let masks: Vec<Option<[Dropout; 2]>> = (0..count)
            .map(|_| masks.as_ref().map(|masks| masks.frame(&mut plan, steps)))
            .collect();
        let mut lowering = Lowering::new(&mut plan, network, arcs, weights);
        let keeps = training.is_some();
        let frames: Vec<Frame> = masks
            .into_iter()
            .map(|masks| lowering.frame(keeps, masks))
            .collect();
        let gradients = adam.map(|adam| lowering.gradients(adam.gradient));
        let mut take = |lower: &mut dyn FnMut(&mut Lowering<'_>)| {
            lower(&mut lowering);
            std::mem::take(&mut lowering.launches)
        };
        let launches: Vec<_> = frames
            .iter()
            .map(|frame| {
                let forward = take(&mut |lowering| lowering.forward(frame));
                let backward = gradients.as_ref().map(|to| {
                    [false, true].map(|to_input| {
                        take(&mut |lowering| lowering.backward(frame, to, to_input))
                    })
                });
                (forward, backward)
            })
            .collect();
        let purpose = match training {
            Some(_) => Purpose {
                what: "this training",
                remedy: "lower batch.samples, unroll.frames, model.latent, model.blocks or the \
                         window",
            },
            None => Purpose {
                what: "this rollout",
                remedy: "take a coarser mesh or a smaller model",
            },
        };
        let before = before.map(|before| (&before.memory, lasting));
        let memory = Memory::new(gpu, &plan, purpose, before)?;
        let mut passes = Vec::with_capacity(count);
        for (frame, (forward, backward)) in frames.iter().zip(launches) {
            let backward = match backward {
                Some([without, with]) => {
                    Some([memory.schedule(&without)?, memory.schedule(&with)?])
                }
                None => None,
            };
            passes.push(FramePass {
                input: frame.input,
                output: frame.output,
                seeds: frame.dropout.map(|masks| masks.map(|mask| mask.seeds)),
                forward: memory.schedule(&forward)?,
                backward,
            });
        }
        let training = match (gradients, adam) {
            (Some(to), Some(adam)) => Some(TrainingArrays {
                output: to.output,
                input: to.input,
                step: memory.schedule(&adam.launches())?,
                adam,
            }),
            _ => None,
        };
        Ok(Self {
            memory,
            weights,
            frames: passes,
            training,
        })
    }

    /// The number of launches of a forward pass.
    #[cfg(test)]
    pub(crate) fn launches(&self) -> usize {
        self.frames[0].forward.launches()
    }

    /// Writes the weights.
    ///
    /// # Panics
    /// When there are not as many as the network has.
    pub fn set_weights(&self, weights: &[f32]) {
        self.memory.put(self.weights, weights);
    }

    /// The forward pass of frame `frame`: from normalised features to normalised accelerations,
    /// `[vertices, 3]`. `seeds` are those of the cloths' dropout.
    ///
    /// # Errors
    /// When the GPU fails.
    ///
    /// # Panics
    /// When an array does not have the size of the union.
    pub fn forward(
        &mut self,
        frame: usize,
        input: &Window,
        seeds: &[u64],
    ) -> Result<Vec<f32>, GpuError> {
        let pass = &self.frames[frame];
        self.memory.put(pass.input[0], &input.nodes);
        self.memory.put(pass.input[1], &input.arcs);
        for (kind, region) in pass.seeds.iter().flatten().enumerate() {
            let of_rows = seeds.iter().map(|&seed| CpuDropout::row_seeds(seed)[kind]);
            let halves: Vec<u32> = of_rows
                .flat_map(|seed| [seed as u32, (seed >> 32) as u32])
                .collect();
            self.memory.put_indices(*region, &halves);
        }
        self.memory.run_and_get(&[&pass.forward], &[pass.output])
    }

    /// The way back of frame `frame`, whose forward pass was made: adds to the gradient of the
    /// weights. Does not wait.
    ///
    /// # Errors
    /// When the GPU fails.
    ///
    /// # Panics
    /// When these are not passes of a training.
    pub fn backward(&mut self, frame: usize, output: &[f32]) -> Result<(), GpuError> {
        self.memory.put(self.training().output, output);
        let [pass, _] = self.way_back(frame);
        self.memory.run(&[pass])
    }

    /// As [`Self::backward`], waits, and returns the gradient of the features.
    ///
    /// # Errors
    /// As [`Self::backward`].
    ///
    /// # Panics
    /// As [`Self::backward`].
    pub fn backward_to_input(&mut self, frame: usize, output: &[f32]) -> Result<Window, GpuError> {
        let to = self.training();
        self.memory.put(to.output, output);
        let [_, pass] = self.way_back(frame);
        let mut nodes = self.memory.run_and_get(&[pass], &to.input)?;
        let arcs = nodes.split_off(to.input[0].count);
        Ok(Window { nodes, arcs })
    }

    fn training(&self) -> &TrainingArrays {
        self.training.as_ref().expect("passes of a training")
    }

    fn way_back(&self, frame: usize) -> &[Schedule; 2] {
        let pass = self.frames[frame].backward.as_ref();
        pass.expect("passes of a training")
    }

    /// Sets the gradient of the weights to zero.
    ///
    /// # Panics
    /// When these are not passes of a training.
    pub fn clear_gradient(&self) {
        self.memory.clear(self.training().adam.gradient);
    }

    /// A part of the gradient of the weights.
    ///
    /// # Errors
    /// When the GPU fails.
    ///
    /// # Panics
    /// When these are not passes of a training.
    pub fn gradient(&self, range: Range<usize>) -> Result<Vec<f32>, GpuError> {
        let all = self.training().adam.gradient;
        let first = all.first + range.start as u32;
        let count = range.len();
        self.memory.run_and_get(&[], &[Region { first, count }])
    }

    /// Replaces the gradient of the weights.
    ///
    /// # Panics
    /// When these are not passes of a training.
    pub fn set_gradient(&self, gradient: &[f32]) {
        self.memory.put(self.training().adam.gradient, gradient);
    }

    /// Writes weights, their running mean, where there is one, and moments.
    ///
    /// # Panics
    /// When these are not passes of a training.
    pub fn set_learned(&self, learned: &Learned) {
        let adam = self.training().adam;
        let mean = learned.averaged.as_ref().unwrap_or(&learned.weights);
        self.memory.put(adam.weights, &learned.weights);
        self.memory.put(adam.mean, mean);
        self.memory.put(adam.first, learned.adam.first_moment());
        self.memory.put(adam.second, learned.adam.second_moment());
    }

    /// Reads what [`Self::set_learned`] writes.
    ///
    /// # Errors
    /// When the GPU fails.
    ///
    /// # Panics
    /// When these are not passes of a training.
    pub fn collect(&self, learned: &mut Learned) -> Result<(), GpuError> {
        let adam = self.training().adam;
        let get = |region| self.memory.run_and_get(&[], &[region]);
        learned.weights = get(adam.weights)?;
        if let Some(averaged) = &mut learned.averaged {
            *averaged = get(adam.mean)?;
        }
        let moments = learned.adam.moments_mut();
        for (region, moment) in [adam.first, adam.second].into_iter().zip(moments) {
            moment.copy_from_slice(&get(region)?);
        }
        Ok(())
    }

    /// Takes the weights a step against their gradient, and their mean `part` of the way to them.
    /// Returns the norm of the gradient and the factor that clipped it.
    ///
    /// # Errors
    /// When the GPU fails.
    ///
    /// # Panics
    /// When these are not passes of a training.
    pub fn step(&self, limit: f64, rates: AdamRates, part: f32) -> Result<[f32; 2], GpuError> {
        let TrainingArrays { adam, step, .. } = self.training();
        let AdamRates {
            keep1,
            take1,
            keep2,
            take2,
            rate,
            root,
            epsilon,
        } = rates;
        let limit = limit.min(f64::from(f32::MAX)) as f32;
        let rates = [limit, keep1, take1, keep2, take2, rate, root, epsilon, part];
        self.memory.put(adam.rates, &rates);
        let found = self.memory.run_and_get(&[step], &[adam.norm])?;
        Ok([found[0], found[1]])
    }
}

/// What all frames share of their dropout.
struct Masks {
    rate: f64,
    cloths: usize,
    /// The cloth of each row, and its number in that.
    rows: [Both; 2],
}

impl Masks {
    fn new(plan: &mut Plan, cloths: &[ClothSize], rate: f64) -> Self {
        let sizes: [fn(&ClothSize) -> usize; 2] = [|cloth| cloth.vertices, |cloth| cloth.arcs];
        let rows = sizes.map(|size| {
            let (mut of_row, mut number) = (Vec::new(), Vec::new());
            for (cloth, rows) in cloths.iter().map(size).enumerate() {
                of_row.extend(std::iter::repeat_n(cloth as u32, rows));
                number.extend(0..rows as u32);
            }
            [plan.indices(&of_row), plan.indices(&number)]
        });
        let cloths = cloths.len();
        Self { rate, cloths, rows }
    }

    /// The dropout of a frame, with seeds of its own.
    fn frame(&self, plan: &mut Plan, steps: usize) -> [Dropout; 2] {
        self.rows.map(|[cloths, rows]| Dropout {
            rate: self.rate,
            steps,
            cloths,
            rows,
            seeds: plan.indices(&vec![0; 2 * self.cloths]),
        })
    }
}

/// The features of a union from those of its cloths: step after step, cloth after cloth.
pub fn side_by_side(spec: &ModelSpec, cloths: &[&Window]) -> Window {
    let steps = spec.window();
    let union = |of: fn(&Window) -> &[f32]| {
        let mut rows = Vec::with_capacity(cloths.iter().map(|cloth| of(cloth).len()).sum());
        for step in 0..steps {
            for own in cloths.iter().map(|cloth| of(cloth)) {
                let count = own.len() / steps;
                rows.extend_from_slice(&own[step * count..][..count]);
            }
        }
        rows
    };
    Window {
        nodes: union(|cloth| &cloth.nodes),
        arcs: union(|cloth| &cloth.arcs),
    }
}

/// The inverse of [`side_by_side`], for cloths whose features have the sizes of `like`.
pub fn apart(spec: &ModelSpec, union: &Window, like: &[&Window]) -> Vec<Window> {
    let mut cloths = vec![Window::default(); like.len()];
    let (mut nodes, mut arcs) = (&union.nodes[..], &union.arcs[..]);
    for _ in 0..spec.window() {
        for (cloth, like) in cloths.iter_mut().zip(like) {
            let own;
            (own, nodes) = nodes.split_at(like.nodes.len() / spec.window());
            cloth.nodes.extend_from_slice(own);
            let own;
            (own, arcs) = arcs.split_at(like.arcs.len() / spec.window());
            cloth.arcs.extend_from_slice(own);
        }
    }
    cloths
}
