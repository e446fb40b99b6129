//! GPUs, and the memory and the launches of a session on one.
//!
//! All numbers of a session lie in one buffer and all indices in another. A [`Plan`] places arrays
//! in them before anything is allocated; a `Launch` is a kernel with its parameters, among them
//! the places of its arrays. A [`Schedule`] is a list of launches with the parameters of all of
//! them in a third buffer, written once.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use pollster::block_on;
use thiserror::Error;
use wgpu::util::DeviceExt;

use crate::kernels::Kernel;

/// Bytes between the parameters of two launches: the alignment that every device accepts.
const APART: usize = 256;

/// A failure of a GPU.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum GpuError {
    #[error(
        "no GPU was found: install its driver with Vulkan (on Linux and Windows; Windows has \
         Direct3D 12 as well, macOS has Metal), or take the device cpu"
    )]
    None,
    #[error("there is no GPU number {number}: {count} are there, counted from 0")]
    Number { number: usize, count: usize },
    #[error("{what} needs {needed} of memory in one piece, the GPU gives {most}: {remedy}")]
    Memory {
        what: &'static str,
        needed: String,
        most: String,
        remedy: &'static str,
    },
    #[error("the GPU was lost: {0}")]
    Lost(String),
    #[error("the GPU failed: {0}")]
    Failed(String),
}

/// A GPU that was opened.
pub struct Gpu {
    name: String,
    device: wgpu::Device,
    queue: wgpu::Queue,
    groups: wgpu::BindGroupLayout,
    layout: wgpu::PipelineLayout,
    pipelines: Mutex<HashMap<Kernel, wgpu::ComputePipeline>>,
    failure: Arc<Mutex<Option<GpuError>>>,
}

/// The adapters of this machine, fastest kind first, each once: those of one programming interface.
/// Drivers that calculate on the processor are among them only where there is nothing else.
fn adapters() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let mut all = block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    all.sort_by_key(rank);
    if let Some(best) = all.first().map(wgpu::Adapter::get_info) {
        let is_card = best.device_type != wgpu::DeviceType::Cpu;
        all.retain(|adapter| {
            let info = adapter.get_info();
            let fits = !is_card || info.device_type != wgpu::DeviceType::Cpu;
            fits && info.backend == best.backend
        });
    }
    all
}

impl Gpu {
    /// The number of GPUs.
    pub fn count() -> usize {
        adapters().len()
    }

    /// Opens GPU `number`, from 0: dedicated cards first; a driver that calculates on the processor
    /// only where there is no card.
    ///
    /// # Errors
    /// When there is none of this number, or it cannot be opened.
    pub fn open(number: usize) -> Result<Arc<Self>, GpuError> {
        let adapters = adapters();
        let count = adapters.len();
        let adapter = match adapters.into_iter().nth(number) {
            Some(adapter) => adapter,
            None if count == 0 => return Err(GpuError::None),
            None => return Err(GpuError::Number { number, count }),
        };
        let (info, most) = (adapter.get_info(), adapter.limits());
        let wanted = wgpu::DeviceDescriptor {
            label: Some("selvedge"),
            required_limits: wgpu::Limits {
                max_buffer_size: most.max_buffer_size,
                max_storage_buffer_binding_size: most.max_storage_buffer_binding_size,
                ..wgpu::Limits::default()
            },
            ..Default::default()
        };
        let opened = block_on(adapter.request_device(&wanted));
        let (device, queue) = opened.map_err(|error| GpuError::Failed(error.to_string()))?;
        let failure = Arc::new(Mutex::new(None));
        let heard = Arc::clone(&failure);
        device.set_device_lost_callback(move |_, reason| {
            report(&heard, GpuError::Lost(reason));
        });
        let heard = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            report(&heard, GpuError::Failed(error.to_string()));
        }));
        let groups = layout_of(&device);
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&groups)],
            ..Default::default()
        });
        Ok(Arc::new(Self {
            name: format!("{} ({})", info.name, info.backend),
            device,
            queue,
            groups,
            layout,
            pipelines: Mutex::default(),
            failure,
        }))
    }

    /// Its name, and the programming interface that it is reached by.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The error that was reported, if any.
    fn check(&self) -> Result<(), GpuError> {
        let failure = self.failure.lock();
        let failure = failure.unwrap_or_else(PoisonError::into_inner);
        failure.clone().map_or(Ok(()), Err)
    }

    fn pipeline(&self, kernel: Kernel) -> wgpu::ComputePipeline {
        let pipelines = self.pipelines.lock();
        let mut pipelines = pipelines.unwrap_or_else(PoisonError::into_inner);
        let made = pipelines.entry(kernel).or_insert_with(|| {
            let source = wgpu::ShaderSource::Wgsl(kernel.source().into());
            let label = Some(kernel.name());
            let module = wgpu::ShaderModuleDescriptor { label, source };
            let module = self.device.create_shader_module(module);
            let descriptor = wgpu::ComputePipelineDescriptor {
                label,
                layout: Some(&self.layout),
                module: &module,
                entry_point: None,
                compilation_options: wgpu::PipelineCompilationOptions {
                    zero_initialize_workgroup_memory: false,
                    ..Default::default()
                },
                cache: None,
            };
            self.device.create_compute_pipeline(&descriptor)
        });
        made.clone()
    }

    fn buffer(&self, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.max(16),
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }
}

