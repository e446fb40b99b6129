//! Frames of a trajectory as pictures: one (.png), a folder of them, or a clip (.gif).

use std::io::{self, Write};
use std::path::Path;

use anyhow::{Context, ensure};
use selvedge_data::{Trajectory, write_beside, write_folder_atomically};
use selvedge_lab::pictures::run_of_frames;
use selvedge_view::{
    ClipSettings, Image, Panel, Renderer, Rgb, Run, Stage, View, pictures_in, write_clip,
};

use crate::output::End;
use crate::progress::Progress;
use crate::{interrupt, place};

/// How frames are drawn.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Look {
    /// Width and height of a picture in pixels; the usual ones of its kind where none are said.
    pub(crate) size: Option<[u32; 2]>,
    pub(crate) view: View,
    /// The colour of the cloth; that of its fabric where none is said.
    pub(crate) colour: Option<Rgb>,
}

/// Width and height of a picture in pixels, where none are said; even, as encoders of films want it.
pub(crate) const SIZE: [u32; 2] = [960, 720];

/// Why pictures are not written after Ctrl-C.
const INTERRUPTED: &str = "interrupted";

/// Frames to be drawn.
pub(crate) struct Film<'a> {
    run: Run<'a>,
    title: String,
    look: Look,
}

/// What came of a film: where Ctrl-C was pressed, any failure is that interruption.
fn ended(result: anyhow::Result<()>) -> anyhow::Result<End> {
    match result {
        Ok(()) => Ok(End::Complete),
        Err(_) if interrupt::requested() => Ok(End::Interrupted),
        Err(error) => Err(error),
    }
}

impl<'a> Film<'a> {
    /// These frames of `trajectory`.
    pub(crate) fn new(
        trajectory: &'a Trajectory,
        frames: &[usize],
        look: Look,
    ) -> anyhow::Result<Self> {
        // One frame has no rate; any two have that of the first two.
        let step = frames.windows(2).map(|pair| pair[1] - pair[0]).next();
        let rate = trajectory.frame_rate() / step.unwrap_or(1) as f64;
        let mut run = run_of_frames(trajectory, frames, rate)?;
        if let Some(colour) = look.colour {
            run = run.in_colour(colour);
        }
        let name = trajectory.provenance().scene["name"].as_str();
        Ok(Self {
            run,
            title: name.unwrap_or_default().to_owned(),
            look,
        })
    }

    /// Writes the first frame.
    pub(crate) fn write_png(&self, path: &Path) -> anyhow::Result<()> {
        let mut renderer = self.renderer(4)?;
        let png = renderer.render(&Panel::of(&self.run), 0)?.to_png()?;
        place::write(path, &png)
    }

    /// Writes a folder with a picture per frame, as `cloth_0000.png`.
    pub(crate) fn write_pngs(&self, path: &Path) -> anyhow::Result<End> {
        let width = (self.run.frames().len() - 1).to_string().len().max(4);
        ended(write_folder_atomically(path, |folder| {
            self.draw_all(&mut |number, image| {
                let file = folder.join(format!("cloth_{number:0width$}.png"));
                let png = image.to_png()?;
                std::fs::write(&file, png).with_context(|| path.display().to_string())
            })
        }))
    }

    /// Writes a clip in real time.
    pub(crate) fn write_gif(&self, path: &Path) -> anyhow::Result<End> {
        let usual = ClipSettings::default();
        let settings = ClipSettings {
            view: self.look.view,
            tile: self.look.size.unwrap_or(usual.tile),
        };
        let pictures = pictures_in(self.run.frames().len(), self.run.frame_rate());
        let progress = Progress::new("drawing the clip", pictures, "pictures");
        let draw = |part: &Path| {
            let file = std::fs::File::create(part).context("the clip")?;
            let mut out = io::BufWriter::new(file);
            let panels = [Panel::of(&self.run)];
            let end = write_clip(&mut out, &self.title, &panels, &settings, &mut || {
                progress.step()
            });
            ensure!(end.context("the clip")?.is_continue(), INTERRUPTED);
            out.flush().context("the clip")
        };
        ended(write_beside(path, draw))
    }

    /// Draws every frame and gives it to `take`.
    fn draw_all(
        &self,
        take: &mut dyn FnMut(usize, &Image) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let frames = self.run.frames().len();
        let progress = Progress::new("drawing", frames, "pictures");
        let mut renderer = self.renderer(2)?;
        for number in 0..frames {
            let image = renderer.render(&Panel::of(&self.run), number);
            take(number, &image.context("a picture")?)?;
            progress.advance();
            ensure!(!interrupt::requested() || number + 1 == frames, INTERRUPTED);
        }
        Ok(())
    }

    fn renderer(&self, samples: u32) -> anyhow::Result<Renderer> {
        let size = self.look.size.unwrap_or(SIZE);
        let aspect = size[0] as f32 / size[1] as f32;
        let stage = Stage::of_runs(&[&self.run], self.look.view, aspect)?;
        Ok(Renderer::new(&stage, size, samples)?)
    }
}
