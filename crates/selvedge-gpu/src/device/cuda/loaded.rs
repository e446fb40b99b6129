//! A program and its arena on a GPU. The first run of a schedule makes plain calls, in which the
//! libraries load whatever they load late. The second run is recorded as a CUDA graph, which later
//! runs replay. Where recording fails, plain calls remain, and the reason is kept.

use std::collections::HashMap;
use std::ffi::{CString, c_void};
use std::sync::Arc;

use cudarc::driver::result;
use cudarc::driver::sys;

use super::context::{Context, alone, failed};
use super::owned::{Graph, Memory, Module, Stream};
use super::product::{Blas, Gemm, WORKSPACE};
use crate::device::{DeviceError, Loaded, Precision, Prepared, in_bytes};
use crate::kernels::layers::{ADD_BIAS, ADD_BIAS_RELU};
use crate::kernels::{BLOCK_THREADS, Kernel, Program, Shape, Sizes, WARP};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{
    Argument, Command, Epilogue, Launch, Matrix, NamedArgument, Product, Schedule, Trace, args,
};

/// The most words that may be on their way to the GPU; uploads beyond are waited for.
const MOST_GOING_UP: usize = 1 << 20;

/// The number of blocks, and of threads in each, for `count` elements or rows of a kernel.
pub(super) fn grid(shape: Shape, count: usize) -> (u32, u32) {
    let blocks = |per_block: u32| count.div_ceil(per_block as usize) as u32;
    match shape {
        Shape::Element => (blocks(BLOCK_THREADS), BLOCK_THREADS),
        Shape::Row => (blocks(BLOCK_THREADS / WARP), BLOCK_THREADS),
    }
}

/// One call of the driver or of cuBLAS.
enum Call {
    Kernel {
        function: sys::CUfunction,
        grid: (u32, u32),
        /// The count, then the arguments, each in the low bytes of a word.
        values: Vec<u64>,
    },
    Product(Gemm),
    Clear {
        first: u64,
        bytes: usize,
    },
    Copy {
        from: u64,
        to: u64,
        bytes: usize,
    },
}

/// The state of a schedule.
enum Mode {
    /// Not yet run.
    Fresh,
    /// Run once by plain calls.
    Warm,
    /// Run by plain calls, since it could not be recorded.
    Plain,
    /// Recorded.
    Recorded(sys::CUgraphExec),
}

struct Ready {
    calls: Vec<Call>,
    mode: Mode,
}

/// A program and its arena. Fields are dropped in order: users of the stream before the stream.
pub(super) struct CudaLoaded {
    functions: HashMap<&'static str, sys::CUfunction>,
    plan: Plan,
    sizes: Sizes,
    schedules: Vec<Ready>,
    /// The reason why a schedule could not be recorded, for the first such schedule.
    unrecorded: Option<String>,
    /// Words on their way to the GPU. The driver may read them until the stream was waited for.
    going_up: Vec<Vec<u32>>,
    blas: Option<Blas>,
    arena: Memory,
    workspace: Option<Memory>,
    stream: Stream,
    module: Module,
    context: Arc<Context>,
}

// SAFETY: the pointers belong to the context, which every call makes current for its thread. Two
// threads never use one value at once, since all calls take it mutably.
unsafe impl Send for CudaLoaded {}

impl CudaLoaded {
    /// Allocates the arena of a plan, for a program that was loaded as `module`.
    pub(super) fn new(
        context: Arc<Context>,
        module: Module,
        program: &Program,
        plan: &Plan,
        precision: Precision,
    ) -> Result<Self, DeviceError> {
        let stream = Stream::new()?;
        let memory = |bytes: usize| {
            Memory::new(bytes).map_err(|error| match error.0 {
                sys::CUresult::CUDA_ERROR_OUT_OF_MEMORY => DeviceError::Memory {
                    what: "the arena".to_owned(),
                    needed: in_bytes(bytes),
                    free: result::mem_get_info().map_or("?".to_owned(), |(free, _)| in_bytes(free)),
                    remedy: "something else took the memory meanwhile: see what nvidia-smi says"
                        .to_owned(),
                },
                _ => failed("cuMemAlloc")(error),
            })
        };
        let mut loaded = Self {
            functions: HashMap::new(),
            plan: plan.clone(),
            sizes: program.sizes(),
            schedules: Vec::new(),
            unrecorded: None,
            going_up: Vec::new(),
            blas: None,
            arena: memory(plan.bytes())?,
            workspace: None,
            stream,
            module,
            context,
        };
        for kernel in program.kernels() {
            let function = loaded.find(kernel)?;
            loaded.functions.insert(kernel.name, function);
        }
        let workspace = memory(WORKSPACE)?;
        loaded.blas = Some(Blas::new(loaded.stream.0, workspace.0, precision)?);
        loaded.workspace = Some(workspace);
        Ok(loaded)
    }

