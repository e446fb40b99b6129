//! Ranks of an MPI job, over the C interface of whatever MPI is installed.
//!
//! A message is handed to MPI and kept here until it has gone, so that no rank waits for another to
//! read. The crate `mpi` borrows what is sent until then, which a queue of messages cannot have;
//! hence the bindings below it, and `unsafe`: each block calls one function of MPI with pointers to
//! values that outlive the call, or in [`Sending`] the request. All calls are made under one lock,
//! as `MPI_THREAD_SERIALIZED` asks.
#![allow(unsafe_code, reason = "MPI is a library in C")]

use std::ffi::c_int;
use std::mem::MaybeUninit;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use mpi_sys as c;

use crate::ranks::Ranks;
use crate::transport::{ClusterError, Letter, Transport};

/// Variables by which launchers say that a process is a rank: Open MPI, MPICH and Intel MPI, PMIx
/// (Slurm), MVAPICH.
const LAUNCHED: [&str; 4] = [
    "OMPI_COMM_WORLD_SIZE",
    "PMI_SIZE",
    "PMIX_RANK",
    "MV2_COMM_WORLD_SIZE",
];

/// Time for the last messages to leave, and for the other ranks to take leave.
const FAREWELL: Duration = Duration::from_secs(5);

/// Returns true where this process was started as a rank, by `mpirun` or `srun`.
pub fn is_launched() -> bool {
    LAUNCHED.iter().any(|name| std::env::var_os(name).is_some())
}

/// Joins the ranks of the MPI job that this process is of. Once per process.
pub fn open_mpi() -> Result<Ranks, ClusterError> {
    let mut provided: c_int = 0;
    // SAFETY: null arguments are allowed; `provided` outlives the call.
    let code = unsafe {
        c::MPI_Init_thread(
            std::ptr::null_mut(),
            std::ptr::null_mut(),
            c::RSMPI_THREAD_SERIALIZED,
            &raw mut provided,
        )
    };
    check("starting", code)?;
    // SAFETY: reads a constant of the bindings.
    if provided < unsafe { c::RSMPI_THREAD_SERIALIZED } {
        return Err(ClusterError::Mpi {
            doing: "starting",
            problem: "this MPI was built for one thread: build it with threads".to_owned(),
        });
    }
    let (mut rank, mut count): (c_int, c_int) = (0, 0);
    // SAFETY: MPI is started, and the numbers outlive the calls. With errors returned instead of
    // ending the process, a failure can be told with its rank.
    let codes = unsafe {
        [
            c::MPI_Comm_set_errhandler(c::RSMPI_COMM_WORLD, c::RSMPI_ERRORS_RETURN),
            c::MPI_Comm_rank(c::RSMPI_COMM_WORLD, &raw mut rank),
            c::MPI_Comm_size(c::RSMPI_COMM_WORLD, &raw mut count),
        ]
    };
    codes
        .into_iter()
        .try_for_each(|code| check("starting", code))?;
    let mut mpi = Mpi {
        rank: rank as usize,
        count: count as usize,
        places: Vec::new(),
        in_sight: Vec::new(),
        sending: Mutex::default(),
    };
    mpi.places = mpi.exchange_places()?;
    let own = mpi.places[mpi.rank].machine.clone();
    let in_sight = |place: &Place| place.machine == own && is_running(place.process);
    mpi.in_sight = mpi.places.iter().map(in_sight).collect();
    Ok(Ranks::new(Box::new(mpi)))
}

/// Process and machine of a rank.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Place {
    process: u32,
    machine: String,
}

/// A message that MPI has not let go of.
struct Sending {
    request: c::MPI_Request,
    /// Not moved or freed before the request is complete.
    _bytes: Box<[u8]>,
}

// SAFETY: a request is a handle that any thread may test, one at a time, with serialised threads.
unsafe impl Send for Sending {}

