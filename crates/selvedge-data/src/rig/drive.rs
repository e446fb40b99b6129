//! Handles that follow the nodes of a rig: a handle moves rigidly with its node from where it
//! starts, p(t) = M(t) M(t₀)⁻¹ p₀, with M from the node's space to the world and t₀ the first key
//! of all nodes that are followed. So a node need not stand where its handles do, and may carry
//! several.

use std::path::Path;

use glam::{DMat4, DVec3};
use selvedge_cloth::RecordedMotion;

use super::bodies::steps;
use super::error::RigError;
use super::node::Rig;

/// Handles and what they follow.
pub(crate) struct Followers<'a> {
    /// The name of each handle's node, `[handles]`.
    pub(crate) nodes: &'a [String],
    /// Start positions of the handles `[m]`, `[handles]`.
    pub(crate) start: &'a [DVec3],
    /// Frames per second of the scene.
    pub(crate) frame_rate: f64,
}

impl Rig {
    /// The motion of `followers` in the file at `path`, from its first key to its last.
    pub(crate) fn read_motion(
        path: &Path,
        followers: &Followers<'_>,
    ) -> Result<RecordedMotion, RigError> {
        let rig = Self::read(path)?;
        rig.motion(followers).map_err(|source| RigError::File {
            path: path.to_owned(),
            source: Box::new(source),
        })
    }

    /// The motion of `followers` from the first key to the last.
    pub(crate) fn motion(&self, followers: &Followers<'_>) -> Result<RecordedMotion, RigError> {
        let names = followers.nodes;
        if names.len() != followers.start.len() {
            return Err(RigError::Count {
                nodes: names.len(),
                handles: followers.start.len(),
            });
        }
        let nodes: Vec<usize> = names
            .iter()
            .map(|name| self.find(name))
            .collect::<Result<_, _>>()?;
        let spans = nodes.iter().filter_map(|&node| self.span(node));
        let Some([first, last]) = spans.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]) else {
            let mut unique = names.to_vec();
            unique.dedup();
            return Err(RigError::Still {
                names: unique.join(", "),
            });
        };
        let steps = steps(last - first, followers.frame_rate)?;
        let back: Vec<DMat4> = nodes
            .iter()
            .zip(names)
            .map(|(&node, name)| self.inverse_placement(node, name, first))
            .collect::<Result<_, _>>()?;
        let frame = |number: usize| {
            let time = first + number as f64 / followers.frame_rate;
            let handles = nodes.iter().zip(&back).zip(followers.start);
            handles
                .map(|((&node, back), start)| {
                    (self.placement(node, time) * *back).transform_point3(*start)
                })
                .collect()
        };
        Ok(RecordedMotion {
            positions: (0..=steps).map(frame).collect(),
        })
    }

    fn inverse_placement(&self, node: usize, name: &str, time: f64) -> Result<DMat4, RigError> {
        let placement = self.placement(node, time);
        let inverse = placement.inverse();
        if inverse.is_finite() {
            return Ok(inverse);
        }
        Err(RigError::Node {
            name: name.to_owned(),
            problem: "is scaled to nothing at its first key".to_owned(),
        })
    }
}
