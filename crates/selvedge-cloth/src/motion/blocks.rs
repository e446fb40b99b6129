//! Motion in blocks: each lasts a time and adds translations to a rotation of the handles about a
//! vertical axis, the form of the motions of Libao et al. 2023.
//!
//! Within a block the rotation acts on the positions at the block's start, and the translations are
//! added: p(t) = c + R_y(±a(t)/r)(p₀ - c) + Σ d_i s_i(t), with c on the line of the outer handles
//! as they stand at the start of the block and r the horizontal distance of the farthest handle
//! from the axis. `[eq:handle-block]`

use glam::{DVec3, Vec3Swizzles as _};

use super::bounds::{FARTHEST, too_few_handles, turned, whole_frames};
use super::pace::Progress;
use super::written::{Block, Rotation, Translation, TurnSense};
use crate::error::{SceneError, must};

/// Blocks bound to handles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BlockPath {
    segments: Vec<Segment>,
    frames: usize,
}

/// One block, from where it starts.
#[derive(Clone, Debug, PartialEq)]
struct Segment {
    /// Frames of 1/60 s before it.
    begin: usize,
    frames: usize,
    start: Vec<DVec3>,
    translations: Vec<(DVec3, Progress)>,
    turn: Option<Turn>,
}

#[derive(Clone, Debug, PartialEq)]
struct Turn {
    axis: DVec3,
    /// Angle per arc of the farthest handle `[rad/m]`, signed.
    angle_per_arc: f64,
    arc: Progress,
}

impl BlockPath {
    pub(super) fn new(blocks: &[Block], start: &[DVec3]) -> Result<Self, SceneError> {
        if blocks.is_empty() {
            return Err(must("blocks", "at least one block", "none"));
        }
        let mut segments = Vec::with_capacity(blocks.len());
        let (mut begin, mut positions) = (0, start.to_vec());
        for (number, block) in blocks.iter().enumerate() {
            let field = format!("blocks[{number}]");
            let segment = Segment::new(&field, block, begin, positions)?;
            positions = segment.at(segment.frames as f64);
            let is_usable = |p: &&DVec3| (0.0..=FARTHEST).contains(&p.length());
            if let Some(bad) = positions.iter().find(|p| !is_usable(p)) {
                let expected = "a move that ends at most 1e6 m from the origin";
                return Err(must(field, expected, bad));
            }
            begin += segment.frames;
            segments.push(segment);
        }
        Ok(Self {
            segments,
            frames: begin,
        })
    }

    /// Frames of 1/60 s that it lasts.
    pub(super) fn frames(&self) -> usize {
        self.frames
    }

    /// Positions `place` frames of 1/60 s after the start.
    pub(super) fn at(&self, place: f64) -> Vec<DVec3> {
        let after = self.segments.partition_point(|s| s.begin as f64 <= place);
        let segment = &self.segments[after.max(1) - 1];
        segment.at((place - segment.begin as f64).clamp(0.0, segment.frames as f64))
    }
}

impl Segment {
    fn new(
        field: &str,
        block: &Block,
        begin: usize,
        start: Vec<DVec3>,
    ) -> Result<Self, SceneError> {
        let frames = whole_frames(format!("{field}.duration"), block.duration)?;
        let mut translations = Vec::with_capacity(block.translations.len());
        for (number, translation) in block.translations.iter().enumerate() {
            let field = format!("{field}.translations[{number}]");
            translations.push(bind_translation(&field, translation, frames)?);
        }
        let turn = match &block.rotation {
            Some(rotation) => Some(Turn::new(field, rotation, frames, &start)?),
            None => None,
        };
        Ok(Self {
            begin,
            frames,
            start,
            translations,
            turn,
        })
    }

    fn at(&self, place: f64) -> Vec<DVec3> {
        let mut shift = DVec3::ZERO;
        for (direction, progress) in &self.translations {
            shift += *direction * progress.at(place);
        }
        match &self.turn {
            None => self.start.iter().map(|&p| p + shift).collect(),
            Some(turn) => {
                let angle = turn.angle_per_arc * turn.arc.at(place);
                let turned = |&p: &DVec3| turned(p, turn.axis, angle) + shift;
                self.start.iter().map(turned).collect()
            }
        }
    }
}

fn bind_translation(
    field: &str,
    translation: &Translation,
    frames: usize,
) -> Result<(DVec3, Progress), SceneError> {
    let progress = translation
        .pace
        .progress(&format!("{field}.pace"), frames)?;
    let unit = translation.direction.try_normalize();
    let usable =
        translation.direction.is_finite() && (unit.is_some() || translation.pace.is_zero());
    if !usable {
        let found = translation.direction.to_string();
        let expected = "a finite direction that is not zero";
        return Err(must(format!("{field}.direction"), expected, found));
    }
    Ok((unit.unwrap_or_default(), progress))
}

impl Turn {
    fn new(
        field: &str,
        rotation: &Rotation,
        frames: usize,
        start: &[DVec3],
    ) -> Result<Self, SceneError> {
        let arc = rotation
            .arc
            .progress(&format!("{field}.rotation.arc"), frames)?;
        let field = format!("{field}.rotation.center");
        if !rotation.center.is_finite() {
            return Err(must(field, "finite", rotation.center));
        }
        let [first, .., last] = start else {
            let what = "a rotation about a point of the handles' line";
            return Err(too_few_handles(what, start.len()));
        };
        let axis = (*first + *last) / 2.0 + rotation.center * (*last - *first) / 2.0;
        let distance = |p: &DVec3| (*p - axis).xz().length();
        let radius = start.iter().map(distance).fold(0.0, f64::max);
        // Closer than a nanometre the arc of any handle would be many turns.
        if !(radius.is_finite() && radius > 1e-9) {
            let expected = "such that a handle is away from the vertical axis there";
            let found = format!(
                "{} with the farthest handle {radius} m off",
                rotation.center
            );
            return Err(must(field, expected, found));
        }
        let sign = match rotation.sense {
            TurnSense::CounterClockwise => 1.0,
            TurnSense::Clockwise => -1.0,
        };
        Ok(Self {
            axis,
            angle_per_arc: sign / radius,
            arc,
        })
    }
}