struct Mpi {
    rank: usize,
    count: usize,
    /// By rank.
    places: Vec<Place>,
    /// The ranks whose processes can be seen from this one: those of this machine, unless each is
    /// in a container of its own.
    in_sight: Vec<bool>,
    /// The lock of all calls, and what is on its way.
    sending: Mutex<Vec<Sending>>,
}

impl Mpi {
    fn lock(&self) -> MutexGuard<'_, Vec<Sending>> {
        self.sending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells all others where this rank is, and hears where they are.
    fn exchange_places(&self) -> Result<Vec<Place>, ClusterError> {
        let own = format!("{} {}", std::process::id(), machine());
        for to in (0..self.count).filter(|to| *to != self.rank) {
            self.send(to, 0, own.clone().into_bytes())?;
        }
        let mut places = vec![None; self.count];
        places[self.rank] = Some(own);
        while places.iter().any(Option::is_none) {
            match self.poll()? {
                Some(letter) => {
                    places[letter.from] = Some(String::from_utf8_lossy(&letter.bytes).into_owned());
                }
                None => thread::sleep(Duration::from_millis(1)),
            }
        }
        let place = |text: String| {
            let (process, machine) = text.split_once(' ').unwrap_or(("0", ""));
            Place {
                process: process.parse().unwrap_or(0),
                machine: machine.to_owned(),
            }
        };
        Ok(places.into_iter().flatten().map(place).collect())
    }
}

impl Transport for Mpi {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.count
    }

    fn send(&self, to: usize, tag: u32, bytes: Vec<u8>) -> Result<(), ClusterError> {
        let mut sending = self.lock();
        let bytes = bytes.into_boxed_slice();
        let length = c_int::try_from(bytes.len()).map_err(|_| ClusterError::Mpi {
            doing: "sending",
            problem: format!("a message of {} bytes is over 2 GiB", bytes.len()),
        })?;
        // SAFETY: reads a constant of the bindings.
        let mut request = unsafe { c::RSMPI_REQUEST_NULL };
        // SAFETY: the bytes are kept beside the request until it is complete; see `sweep`.
        let code = unsafe {
            c::MPI_Isend(
                bytes.as_ptr().cast(),
                length,
                c::RSMPI_UINT8_T,
                to as c_int,
                tag as c_int,
                c::RSMPI_COMM_WORLD,
                &raw mut request,
            )
        };
        let _bytes = bytes;
        sending.push(Sending { request, _bytes });
        check("sending", code)?;
        sweep(&mut sending)
    }

    fn poll(&self) -> Result<Option<Letter>, ClusterError> {
        let mut sending = self.lock();
        sweep(&mut sending)?;
        let mut is_there: c_int = 0;
        let mut status = MaybeUninit::<c::MPI_Status>::uninit();
        // SAFETY: flag and status outlive the call; the status is written where the flag is set.
        let code = unsafe {
            c::MPI_Iprobe(
                c::RSMPI_ANY_SOURCE,
                c::RSMPI_ANY_TAG,
                c::RSMPI_COMM_WORLD,
                &raw mut is_there,
                status.as_mut_ptr(),
            )
        };
        check("looking for messages", code)?;
        if is_there == 0 {
            return Ok(None);
        }
        // SAFETY: the flag is set.
        let status = unsafe { status.assume_init() };
        let mut length: c_int = 0;
        // SAFETY: the status is that of a message, and the number outlives the call.
        let code =
            unsafe { c::MPI_Get_count(&raw const status, c::RSMPI_UINT8_T, &raw mut length) };
        check("looking at a message", code)?;
        let mut bytes = vec![0_u8; length as usize];
        // SAFETY: the message of this rank and tag has so many bytes, and all calls are made under
        // one lock, so that it is the one that was looked at.
        let code = unsafe {
            c::MPI_Recv(
                bytes.as_mut_ptr().cast(),
                length,
                c::RSMPI_UINT8_T,
                status.MPI_SOURCE,
                status.MPI_TAG,
                c::RSMPI_COMM_WORLD,
                c::RSMPI_STATUS_IGNORE,
            )
        };
        check("reading a message", code)?;
        Ok(Some(Letter {
            from: status.MPI_SOURCE as usize,
            tag: status.MPI_TAG as u32,
            bytes,
        }))
    }

    fn is_sending(&self) -> bool {
        !self.lock().is_empty()
    }

    fn is_alive(&self, rank: usize) -> bool {
        // Of other machines the launcher knows.
        !self.in_sight[rank] || is_running(self.places[rank].process)
    }

    fn local_rank(&self) -> usize {
        let own = &self.places[self.rank].machine;
        let before = self.places[..self.rank].iter();
        before.filter(|place| place.machine == *own).count()
    }

    fn place(&self, rank: usize) -> String {
        match self.places.get(rank) {
            Some(Place { process, machine }) => format!("process {process} on {machine}"),
            None => "an unknown place".to_owned(),
        }
    }

    fn close(&self) {
        let started = Instant::now();
        // Other ranks may have ended: whoever waits for them in MPI waits for ever.
        thread::spawn(move || {
            thread::sleep(FAREWELL);
            std::process::exit(1);
        });
        loop {
            // Messages that nobody reads any more are read here, or those that sent them would not
            // get rid of them.
            while matches!(self.poll(), Ok(Some(_))) {}
            if !self.is_sending() {
                break;
            }
            if started.elapsed() >= FAREWELL {
                // MPI may still read what is on its way, and must not be left before it has.
                std::process::exit(1);
            }
            thread::sleep(Duration::from_millis(1));
        }
        let _lock = self.lock();
        // SAFETY: nothing is on its way, and nothing is sent afterwards.
        let _ = unsafe { c::MPI_Finalize() };
    }
}

