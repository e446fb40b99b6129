//! The host device: this machine's processor. Its C compiler makes a shared library of the kernels,
//! and plain loops run the commands of a schedule one after the other.
//!
//! It exists for tests without a GPU, against the processor's own engine. It is slow, and its speed
//! says nothing about a GPU. It multiplies in f32 whatever the precision.
//!
//! `unsafe` here: a library that this file has compiled is loaded, and its functions are called
//! with pointers into the arena. [`Loaded::prepare`] checks that every schedule stays within it.
#![allow(unsafe_code)]

use std::collections::HashMap;
use std::ffi::c_void;
use std::path::Path;
use std::process::Command as Process;
use std::sync::{Arc, Mutex, PoisonError};

use libloading::Library;
use selvedge_train::available_memory;

use crate::device::{Device, DeviceError, Loaded, Precision, Prepared};
use crate::kernels::{Dialect, Program, Sizes};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{
    Argument, Command, Epilogue, Launch, Matrix, Onto, Product, Schedule, Trace,
};

type Entry = unsafe extern "C" fn(*mut *mut c_void, u32);
type ProductEntry = unsafe extern "C" fn(
    *const usize,
    *const f32,
    *const usize,
    *const f32,
    *const usize,
    *mut f32,
    usize,
    u32,
    *const f32,
    u32,
);

/// The contents of the arena before anything is written: not a number.
const UNWRITTEN: u64 = 0x7fc0_dead_7fc0_dead;

/// This machine, through its C compiler.
#[derive(Debug)]
pub struct Host {
    compiler: String,
    /// Compiled libraries by their source.
    libraries: Mutex<HashMap<String, Arc<Library>>>,
}

impl Host {
    /// The host with the compiler that the environment variable `CC` names, else `cc`.
    ///
    /// # Errors
    /// When there is no such compiler.
    pub fn new() -> Result<Self, DeviceError> {
        let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
        let answer = Process::new(&compiler).arg("--version").output();
        match answer {
            Ok(answer) if answer.status.success() => Ok(Self {
                compiler,
                libraries: Mutex::default(),
            }),
            _ => Err(DeviceError::Library {
                library: "a C compiler (cc, or what CC names)",
                remedy: "the host device compiles its kernels with it; install one",
            }),
        }
    }

    /// The library of a source, which is compiled once.
    fn compiled(&self, text: String) -> Result<Arc<Library>, DeviceError> {
        let mut libraries = self
            .libraries
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = libraries.get(&text) {
            return Ok(Arc::clone(known));
        }
        let library = Arc::new(self.compile(&text)?);
        libraries.insert(text, Arc::clone(&library));
        Ok(library)
    }

    fn compile(&self, text: &str) -> Result<Library, DeviceError> {
        let folder = tempfile::tempdir()?;
        let [source, library] = ["program.c", "program.so"].map(|name| folder.path().join(name));
        std::fs::write(&source, text)?;
        let options = [
            "-std=c99",
            "-O2",
            "-ffp-contract=off",
            "-fPIC",
            "-shared",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-Wno-unused-function",
            "-Wno-unused-variable",
            "-Wno-unused-parameter",
            "-Wno-unknown-pragmas",
        ];
        let answer = Process::new(&self.compiler)
            .args(options)
            .arg("-o")
            .args([&library, &source])
            .arg("-lm")
            .output()?;
        if !answer.status.success() {
            return Err(DeviceError::Compile {
                compiler: self.compiler.clone(),
                log: String::from_utf8_lossy(&answer.stderr).into_owned(),
            });
        }
        open(&library)
    }
}

fn open(path: &Path) -> Result<Library, DeviceError> {
    // SAFETY: it was compiled here from the kernels' source, and runs nothing when it is loaded.
    unsafe { Library::new(path) }.map_err(|error| DeviceError::Call {
        call: "loading the compiled kernels",
        reason: error.to_string(),
    })
}

impl Device for Host {
    fn name(&self) -> String {
        format!("this machine, through {}", self.compiler)
    }

    fn free_bytes(&self) -> Result<usize, DeviceError> {
        Ok(available_memory() as usize)
    }

    fn load(
        &self,
        program: &Program,
        plan: &Plan,
        _: Precision,
    ) -> Result<Box<dyn Loaded>, DeviceError> {
        let library = self.compiled(program.text(Dialect::Host))?;
        let mut entries = HashMap::new();
        for kernel in program.kernels() {
            let name = format!("run_{}", kernel.name);
            // SAFETY: the source has a function of this name and type for each kernel.
            let entry = unsafe { library.get::<Entry>(name.as_bytes()) };
            let entry = entry.map_err(|_| DeviceError::NoKernel(name))?;
            entries.insert(kernel.name, *entry);
        }
        // SAFETY: as above.
        let product = unsafe { library.get::<ProductEntry>(b"run_product") };
        let product = *product.map_err(|_| DeviceError::NoKernel("run_product".to_owned()))?;
        Ok(Box::new(HostLoaded {
            arena: vec![UNWRITTEN; plan.words().div_ceil(2)],
            plan: plan.clone(),
            sizes: program.sizes(),
            entries,
            product,
            schedules: Vec::new(),
            _library: library,
        }))
    }
}

