//! Contact of a simulator: its checks at the start, the places of obstacles, and what it counted.

use glam::DVec3;

use super::{Simulator, SimulatorError};
use crate::contact::ContactCounts;

impl Simulator {
    /// Puts obstacles on their way from this frame to the next.
    pub(super) fn enter_frame(&mut self) {
        if let Some(contact) = &mut self.contact {
            contact.enter_frame(self.frame, self.scene.frame_rate);
        }
    }

    /// Checks that the thickness suits the mesh, and that nothing meets at the start.
    pub(super) fn check_contact(&self) -> Result<(), SimulatorError> {
        let Some(contact) = &self.contact else {
            return Ok(());
        };
        let lengths = self.scene.mesh.pattern().edge_lengths();
        let edge = lengths.into_iter().fold(f64::INFINITY, f64::min);
        let thickness = contact.largest_thickness();
        if thickness > 0.25 * edge {
            return Err(SimulatorError::Thickness { thickness, edge });
        }
        let rate = self.scene.frame_rate;
        let found = contact.intersections(&self.state.positions, self.frame, rate);
        if found.is_empty() {
            return Ok(());
        }
        let pair = |faces: &[u32; 2]| {
            let [a, b] = faces.map(|face| contact.face_name(face));
            format!("{a} and {b}")
        };
        let shown: Vec<String> = found.iter().take(5).map(|f| pair(&f.faces)).collect();
        let more = if found.len() > 5 { ", and more" } else { "" };
        let pairs = shown.join(", ") + more;
        let count = found.len();
        Err(SimulatorError::Intersections { count, pairs })
    }

    pub(super) fn forget_touches(&mut self) {
        if let Some(contact) = &mut self.contact {
            contact.forget();
        }
    }

    /// Work that contact has taken so far; all 0 without contact.
    #[must_use]
    pub fn contact_counts(&self) -> ContactCounts {
        let contact = self.contact.as_ref();
        contact.map_or_else(ContactCounts::default, |contact| contact.counts)
    }

    /// Pairs of faces that meet now, exactly, of the cloth at its rounded positions with itself and
    /// with obstacles; 0 without contact.
    #[must_use]
    pub fn intersection_count(&self) -> usize {
        let Some(contact) = &self.contact else {
            return 0;
        };
        let rounded: Vec<DVec3> = self.rounded.iter().map(|p| p.as_dvec3()).collect();
        let rate = self.scene.frame_rate;
        contact.intersections(&rounded, self.frame, rate).len()
    }
}