/// Keeps the first failure: those after it follow from it.
fn report(failure: &Mutex<Option<GpuError>>, error: GpuError) {
    let mut failure = failure.lock().unwrap_or_else(PoisonError::into_inner);
    failure.get_or_insert(error);
}

fn layout_of(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, ty, has_dynamic_offset| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset,
            min_binding_size: None,
        },
        count: None,
    };
    let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[
            entry(0, storage(false), false),
            entry(1, storage(true), false),
            entry(2, wgpu::BufferBindingType::Uniform, true),
        ],
    })
}

/// A place in the numbers or in the indices of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// The place of its first element.
    pub first: u32,
    /// Its elements.
    pub count: usize,
}

impl Region {
    /// Part `number` of `parts` of one size.
    pub fn part(self, number: usize, parts: usize) -> Self {
        let count = self.count / parts;
        Self {
            first: self.first + (number * count) as u32,
            count,
        }
    }
}

/// Places of arrays in the memory of a session.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Numbers that are in use.
    used: usize,
    /// The most that were in use at a time.
    most: usize,
    /// The indices themselves: they are known when the plan is made.
    indices: Vec<u32>,
}

impl Plan {
    /// Room for `count` numbers.
    pub fn numbers(&mut self, count: usize) -> Region {
        let first = self.used as u32;
        self.used += count.next_multiple_of(4);
        self.most = self.most.max(self.used);
        Region { first, count }
    }

    /// Indices with these values.
    pub fn indices(&mut self, values: &[u32]) -> Region {
        let first = self.indices.len() as u32;
        self.indices.extend_from_slice(values);
        let count = values.len();
        Region { first, count }
    }

    /// A mark to release what is placed after it.
    pub fn mark(&self) -> usize {
        self.used
    }

    /// Makes the room that was taken since `mark` free for others.
    pub fn release(&mut self, mark: usize) {
        self.used = mark;
    }

    /// Bytes of the numbers.
    pub fn bytes(&self) -> u64 {
        4 * self.most as u64
    }
}

/// A kernel at work on certain arrays.
#[derive(Clone, Debug)]
pub(crate) struct Launch {
    /// The kernel.
    pub(crate) kernel: Kernel,
    /// Its parameters, in the order of its struct `P`.
    pub(crate) parameters: Vec<u32>,
    /// Its workgroups.
    pub(crate) groups: [u32; 3],
}

/// Launches that run one after the other.
pub struct Schedule {
    launches: Vec<(wgpu::ComputePipeline, [u32; 3])>,
    group: wgpu::BindGroup,
}

impl Schedule {
    /// The number of launches.
    #[cfg(test)]
    pub(crate) fn launches(&self) -> usize {
        self.launches.len()
    }
}

/// The memory of a session on a GPU.
pub struct Memory {
    gpu: Arc<Gpu>,
    numbers: wgpu::Buffer,
    indices: wgpu::Buffer,
}

/// Advice for a user to whom memory was refused.
#[derive(Clone, Copy, Debug)]
pub struct Purpose {
    /// What needs the memory.
    pub what: &'static str,
    /// How it would need less.
    pub remedy: &'static str,
}

