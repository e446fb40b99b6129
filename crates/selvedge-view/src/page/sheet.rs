//! Stills: one picture of a frame, or a contact sheet of evenly spaced frames, with one row of
//! pictures per panel under each other for every row of times.

use crate::motion::run::check_panels;
use crate::page::layout::Page;
use crate::raster::camera::Stage;
use crate::{EdgeLines, Image, Orbit, Panel, Renderer, Run, Supersampling, ViewError};

/// How one picture is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StillSettings {
    /// Width and height `[pixels]`.
    pub size: [u32; 2],
    /// Where it is seen from.
    pub orbit: Orbit,
    /// Samples per pixel.
    pub supersampling: Supersampling,
    /// Edges drawn over the cloth.
    pub lines: EdgeLines,
}

impl Default for StillSettings {
    fn default() -> Self {
        Self {
            size: [960, 720],
            orbit: Orbit::default(),
            supersampling: Supersampling::Four,
            lines: EdgeLines::All,
        }
    }
}

/// How a contact sheet is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetSettings {
    /// Width and height of one picture `[pixels]`.
    pub tile: [u32; 2],
    /// Pictures per row.
    pub columns: usize,
    /// How many frames, evenly spaced from the first to the last; no more than the run has.
    pub pictures: usize,
    /// Where they are seen from.
    pub orbit: Orbit,
    /// Samples per pixel.
    pub supersampling: Supersampling,
    /// Edges drawn over the cloth.
    pub lines: EdgeLines,
}

impl Default for SheetSettings {
    fn default() -> Self {
        Self {
            tile: [320, 320],
            columns: 4,
            pictures: 8,
            orbit: Orbit::default(),
            supersampling: Supersampling::Four,
            lines: EdgeLines::All,
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

/// One frame of a panel, seen by the camera that holds the whole run.
///
/// # Errors
/// [`ViewError::FrameOutOfRange`], or what is wrong with the panel or the settings.
pub fn still(
    panel: &Panel<'_>,
    frame: usize,
    settings: &StillSettings,
) -> Result<Image, ViewError> {
    let stage = stage(std::slice::from_ref(panel), &settings.orbit, settings.size)?;
    let mut renderer = Renderer::new(
        &stage,
        settings.size,
        settings.supersampling,
        settings.lines,
    )?;
    renderer.render(panel, frame)
}

/// Evenly spaced frames of one or several panels under a title (may be empty), each with its time.
/// Several panels stand under each other, and one camera holds them all.
///
/// # Errors
/// [`ViewError::NoPanels`], [`ViewError::PanelsDiffer`], or what is wrong with a panel or setting.
pub fn contact_sheet(
    title: &str,
    panels: &[Panel<'_>],
    settings: &SheetSettings,
) -> Result<Image, ViewError> {
    settings.validate()?;
    check_panels(panels)?;
    let run = panels[0].run;
    let frames = evenly_spaced(run.frames().len(), settings.pictures);
    let columns = settings.columns.min(frames.len());
    let rows = frames.len().div_ceil(columns) * panels.len();
    let page = Page::new(
        title,
        panels,
        settings.tile,
        [columns, rows].map(|n| n as u32),
    )?;
    let stage = stage(panels, &settings.orbit, settings.tile)?;
    let mut renderer = Renderer::new(
        &stage,
        settings.tile,
        settings.supersampling,
        settings.lines,
    )?;
    let mut image = page.draw()?;
    for (number, &frame) in frames.iter().enumerate() {
        let (column, block) = (number % columns, number / columns);
        for (line, panel) in panels.iter().enumerate() {
            let row = block * panels.len() + line;
            let place = page.place(column as u32, row as u32);
            let label = if column == 0 { panel.label } else { "" };
            let picture = renderer.render(panel, frame)?;
            page.put(&mut image, place, &picture, [label, &clock(run, frame)]);
        }
    }
    Ok(image)
}

/// The stage of all panels, in pictures of `size`.
pub(crate) fn stage(
    panels: &[Panel<'_>],
    orbit: &Orbit,
    size: [u32; 2],
) -> Result<Stage, ViewError> {
    crate::image::check_size("picture", size)?;
    let runs: Vec<&Run<'_>> = panels.iter().map(|panel| panel.run).collect();
    Stage::of_runs(&runs, orbit, size[0] as f32 / size[1] as f32)
}

/// The time of a frame, as a caption.
pub(crate) fn clock(run: &Run<'_>, frame: usize) -> String {
    format!("{:.2} s", run.time(frame))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Colouring;
    use glam::Vec3;
    use selvedge_cloth::Topology;

    #[test]
    fn frames_are_spread_from_the_first_to_the_last() {
        assert_eq!(evenly_spaced(61, 4), [0, 20, 40, 60]);
        assert_eq!(evenly_spaced(10, 4), [0, 3, 6, 9]);
        assert_eq!(evenly_spaced(3, 8), [0, 1, 2]);
        assert_eq!(evenly_spaced(9, 1), [0]);
    }

    #[test]
    fn a_sheet_holds_the_same_pictures_as_stills() {
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
            supersampling: Supersampling::One,
            ..SheetSettings::default()
        };
        let sheet = contact_sheet("Title", &panels, &settings).unwrap();
        let page = Page::new("Title", &panels, settings.tile, [2, 4]).unwrap();
        let one = StillSettings {
            size: settings.tile,
            orbit: settings.orbit,
            supersampling: settings.supersampling,
            lines: settings.lines,
        };
        // Frames 0, 3 and 5 (2.5 rounds up): two rows of panels for the first two, then two more.
        for (frame, column, rows) in [(0, 0, [0, 1]), (3, 1, [0, 1]), (5, 0, [2, 3])] {
            let picture = still(&panels[0], frame, &one).unwrap();
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
