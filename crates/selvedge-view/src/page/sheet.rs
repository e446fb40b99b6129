//! Stills: one picture of a frame, or a contact sheet of moments, with one row of pictures per
//! panel under each other for every row of times.

use crate::motion::panel::check_panels;
use crate::page::layout::Page;
use crate::page::moments::moments;
use crate::raster::camera::Orbit;
use crate::raster::stage::Stage;
use crate::{Image, Panel, Renderer, Run, Supersampling, ViewError};

/// The choices of a contact sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetSettings {
    /// Width and height of one picture `[pixels]`.
    pub tile: [u32; 2],
    /// Pictures per row.
    pub columns: usize,
    /// Number of pictures; no more than the run has frames.
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

impl SheetSettings {
    fn validate(&self) -> Result<(), ViewError> {
        for (field, found) in [("columns", self.columns), ("pictures", self.pictures)] {
            if found == 0 || found > 10_000 {
                return Err(ViewError::Setting {
                    field,
                    expected: "between 1 and 10000",
                    found: found.to_string(),
                });
            }
        }
        Ok(())
    }
}

/// One frame of a panel, as large as it fits into a picture of `size` (width, height) `[pixels]`.
pub fn still(panel: &Panel<'_>, frame: usize, size: [u32; 2]) -> Result<Image, ViewError> {
    let aspect = aspect_of(size)?;
    let stages = Stage::following(&[panel.run], &[frame], &Orbit::default(), aspect)?;
    let mut renderer = Renderer::new(&stages[0], size, Supersampling::Four)?;
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
    settings.validate()?;
    check_panels(panels)?;
    let run = panels[0].run;
    let frames = moments(run, settings.pictures);
    let columns = settings.columns.min(frames.len());
    let rows = frames.len().div_ceil(columns) * panels.len();
    let page = Page::new(
        title,
        panels,
        settings.tile,
        [columns, rows].map(|n| n as u32),
    )?;
    let aspect = aspect_of(settings.tile)?;
    let stages = Stage::following(&runs_of(panels), &frames, &Orbit::default(), aspect)?;
    let mut image = page.draw()?;
    for (number, (&frame, stage)) in frames.iter().zip(&stages).enumerate() {
        let (column, block) = (number % columns, number / columns);
        let mut renderer = Renderer::new(stage, settings.tile, Supersampling::Four)?;
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
    use crate::Colouring;
    use glam::Vec3;
    use selvedge_cloth::Topology;

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
            run: &run,
            colouring: Colouring::Plain,
        });
        let settings = SheetSettings {
            tile: [60, 50],
            columns: 2,
            pictures: 3,
        };
        let sheet = contact_sheet("Title", &panels, &settings).unwrap();
        let page = Page::new("Title", &panels, settings.tile, [2, 4]).unwrap();
        let aspect = aspect_of(settings.tile).unwrap();
        let frames = [1, 3, 4];
        let stages = Stage::following(&[&run], &frames, &Orbit::default(), aspect).unwrap();
        // A quarter into each third of the way, frame 1, 3 and 4 is next: two rows of panels for the
        // first two, then two more.
        for (number, (column, rows)) in [(0, [0, 1]), (1, [0, 1]), (0, [2, 3])]
            .into_iter()
            .enumerate()
        {
            let mut renderer =
                Renderer::new(&stages[number], settings.tile, Supersampling::Four).unwrap();
            let picture = renderer.render(&panels[0], frames[number]).unwrap();
            for row in rows {
                let [left, top] = page.place(column, row);
                // The caption covers the lowest 20 rows at most.
                for (x, y) in (0..60).flat_map(|x| (0..30).map(move |y| (x, y))) {
                    assert_eq!(sheet.pixel(left + x, top + y), picture.pixel(x, y));
                }
            }
        }
        let message = contact_sheet(
            "",
            &panels,
            &SheetSettings {
                columns: 0,
                ..settings
            },
        )
        .unwrap_err()
        .to_string();
        assert_eq!(message, "columns must be between 1 and 10000, found 0");
    }
}
