//! The laws of the material and of what acts on it: forces with their derivatives, and strain limits.

pub mod bend;
pub mod external;
pub(crate) mod strain_limit;
pub mod stretch;
pub mod stretch_table;
