//! Clips: one or several panels side by side as an animated GIF whose clock is that of the run.
//!
//! GIF counts time in 10 ms. Picture k shows the frame nearest to k times the delay, whatever the
//! frame rate of the run, so that a second of cloth lasts a second. One palette serves all
//! pictures; after the first, a picture holds only the rectangle in which something changed, and
//! in it only the pixels that did.

use std::io::Write;
use std::ops::ControlFlow;

use crate::motion::panel::check_panels;
use crate::page::layout::Page;
use crate::page::palette::{Palette, UNCHANGED, distance_squared};
use crate::page::sheet::{aspect_of, clock, runs_of};
use crate::raster::camera::View;
use crate::raster::stage::Stage;
use crate::{Image, Panel, Renderer, Run, ViewError};

/// The choices of a clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipSettings {
    /// Width and height of one panel `[pixels]`.
    pub tile: [u32; 2],
    /// The direction from which it is taken.
    pub view: View,
}

impl Default for ClipSettings {
    fn default() -> Self {
        Self {
            tile: [320, 320],
            view: View::default(),
        }
    }
}

/// Time between two pictures `[ms]`: a multiple of 10, and not under 20, as viewers slow down what is
/// faster.
const DELAY_MS: u16 = 50;
/// Pictures that the palette is chosen from.
const PALETTE_SAMPLES: usize = 8;
/// A pixel that is nearer than this to what is shown stays: two or three levels per channel, which
/// the eye does not see and which would double the file.
const TOLERANCE: u32 = 40;
/// Pictures of a clip at most: fourteen hours.
const MOST_PICTURES: usize = 1_000_000;

/// Writes `panels` side by side under a title (may be empty) as a GIF that repeats for ever. After
/// each picture `progress` is called, and may stop: the file is whole either way, and what is
/// returned says whether it was stopped.
pub fn write_clip(
    out: &mut dyn Write,
    title: &str,
    panels: &[Panel<'_>],
    settings: &ClipSettings,
    progress: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<ControlFlow<()>, ViewError> {
    check_panels(panels)?;
    let frames = frames_at(panels[0].run)?;
    let mut studio = Studio::new(title, panels, settings)?;
    let palette = studio.palette(&frames)?;
    let [width, height] = studio.size();
    let mut recorder = Recorder {
        encoder: gif::Encoder::new(out, width, height, &palette.table())?,
        palette,
        shown: vec![UNCHANGED; usize::from(width) * usize::from(height)],
        size: [width, height].map(usize::from),
        delay: DELAY_MS / 10,
    };
    recorder.encoder.set_repeat(gif::Repeat::Infinite)?;
    let mut end = ControlFlow::Continue(());
    for (number, &frame) in frames.iter().enumerate() {
        recorder.write(&studio.picture(frame)?)?;
        if progress().is_break() && number + 1 < frames.len() {
            end = ControlFlow::Break(());
            break;
        }
    }
    recorder.encoder.into_inner()?;
    Ok(end)
}

/// The frame nearest to each multiple of the delay, to the end of the run.
///
/// # Errors
/// More pictures than can be drawn.
fn frames_at(run: &Run<'_>) -> Result<Vec<usize>, ViewError> {
    let (frames, rate) = (run.frames().len(), run.frame_rate());
    let count = pictures_in(frames, rate);
    if count > MOST_PICTURES {
        let expected = "of at most 1000000 pictures (mend the frame rate)";
        let found = format!("{frames} frames at {rate:e} frames per second");
        return Err(ViewError::setting("the clip", expected, found));
    }
    let nearest = |k: usize| (k as f64 * frames_per_picture(rate)).round() as usize;
    Ok((0..count).map(|k| nearest(k).min(frames - 1)).collect())
}

/// Number of pictures of a clip of so many `frames`, `frame_rate` `[1/s]`.
pub fn pictures_in(frames: usize, frame_rate: f64) -> usize {
    let delays = frames.saturating_sub(1) as f64 / frames_per_picture(frame_rate);
    // Half a thousandth of a picture: 3 s at 50 ms must not lose its last one to rounding.
    ((delays + 5e-4) as usize).saturating_add(1)
}

fn frames_per_picture(frame_rate: f64) -> f64 {
    f64::from(DELAY_MS) * 1e-3 * frame_rate
}

/// Makes the pictures of a clip.
struct Studio<'a> {
    panels: &'a [Panel<'a>],
    page: Page<'a>,
    blank: Image,
    renderer: Renderer,
}