impl Memory {
    /// Memory for a plan; so many of the first numbers of `before` are its own too.
    ///
    /// # Errors
    /// When there is too little.
    pub fn new(
        gpu: &Arc<Gpu>,
        plan: &Plan,
        purpose: Purpose,
        before: Option<(&Self, usize)>,
    ) -> Result<Self, GpuError> {
        gpu.check()?;
        let limits = gpu.device.limits();
        let most = limits.max_storage_buffer_binding_size;
        let most = most.min(limits.max_buffer_size);
        let refused = |most: String| GpuError::Memory {
            what: purpose.what,
            needed: in_bytes(plan.bytes()),
            most,
            remedy: purpose.remedy,
        };
        if plan.bytes() > most || plan.most > u32::MAX as usize {
            return Err(refused(in_bytes(most)));
        }
        use wgpu::BufferUsages as Usage;
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let indices = gpu.buffer(4 * plan.indices.len() as u64, Usage::STORAGE);
        let fits = |before: &&(&Self, usize)| before.0.numbers.size() >= plan.bytes();
        let numbers = match before.as_ref().filter(fits) {
            Some((before, _)) => before.numbers.clone(),
            None => gpu.buffer(plan.bytes(), Usage::STORAGE | Usage::COPY_SRC),
        };
        if block_on(scope.pop()).is_some() {
            return Err(refused("less".to_owned()));
        }
        let gpu = Arc::clone(gpu);
        let queue = &gpu.queue;
        queue.write_buffer(&indices, 0, bytemuck::cast_slice(&plan.indices));
        if let Some((before, count)) = before
            && before.numbers != numbers
        {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let bytes = 4 * count as u64;
            encoder.copy_buffer_to_buffer(&before.numbers, 0, &numbers, 0, bytes);
            queue.submit([encoder.finish()]);
        }
        Ok(Self {
            gpu,
            numbers,
            indices,
        })
    }

    /// Prepares launches to run together, any number of times.
    ///
    /// # Errors
    /// When a kernel does not compile.
    pub(crate) fn schedule(&self, launches: &[Launch]) -> Result<Schedule, GpuError> {
        let mut parameters = vec![0_u32; launches.len().max(1) * APART / 4];
        for (slot, launch) in parameters.chunks_exact_mut(APART / 4).zip(launches) {
            slot[..launch.parameters.len()].copy_from_slice(&launch.parameters);
        }
        let device = &self.gpu.device;
        let parameters = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents: bytemuck::cast_slice(&parameters),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.gpu.groups,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: self.numbers.as_entire_binding(),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: self.indices.as_entire_binding(),
                },
                wgpu::BindGroupEntry {
                    binding: 2,
                    resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                        buffer: &parameters,
                        offset: 0,
                        size: std::num::NonZero::new(APART as u64),
                    }),
                },
            ],
        });
        let prepared = |launch: &Launch| (self.gpu.pipeline(launch.kernel), launch.groups);
        let launches = launches.iter().map(prepared).collect();
        self.gpu.check()?;
        Ok(Schedule { launches, group })
    }

    /// Writes numbers.
    ///
    /// # Panics
    /// When there are not as many as the region has.
    pub fn put(&self, to: Region, values: &[f32]) {
        assert_eq!(values.len(), to.count, "numbers of a region");
        let bytes = bytemuck::cast_slice(values);
        let queue = &self.gpu.queue;
        queue.write_buffer(&self.numbers, 4 * u64::from(to.first), bytes);
    }

    /// Writes indices.
    ///
    /// # Panics
    /// When there are not as many as the region has.
    pub fn put_indices(&self, to: Region, values: &[u32]) {
        assert_eq!(values.len(), to.count, "indices of a region");
        let bytes = bytemuck::cast_slice(values);
        let queue = &self.gpu.queue;
        queue.write_buffer(&self.indices, 4 * u64::from(to.first), bytes);
    }

    /// Sets numbers to zero, after all that was started before.
    pub fn clear(&self, region: Region) {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let (first, size) = (4 * u64::from(region.first), 4 * region.count as u64);
        encoder.clear_buffer(&self.numbers, first, Some(size));
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Starts schedules, which run in order after all that was started or written before.
    ///
    /// # Errors
    /// When the GPU has failed.
    pub fn run(&self, schedules: &[&Schedule]) -> Result<(), GpuError> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encode(&mut encoder, schedules);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()
    }

    /// As [`Self::run`], waits, and reads regions, one after the other.
    ///
    /// # Errors
    /// When the GPU has failed.
    pub fn run_and_get(
        &self,
        schedules: &[&Schedule],
        from: &[Region],
    ) -> Result<Vec<f32>, GpuError> {
        let bytes = 4 * from.iter().map(|region| region.count as u64).sum::<u64>();
        let staging = self.gpu.buffer(bytes, wgpu::BufferUsages::MAP_READ);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encode(&mut encoder, schedules);
        let mut at = 0;
        for region in from {
            let (first, size) = (4 * u64::from(region.first), 4 * region.count as u64);
            encoder.copy_buffer_to_buffer(&self.numbers, first, &staging, at, size);
            at += size;
        }
        self.gpu.queue.submit([encoder.finish()]);
        let (sender, mapped) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, ..bytes, move |result| {
            // Nobody listens where the wait below has failed.
            sender.send(result).ok();
        });
        let waited = self.gpu.device.poll(wgpu::PollType::wait_indefinitely());
        self.gpu.check()?;
        waited.map_err(|error| GpuError::Failed(error.to_string()))?;
        let failed = |error: String| GpuError::Failed(error);
        mapped
            .recv()
            .map_err(|error| failed(error.to_string()))?
            .map_err(|error| failed(error.to_string()))?;
        let view = staging.get_mapped_range(..bytes);
        let view = view.map_err(|error| failed(error.to_string()))?;
        Ok(bytemuck::pod_collect_to_vec(&view))
    }
}

