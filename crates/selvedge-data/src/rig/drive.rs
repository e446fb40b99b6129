//! Motion with the nodes of a rig: what follows a node moves rigidly with it from where it starts,
//! p(t) = M(t) M(t₀)⁻¹ p₀, with M from the node's space to the world and t₀ the start of the
//! file. So a node need not stand where its followers do, and may carry several.

use std::path::Path;

use glam::DMat4;

use super::bodies::steps;
use super::error::RigError;
use super::node::Rig;
use crate::formats::file_error::FileError;

impl Rig {
    /// As [`Self::motion`], of the nodes in the file at `path`.
    pub(crate) fn read_motion(
        path: &Path,
        names: &[String],
        frame_rate: f64,
    ) -> Result<Vec<Vec<DMat4>>, FileError<RigError>> {
        Self::of_file(path, |bytes, format| {
            Self::parse(bytes, format)?.motion(names, frame_rate)
        })
    }

    /// The transforms M(t) M(t₀)⁻¹ of the nodes of these names from the start of the file to their
    /// last key, `[frames][names]`.
    pub(crate) fn motion(
        &self,
        names: &[String],
        frame_rate: f64,
    ) -> Result<Vec<Vec<DMat4>>, RigError> {
        let nodes = names.iter().map(|name| self.find(name));
        let nodes = nodes.collect::<Result<Vec<usize>, _>>()?;
        let spans = nodes.iter().filter_map(|&node| self.span(node));
        let Some(last) = spans.map(|span| span[1]).reduce(f64::max) else {
            let mut unique = names.to_vec();
            unique.dedup();
            return Err(RigError::Content(format!(
                "none of the nodes [{}] is animated",
                unique.join(", ")
            )));
        };
        let first = self.start;
        let steps = steps(last - first, frame_rate)?;
        let back = |(&node, name): (&usize, &String)| {
            let inverse = self.placement(node, first).inverse();
            match inverse.is_finite() {
                true => Ok(inverse),
                false => Err(RigError::node(name, "is scaled to nothing at the start")),
            }
        };
        let back = nodes.iter().zip(names).map(back);
        let back = back.collect::<Result<Vec<DMat4>, _>>()?;
        let frame = |number: usize| {
            let time = first + number as f64 / frame_rate;
            let nodes = nodes.iter().zip(&back);
            let moved = nodes.map(|(&node, back)| self.placement(node, time) * *back);
            moved.collect()
        };
        Ok((0..=steps).map(frame).collect())
    }
}
