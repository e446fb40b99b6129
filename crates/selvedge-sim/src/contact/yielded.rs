//! What is known of contact that was released.

use glam::DVec3;
use selvedge_cloth::ReleasedContact;
use selvedge_contact::Pair;

/// Released contact, and the frames at whose end it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YieldedContact {
    /// The contact.
    pub released: ReleasedContact,
    /// First and last frame.
    pub frames: [usize; 2],
}

/// The way of a vertex out of the body that it may pass, over a frame.
pub(super) struct WayOut {
    /// The vertex and the face through which it is to leave.
    pub(super) pair: Pair,
    pub(super) weights: [f64; 4],
    /// Direction out of the body.
    pub(super) normal: DVec3,
}