fn encode(encoder: &mut wgpu::CommandEncoder, schedules: &[&Schedule]) {
    let mut pass = encoder.begin_compute_pass(&Default::default());
    for schedule in schedules {
        for (number, (pipeline, [x, y, z])) in schedule.launches.iter().enumerate() {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &schedule.group, &[(number * APART) as u32]);
            pass.dispatch_workgroups(*x, *y, *z);
        }
    }
}

/// A number of bytes for people.
fn in_bytes(bytes: u64) -> String {
    let size = bytes as f64;
    match size {
        1e9.. => format!("{:.1} GB", size / 1e9),
        1e6.. => format!("{:.1} MB", size / 1e6),
        _ => format!("{:.1} kB", size / 1e3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_graphs::gpu;

    #[test]
    fn what_is_too_large_is_refused_with_what_would_need_less() {
        let Some(gpu) = gpu() else { return };
        let mut plan = Plan::default();
        plan.numbers(u32::MAX as usize - 64);
        let purpose = Purpose {
            what: "this test",
            remedy: "ask for less",
        };
        let refused = Memory::new(&gpu, &plan, purpose, None);
        let message = refused.err().expect("no room").to_string();
        assert!(message.starts_with("this test needs 17.2 GB"), "{message}");
        assert!(message.ends_with("ask for less"), "{message}");
    }

    #[test]
    fn a_gpu_that_is_not_there_is_an_error_with_their_count() {
        let Some(_) = gpu() else { return };
        let found = Gpu::open(1000).err().map(|error| error.to_string());
        let expected = format!(
            "there is no GPU number 1000: {} are there, counted from 0",
            Gpu::count()
        );
        assert_eq!(found, Some(expected));
    }

    #[test]
    fn a_lost_gpu_is_an_error_of_all_that_follows() {
        let Some(_) = gpu() else { return };
        let gpu = Gpu::open(0).expect("it is there");
        let mut plan = Plan::default();
        let region = plan.numbers(8);
        let purpose = Purpose {
            what: "this test",
            remedy: "ask for less",
        };
        let memory = Memory::new(&gpu, &plan, purpose, None).expect("room");
        memory.put(region, &[1.0; 8]);
        let found = memory.run_and_get(&[], &[region]).expect("it works");
        assert_eq!(found, [1.0; 8]);
        gpu.device.destroy();
        let lost = memory.run_and_get(&[], &[region]).err();
        let message = lost.expect("it is lost").to_string();
        assert!(message.contains("the GPU"), "{message}");
    }
}
