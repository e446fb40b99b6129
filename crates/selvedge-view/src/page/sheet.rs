//! Stills: one picture of a frame, or a contact sheet of moments, with one row of pictures per
//! panel under each other for every row of times.

use crate::motion::panel::check_panels;
use crate::page::layout::Page;
use crate::raster::camera::View;
use crate::raster::stage::Stage;
use crate::{Image, Panel, Renderer, Run, ViewError};

/// The choices of a contact sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetSettings {
    /// Width and height of one picture `[pixels]`.
    pub tile: [u32; 2],
    /// Pictures per row; at least one.
    pub columns: usize,
    /// Number of pictures; at least one, and no more than the run has frames.
    pub pictures: usize,
}

impl Default for SheetSettings {
    fn default() -> Self {
        Self {
            tile: [320, 320],
            columns: 4,
            pictures: 8,
        }
    }
}

/// One frame of a panel, as large as it fits into a picture of `size` (width, height) `[pixels]`.
pub fn still(panel: &Panel<'_>, frame: usize, size: [u32; 2]) -> Result<Image, ViewError> {
    let aspect = aspect_of(size)?;
    let stages = Stage::following(&[panel.run], &[frame], View::default(), aspect)?;
    let mut renderer = Renderer::new(&stages[0], size, 4)?;
    renderer.render(panel, frame)
}

/// Moments of one or several panels under a title (may be empty), each with its time. Several
/// panels stand under each other. The camera goes along with the cloth, equally far from each
/// moment, and takes the same place for all panels.
pub fn contact_sheet(
    title: &str,
    panels: &[Panel<'_>],
    settings: &SheetSettings,
) -> Result<Image, ViewError> {
    check_panels(panels)?;
    let run = panels[0].run;
    let frames = evenly_spaced(run.frames().len(), settings.pictures.max(1));
    let columns = settings.columns.clamp(1, frames.len());
    let rows = frames.len().div_ceil(columns) * panels.len();
    let page = Page::new(
        title,
        panels,
        settings.tile,
        [columns, rows].map(|n| n as u32),
    )?;
    let aspect = aspect_of(settings.tile)?;
    let stages = Stage::following(&runs_of(panels), &frames, View::default(), aspect)?;
    let mut image = page.draw()?;
    for (number, (&frame, stage)) in frames.iter().zip(&stages).enumerate() {
        let (column, block) = (number % columns, number / columns);
        let mut renderer = Renderer::new(stage, settings.tile, 4)?;
        for (line, panel) in panels.iter().enumerate() {
            let row = block * panels.len() + line;
            let place = page.place(column as u32, row as u32);
            let label = if column == 0 { panel.label } else { "" };
            let picture = renderer.render(panel, frame)?;
            page.put(&mut image, place, &picture, label, &clock(run, frame));
        }
    }
    Ok(image)
}

/// `count` numbers from 0 to `frames` - 1, evenly spaced; all of them when there are fewer.
fn evenly_spaced(frames: usize, count: usize) -> Vec<usize> {
    let count = count.min(frames);
    let steps = (count - 1).max(1);
    // Rounded to the nearest frame, in whole numbers.
    (0..count)
        .map(|k| (2 * k * (frames - 1) + steps) / (2 * steps))
        .collect()
}

pub(crate) fn runs_of<'a>(panels: &[Panel<'a>]) -> Vec<&'a Run<'a>> {
    panels.iter().map(|panel| panel.run).collect()
}

/// Width over height of a picture of `size`.
pub(crate) fn aspect_of(size: [u32; 2]) -> Result<f32, ViewError> {
    crate::image::check_size("picture", size)?;
    Ok(size[0] as f32 / size[1] as f32)
}

/// The time of a frame, as a caption.
pub(crate) fn clock(run: &Run<'_>, frame: usize) -> String {
    format!("{:.2} s", run.time(frame))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use selvedge_cloth::Topology;

    #[test]
    fn moments_are_spread_from_the_first_frame_to_the_last() {
        assert_eq!(evenly_spaced(61, 4), [0, 20, 40, 60]);
        assert_eq!(evenly_spaced(10, 4), [0, 3, 6, 9]);
        assert_eq!(evenly_spaced(3, 8), [0, 1, 2]);
        assert_eq!(evenly_spaced(9, 1), [0]);
    }

    #[test]
    fn a_sheet_holds_the_pictures_of_its_moments() {
        let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
        let frames: Vec<[Vec3; 3]> = (0..6)
            .map(|k| [Vec3::ZERO, Vec3::Y, Vec3::Z].map(|p| p + 0.1 * k as f32 * Vec3::Z))
            .collect();
        let slices = frames.iter().map(<[Vec3; 3]>::as_slice);
        let run = Run::new(&topology, slices, &[], 60.0).unwrap();
        let panels = ["truth", "prediction"].map(|label| Panel {
            label,
            ..Panel::of(&run)
        });
        let settings = SheetSettings {
            tile: [60, 50],
            columns: 2,
            pictures: 3,
        };
        let sheet = contact_sheet("Title", &panels, &settings).unwrap();
        let page = Page::new("Title", &panels, settings.tile, [2, 4]).unwrap();
        let aspect = aspect_of(settings.tile).unwrap();
        let frames = [0, 3, 5];
        let stages = Stage::following(&[&run], &frames, View::default(), aspect).unwrap();
        // The middle of frames 0 to 5 is rounded up. Two rows of panels for the first two, then two
        // more.
        for (number, (column, rows)) in [(0, [0, 1]), (1, [0, 1]), (0, [2, 3])]
            .into_iter()
            .enumerate()
        {
            let mut renderer = Renderer::new(&stages[number], settings.tile, 4).unwrap();
            let picture = renderer.render(&panels[0], frames[number]).unwrap();
            for row in rows {
                let [left, top] = page.place(column, row);
                // The caption covers the lowest 20 rows at most.
                for (x, y) in (0..60).flat_map(|x| (0..30).map(move |y| (x, y))) {
                    assert_eq!(sheet.pixel(left + x, top + y), picture.pixel(x, y));
                }
            }
        }
        let lone = SheetSettings {
            columns: 0,
            pictures: 0,
            ..settings
        };
        assert_eq!(contact_sheet("", &panels, &lone).unwrap().width(), 84);
    }
}