struct HostLoaded {
    /// Doubles begin at even words.
    arena: Vec<u64>,
    plan: Plan,
    sizes: Sizes,
    entries: HashMap<&'static str, Entry>,
    product: ProductEntry,
    schedules: Vec<Schedule>,
    /// The library of `entries`.
    _library: Arc<Library>,
}

impl HostLoaded {
    fn words(&mut self, region: Region) -> &mut [u32] {
        let place = self.plan.place(region);
        assert!(place.end <= 2 * self.arena.len(), "a region of the plan");
        let first = self.arena.as_mut_ptr().cast::<u32>();
        // SAFETY: `place` lies in the arena, which is borrowed as long as the slice.
        unsafe { std::slice::from_raw_parts_mut(first.add(place.start), place.len()) }
    }

    fn pointer(&mut self, region: Region) -> *mut c_void {
        self.words(region).as_mut_ptr().cast()
    }

    fn launch(&mut self, launch: &Launch) {
        enum Value {
            Pointer(*mut c_void),
            Count(u32),
            Number(f32),
        }
        let arguments = launch.arguments().iter();
        let mut values: Vec<Value> = arguments
            .map(|(_, argument)| match *argument {
                Argument::Region(region) => Value::Pointer(self.pointer(region)),
                Argument::Nothing => Value::Pointer(std::ptr::null_mut()),
                Argument::Count(count) => Value::Count(count),
                Argument::Number(number) => Value::Number(number),
            })
            .collect();
        let mut pointers: Vec<*mut c_void> = values
            .iter_mut()
            .map(|value| match value {
                Value::Pointer(pointer) => std::ptr::from_mut(pointer).cast(),
                Value::Count(count) => std::ptr::from_mut(count).cast(),
                Value::Number(number) => std::ptr::from_mut(number).cast(),
            })
            .collect();
        // SAFETY: the entry takes the arguments of the kernel's signature, and `prepare` has
        // compared those of the launch with them.
        unsafe { self.entries[launch.kernel.name](pointers.as_mut_ptr(), launch.count as u32) };
    }

    fn multiply(&mut self, product: &Product) {
        let strides = |matrix: Matrix| {
            if matrix.transposed {
                [1, matrix.leading]
            } else {
                [matrix.leading, 1]
            }
        };
        let (epilogue, bias) = match product.epilogue {
            Epilogue::Nothing => (0, std::ptr::null()),
            Epilogue::Bias(bias) => (1, self.pointer(bias).cast_const().cast()),
            Epilogue::BiasRelu(bias) => (2, self.pointer(bias).cast_const().cast()),
        };
        let [a, b] = [product.a, product.b].map(|m| (self.pointer(m.region).cast(), strides(m)));
        let c = self.pointer(product.c.region).cast();
        let onto = u32::from(product.onto == Onto::Add);
        // SAFETY: `prepare` has checked that the matrices lie in their regions.
        unsafe {
            (self.product)(
                product.size.as_ptr(),
                a.0,
                a.1.as_ptr(),
                b.0,
                b.1.as_ptr(),
                c,
                product.c.leading,
                onto,
                bias,
                epilogue,
            );
        }
    }
}

impl Loaded for HostLoaded {
    fn upload(&mut self, to: Region, words: &[u32]) -> Result<(), DeviceError> {
        self.words(to).copy_from_slice(words);
        Ok(())
    }

    fn download(&mut self, from: Region, words: &mut [u32]) -> Result<(), DeviceError> {
        words.copy_from_slice(self.words(from));
        Ok(())
    }

    fn prepare(&mut self, schedule: &Schedule) -> Result<Prepared, DeviceError> {
        for command in &schedule.commands {
            if let Command::Launch(launch) = command
                && !self.entries.contains_key(launch.kernel.name)
            {
                return Err(DeviceError::NoKernel(launch.kernel.name.to_owned()));
            }
        }
        Trace::fits(&self.plan, self.sizes, schedule)?;
        self.schedules.push(schedule.clone());
        Ok(Prepared(self.schedules.len() - 1))
    }

    fn run(&mut self, schedule: Prepared) -> Result<(), DeviceError> {
        let commands = std::mem::take(&mut self.schedules[schedule.0].commands);
        for command in &commands {
            match command {
                Command::Launch(launch) => self.launch(launch),
                Command::Product(product) => self.multiply(product),
                Command::Clear(region) => self.words(*region).fill(0),
                Command::Copy(from, to) => {
                    let words = self.words(*from).to_vec();
                    self.words(*to).copy_from_slice(&words);
                }
            }
        }
        self.schedules[schedule.0].commands = commands;
        Ok(())
    }

    fn wait(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}