    fn find(&self, kernel: &Kernel) -> Result<sys::CUfunction, DeviceError> {
        let no_kernel = || DeviceError::NoKernel(kernel.name.to_owned());
        let name = CString::new(format!("run_{}", kernel.name)).map_err(|_| no_kernel())?;
        // SAFETY: the module is loaded.
        unsafe { result::module::get_function(self.module.0, name) }.map_err(|_| no_kernel())
    }

    fn address(&self, region: Region) -> u64 {
        self.arena.0 + 4 * self.plan.place(region).start as u64
    }

    fn calls(&self, schedule: &Schedule) -> Result<Vec<Call>, DeviceError> {
        let mut calls = Vec::with_capacity(schedule.len());
        for command in &schedule.commands {
            match command {
                Command::Launch(launch) => calls.extend(self.launch(launch)?),
                Command::Product(product) => self.product(product, &mut calls)?,
                Command::Clear(region) => calls.push(Call::Clear {
                    first: self.address(*region),
                    bytes: 4 * self.plan.place(*region).len(),
                }),
                Command::Copy(from, to) => calls.push(Call::Copy {
                    from: self.address(*from),
                    to: self.address(*to),
                    bytes: 4 * self.plan.place(*from).len(),
                }),
            }
        }
        Ok(calls)
    }

    /// The call of a kernel; none where there is nothing to do.
    fn launch(&self, launch: &Launch) -> Result<Option<Call>, DeviceError> {
        if launch.count == 0 {
            return Ok(None);
        }
        let kernel = launch.kernel;
        let function = self.functions.get(kernel.name);
        let function = function.ok_or_else(|| DeviceError::NoKernel(kernel.name.to_owned()))?;
        let value = |(_, argument): &NamedArgument| match *argument {
            Argument::Region(region) => self.address(region),
            Argument::Nothing => 0,
            Argument::Count(count) => u64::from(count),
            Argument::Number(number) => u64::from(number.to_bits()),
        };
        let count = launch.count as u64;
        Ok(Some(Call::Kernel {
            function: *function,
            grid: grid(kernel.shape, launch.count),
            values: std::iter::once(count)
                .chain(launch.arguments().iter().map(value))
                .collect(),
        }))
    }

    /// The calls of a product and of its epilogue.
    fn product(&self, product: &Product, calls: &mut Vec<Call>) -> Result<(), DeviceError> {
        let [rows, columns, _] = product.size;
        if rows == 0 || columns == 0 {
            return Ok(());
        }
        let first = |matrix: &Matrix| self.plan.place(matrix.region).start;
        let gemm = Gemm::of(product, first).ok_or_else(|| DeviceError::Call {
            call: "cublasGemmEx",
            reason: format!("a product of {:?} is too large", product.size),
        })?;
        calls.push(Call::Product(gemm));
        let (kernel, bias) = match product.epilogue {
            Epilogue::Nothing => return Ok(()),
            Epilogue::Bias(bias) => (&ADD_BIAS, bias),
            Epilogue::BiasRelu(bias) => (&ADD_BIAS_RELU, bias),
        };
        let c = product.c;
        let arguments = args! { rows: c.region, leading: c.leading, bias, width: columns };
        calls.extend(self.launch(&Launch::new(kernel, rows, arguments))?);
        Ok(())
    }

    fn call_all(&self, calls: &[Call]) -> Result<(), DeviceError> {
        calls.iter().try_for_each(|call| self.call(call))
    }

    fn call(&self, call: &Call) -> Result<(), DeviceError> {
        // SAFETY: all calls stay within the arena, which was checked when the schedule was
        // prepared. Functions, stream and arena live as long as `self`.
        match call {
            Call::Kernel {
                function,
                grid: (blocks, threads),
                values,
            } => {
                let pointer = |value: &u64| std::ptr::from_ref(value).cast::<c_void>().cast_mut();
                let mut pointers: Vec<*mut c_void> = values.iter().map(pointer).collect();
                let (grid, block) = ((*blocks, 1, 1), (*threads, 1, 1));
                unsafe {
                    result::launch_kernel(*function, grid, block, 0, self.stream.0, &mut pointers)
                }
                .map_err(failed("cuLaunchKernel"))
            }
            Call::Product(gemm) => match &self.blas {
                Some(blas) => blas.multiply(gemm, self.arena.0),
                None => Ok(()),
            },
            Call::Clear { first, bytes } => {
                unsafe { result::memset_d8_async(*first, 0, *bytes, self.stream.0) }
                    .map_err(failed("cuMemsetD8Async"))
            }
            Call::Copy { from, to, bytes } => {
                unsafe { result::memcpy_dtod_async(*to, *from, *bytes, self.stream.0) }
                    .map_err(failed("cuMemcpyDtoDAsync"))
            }
        }
    }