/// Forgets what has gone.
fn sweep(sending: &mut Vec<Sending>) -> Result<(), ClusterError> {
    let mut failure = Ok(());
    sending.retain_mut(|message| {
        let mut is_gone: c_int = 0;
        // SAFETY: the request is one of `MPI_Isend` that has not been completed before.
        let code = unsafe {
            c::MPI_Test(
                &raw mut message.request,
                &raw mut is_gone,
                c::RSMPI_STATUS_IGNORE,
            )
        };
        if let Err(error) = check("sending", code) {
            failure = Err(error);
        }
        is_gone == 0
    });
    failure
}

fn check(doing: &'static str, code: c_int) -> Result<(), ClusterError> {
    if code == c::MPI_SUCCESS as c_int {
        return Ok(());
    }
    let problem = format!("error {code}: a rank may have ended, or the network failed");
    Err(ClusterError::Mpi { doing, problem })
}

fn machine() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname");
    name.map_or_else(|_| "this machine".to_owned(), |name| name.trim().to_owned())
}

/// Returns false for a process of this machine that has ended, even if nobody has asked how.
fn is_running(process: u32) -> bool {
    if !Path::new("/proc/self/stat").exists() {
        return true;
    }
    let Ok(stat) = std::fs::read_to_string(format!("/proc/{process}/stat")) else {
        return false;
    };
    // The state stands after the name, which is in brackets and may have any letters.
    let state = stat
        .rsplit(')')
        .next()
        .and_then(|rest| rest.trim_start().chars().next());
    !matches!(state, Some('Z' | 'X'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_has_ended_is_known() {
        assert!(is_running(std::process::id()));
        // No process has this number on Linux.
        assert!(!is_running(4_194_999));
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let number = child.id();
        let started = Instant::now();
        // Until its end is asked for it is a zombie.
        while is_running(number) {
            assert!(started.elapsed() < Duration::from_secs(10));
            thread::sleep(Duration::from_millis(1));
        }
        child.wait().unwrap();
    }
}
