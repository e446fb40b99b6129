//! The laws of a cloth: forces of stretching, bending and air with their derivatives, and strain
//! limits.

pub mod bend;
pub mod external;
pub use selvedge_contact::number;
pub mod stretch;
pub mod stretch_energy;
pub mod stretch_table;
