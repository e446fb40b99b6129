//! The motion of a cloth as it is shown: a borrowed run of frames, numbers to colour it by, and
//! the panel that joins them.

pub(crate) mod body;
pub(crate) mod field;
pub(crate) mod panel;
pub(crate) mod run;