    /// Records calls as a graph.
    fn record(&self, calls: &[Call]) -> Result<sys::CUgraphExec, DeviceError> {
        let _guard = alone();
        let mode = sys::CUstreamCaptureMode::CU_STREAM_CAPTURE_MODE_RELAXED;
        // SAFETY: the stream is alive. A recording that was begun is ended even where a call
        // failed.
        let (called, ended) = unsafe {
            result::stream::begin_capture(self.stream.0, mode)
                .map_err(failed("cuStreamBeginCapture"))?;
            let called = self.call_all(calls);
            (called, result::stream::end_capture(self.stream.0))
        };
        let graph = ended.map(Graph).map_err(failed("cuStreamEndCapture"));
        // The first failure says more than those that follow from it.
        let graph = called.and(graph)?;
        if graph.0.is_null() {
            return Err(DeviceError::Call {
                call: "cuStreamEndCapture",
                reason: "there is no graph".to_owned(),
            });
        }
        let flags = sys::CUgraphInstantiate_flags_enum(0);
        // SAFETY: the graph is alive. It may be freed once it is instantiated.
        let recorded = unsafe { result::graph::instantiate(graph.0, flags) };
        recorded.map_err(failed("cuGraphInstantiate"))
    }

    fn run_ready(&mut self, ready: &mut Ready) -> Result<(), DeviceError> {
        if matches!(ready.mode, Mode::Warm) {
            ready.mode = match self.record(&ready.calls) {
                Ok(graph) => Mode::Recorded(graph),
                Err(error) => {
                    self.unrecorded.get_or_insert_with(|| error.to_string());
                    Mode::Plain
                }
            };
        }
        if let Mode::Recorded(graph) = ready.mode {
            // SAFETY: graph and stream are alive.
            let launched = unsafe { result::graph::launch(graph, self.stream.0) };
            return launched.map_err(failed("cuGraphLaunch"));
        }
        self.call_all(&ready.calls)?;
        if matches!(ready.mode, Mode::Fresh) {
            ready.mode = Mode::Warm;
        }
        Ok(())
    }
}

impl Loaded for CudaLoaded {
    fn upload(&mut self, to: Region, words: &[u32]) -> Result<(), DeviceError> {
        self.context.enter()?;
        let found = self.plan.place(to).len();
        assert_eq!(found, words.len(), "words of a region");
        if words.is_empty() {
            return Ok(());
        }
        let to = self.address(to);
        let copy = |words: &[u32]| {
            // SAFETY: the region has as many words; they live until the stream was waited for.
            unsafe { result::memcpy_htod_async(to, words, self.stream.0) }
                .map_err(failed("cuMemcpyHtoDAsync"))
        };
        if words.len() > MOST_GOING_UP {
            copy(words)?;
            return self.wait();
        }
        let kept = words.to_vec();
        copy(&kept)?;
        self.going_up.push(kept);
        if self.going_up.iter().map(Vec::len).sum::<usize>() > MOST_GOING_UP {
            return self.wait();
        }
        Ok(())
    }

    fn download(&mut self, from: Region, words: &mut [u32]) -> Result<(), DeviceError> {
        self.context.enter()?;
        let found = self.plan.place(from).len();
        assert_eq!(found, words.len(), "words of a region");
        if words.is_empty() {
            return self.wait();
        }
        // SAFETY: the region has as many words, and the stream is waited for before they are read.
        unsafe { result::memcpy_dtoh_async(words, self.address(from), self.stream.0) }
            .map_err(failed("cuMemcpyDtoHAsync"))?;
        self.wait()
    }

    fn prepare(&mut self, schedule: &Schedule) -> Result<Prepared, DeviceError> {
        Trace::fits(&self.plan, self.sizes, schedule)?;
        let calls = self.calls(schedule)?;
        self.schedules.push(Ready {
            calls,
            mode: Mode::Fresh,
        });
        Ok(Prepared(self.schedules.len() - 1))
    }

    fn run(&mut self, schedule: Prepared) -> Result<(), DeviceError> {
        self.context.enter()?;
        let mut schedules = std::mem::take(&mut self.schedules);
        let ran = self.run_ready(&mut schedules[schedule.0]);
        self.schedules = schedules;
        ran
    }

    fn wait(&mut self) -> Result<(), DeviceError> {
        self.context.enter()?;
        self.stream.wait()?;
        self.going_up.clear();
        Ok(())
    }

    fn unrecorded(&self) -> Option<&str> {
        self.unrecorded.as_deref()
    }
}

impl Drop for CudaLoaded {
    fn drop(&mut self) {
        // A failure cannot be reported from here.
        let _ = self.wait();
        for ready in &self.schedules {
            if let Mode::Recorded(graph) = ready.mode {
                // SAFETY: it was made and not destroyed.
                let _ = unsafe { result::graph::exec_destroy(graph) };
            }
        }
    }
}