impl<'a> Studio<'a> {
    fn new(
        title: &'a str,
        panels: &'a [Panel<'a>],
        settings: &ClipSettings,
    ) -> Result<Self, ViewError> {
        let page = Page::new(title, panels, settings.tile, [panels.len() as u32, 1])?;
        let aspect = aspect_of(settings.tile)?;
        let stage = Stage::of_runs(&runs_of(panels), settings.view, aspect)?;
        Ok(Self {
            panels,
            blank: page.draw()?,
            page,
            renderer: Renderer::new(&stage, settings.tile, 2)?,
        })
    }

    fn size(&self) -> [u16; 2] {
        // The page has checked that it fits.
        [self.blank.width(), self.blank.height()].map(|side| side as u16)
    }

    fn picture(&mut self, frame: usize) -> Result<Image, ViewError> {
        let mut image = self.blank.clone();
        for (column, panel) in self.panels.iter().enumerate() {
            let picture = self.renderer.render(panel, frame)?;
            let place = self.page.place(column as u32, 0);
            let time = clock(panel.run, frame);
            self.page
                .put(&mut image, place, &picture, panel.label, &time);
        }
        Ok(image)
    }

    fn palette(&mut self, frames: &[usize]) -> Result<Palette, ViewError> {
        let step = frames.len().div_ceil(PALETTE_SAMPLES);
        let samples: Result<Vec<Image>, ViewError> = frames
            .iter()
            .step_by(step)
            .map(|&frame| self.picture(frame))
            .collect();
        Ok(Palette::of_images(&samples?))
    }
}

/// Writes pictures as changes of what is shown.
struct Recorder<'a> {
    encoder: gif::Encoder<&'a mut dyn Write>,
    palette: Palette,
    /// Palette numbers on the screen, row by row.
    shown: Vec<u8>,
    size: [usize; 2],
    delay: u16,
}

impl Recorder<'_> {
    fn write(&mut self, picture: &Image) -> Result<(), ViewError> {
        let mut changes = vec![UNCHANGED; self.shown.len()];
        for (at, &colour) in picture.pixels().iter().enumerate() {
            let number = self.palette.number(colour);
            let shown = self.shown[at];
            let near = shown == number
                || self
                    .palette
                    .colour(shown)
                    .is_some_and(|there| distance_squared(there, colour) <= TOLERANCE);
            if !near {
                changes[at] = number;
                self.shown[at] = number;
            }
        }
        let [columns, rows] = changed_rectangle(&changes, self.size[0]);
        let cut: Vec<u8> = rows
            .clone()
            .flat_map(|row| {
                let line = row * self.size[0];
                changes[line + columns.start..line + columns.end]
                    .iter()
                    .copied()
            })
            .collect();
        self.encoder.write_frame(&gif::Frame {
            delay: self.delay,
            dispose: gif::DisposalMethod::Keep,
            transparent: Some(UNCHANGED),
            left: columns.start as u16,
            top: rows.start as u16,
            width: columns.len() as u16,
            height: rows.len() as u16,
            buffer: cut.into(),
            ..gif::Frame::default()
        })?;
        Ok(())
    }
}

/// The columns and rows that hold every change; one pixel when there is none, for a picture of no
/// size is not a GIF.
fn changed_rectangle(changes: &[u8], width: usize) -> [std::ops::Range<usize>; 2] {
    let (mut left, mut right, mut top, mut bottom) = (usize::MAX, 0, usize::MAX, 0);
    for (row, line) in changes.chunks(width).enumerate() {
        let first = line.iter().position(|&change| change != UNCHANGED);
        let last = line.iter().rposition(|&change| change != UNCHANGED);
        if let (Some(first), Some(last)) = (first, last) {
            (left, right) = (left.min(first), right.max(last + 1));
            (top, bottom) = (top.min(row), row + 1);
        }
    }
    if left < right { [left..right, top..bottom] } else { [0..1, 0..1] }
}

#[cfg(test)]
mod tests;
