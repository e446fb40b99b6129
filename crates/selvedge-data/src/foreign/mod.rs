//! Data of other projects, as data sets of ours: the folders of the released code of Libao et al.
//! 2023 (.npy), DeepMind's `flag_simple` (meta.json and TFRecord), and caches of other programs.
//!
//! Foreign data lack some of what a cloth needs. Nothing is made up in silence: what is missing is
//! an option ([`ImportOptions`]), an error where nobody can know it, a documented default where its
//! source says it, and an error again where the data say it themselves. What was resolved is in the
//! data set's configuration. Positions are turned to y up, all faces counter-clockwise in material
//! space.

mod array;
mod assemble;
mod cache;
mod crc32c;
mod error;
mod example;
mod flag_simple;
mod options;
mod released;
mod source;
mod tfrecord;

pub use error::{ForeignError, ForeignProblem, RecordProblem};
pub use options::{ForeignFormat, HandleSource, ImportOptions, Purpose, RestSource};
pub use source::{ForeignRun, ForeignSource};
