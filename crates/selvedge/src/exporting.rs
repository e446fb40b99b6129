//! Trajectories as files of other programs: which format a name asks for, checked before any work,
//! and the work. Numbers are written by `selvedge-data`, pictures are drawn here ([`crate::film`]).

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use selvedge_data::export::{
    ExportFormat, ExportOptions, FrameSpan, check_free, export, files_beside, planned_bytes,
};
use selvedge_data::{Trajectory, UpAxis, ending_of};

use crate::cli::FormatName;
use crate::failure::wrong;
use crate::film::{Film, Look};
use crate::output::End;
use crate::place;
use crate::progress::Progress;

/// A .glb of more bytes than this is better something else.
const HEAVY: u64 = 500_000_000;

/// A file or folder to be written.
#[derive(Debug)]
pub(crate) struct Export {
    path: PathBuf,
    format: FormatName,
    /// True for a folder with a file per frame.
    is_folder: bool,
    choice: Choice,
}

/// The choices of an export.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Choice {
    pub(crate) frames: FrameSpan,
    /// The axis that points up.
    pub(crate) up: UpAxis,
    /// The choice of normals; none takes what the format has.
    pub(crate) normals: Option<bool>,
    /// The choice of velocities; none takes what the format has.
    pub(crate) velocities: Option<bool>,
    /// How pictures are drawn.
    pub(crate) look: Look,
    /// The name of an option that is for pictures alone, where one was given.
    pub(crate) of_pictures: Option<&'static str>,
}

impl Export {
    /// All frames to `path`, in the `format` that is named or else as the name ends; what is in the
    /// way shows now.
    ///
    /// # Errors
    /// Wrong usage for a name that says no format; otherwise what is in the way.
    pub(crate) fn new(path: &Path, format: Option<FormatName>) -> anyhow::Result<Self> {
        let ending = ending_of(path);
        let named = FormatName::from_str(&ending, false).ok();
        let Some(format) = format.or(named) else {
            return Err(wrong(format!(
                "{}: the name must end in .usdc, .usdz, .abc, .glb, .pc2, .npz, .obj, .png or .gif; for a folder of frames say --format obj or --format png, of which ffmpeg makes films",
                path.display()
            )));
        };
        let is_cache = format == FormatName::Pc2;
        if is_cache && ending == "obj" {
            return Err(wrong(format!(
                "{}: a point cache gets its mesh beside it, as .obj of the same name, which would take its place: let the name end in .pc2",
                path.display()
            )));
        }
        if is_cache {
            check_free(&path.with_extension("obj"))?;
        }
        let is_folder = named != Some(format);
        if is_folder && matches!(format, FormatName::Obj | FormatName::Png) {
            place::check_new_folder(path)?
        } else {
            place::check_new_file(path)?
        }
        Ok(Self {
            path: path.to_owned(),
            format,
            is_folder,
            choice: Choice::default(),
        })
    }

    /// The same with what was chosen.
    pub(crate) fn with(self, choice: Choice) -> Self {
        Self { choice, ..self }
    }

    /// The format of numbers; none of pictures.
    fn numbers(&self) -> Option<ExportFormat> {
        if self.is_folder && self.format == FormatName::Obj {
            return Some(ExportFormat::ObjSequence);
        }
        let name = self.format.to_possible_value()?;
        ExportOptions::of_ending(name.get_name()).map(|usual| usual.format)
    }

    /// True for a file that holds one frame.
    fn holds_one_frame(&self) -> bool {
        matches!(self.format, FormatName::Obj | FormatName::Png) && !self.is_folder
    }

    /// Checks what was asked for against a run of `frames`.
    ///
    /// # Errors
    /// Wrong usage for frames that there are not, and for what the format does not have.
    pub(crate) fn check(&self, frames: usize) -> anyhow::Result<()> {
        let wrong = |problem: String| Err(wrong(problem));
        let count = match self.choice.frames.of(frames) {
            Ok(frames) => frames.len(),
            Err(error) => return wrong(format!("--frames: {error}")),
        };
        if self.holds_one_frame() && count > 1 {
            return wrong(format!(
                "{}: such a file holds one frame, and {count} were asked for: choose one with --frames, or name a folder with --format",
                self.path.display()
            ));
        }
        if let (Some(_), Some(option)) = (self.numbers(), self.choice.of_pictures) {
            return wrong(format!(
                "{option}: is for pictures and clips (.png, .gif), and {} is none",
                self.path.display()
            ));
        }
        let Choice {
            up,
            normals,
            velocities,
            ..
        } = self.choice;
        match self.numbers() {
            Some(ExportFormat::Glb) if up == UpAxis::Z => {
                wrong("--up z: glTF has y up, and every reader turns it".to_owned())
            }
            Some(format) if !format.has_velocities() && velocities == Some(true) => wrong(format!(
                "--velocities: {} has none; USD and Alembic have them",
                self.path.display()
            )),
            Some(_) => Ok(()),
            None if up == UpAxis::Z => wrong("--up z: a picture has no axes".to_owned()),
            None if normals.is_some() => wrong("--normals: a picture has none".to_owned()),
            None if velocities.is_some() => wrong("--velocities: a picture has none".to_owned()),
            None => Ok(()),
        }
    }

    /// The number of frames that are written of a run of `frames`.
    pub(crate) fn count(&self, frames: usize) -> anyhow::Result<usize> {
        Ok(self.choice.frames.of(frames)?.len())
    }

    /// All that is written of `trajectory`, with the obstacles beside it.
    pub(crate) fn outputs_of(&self, trajectory: &Trajectory) -> Vec<PathBuf> {
        let beside = self.numbers();
        let beside = beside.map(|format| files_beside(trajectory, format, &self.path));
        let beside = beside.unwrap_or_default();
        std::iter::once(self.path.clone()).chain(beside).collect()
    }

    /// All that is written whatever the trajectory has beside its cloth.
    pub(crate) fn outputs(&self) -> Vec<PathBuf> {
        let mut outputs = vec![self.path.clone()];
        if self.format == FormatName::Pc2 {
            outputs.push(self.path.with_extension("obj"));
        }
        outputs
    }

    /// Writes it.
    ///
    /// # Errors
    /// What cannot be written, and why; nothing is then left behind.
    pub(crate) fn write(&self, trajectory: &Trajectory) -> anyhow::Result<End> {
        self.check(trajectory.frame_count())?;
        let frames = self.choice.frames.of(trajectory.frame_count())?;
        if let Some(format) = self.numbers() {
            return self.write_numbers(trajectory, format, frames.len());
        }
        let film = Film::new(trajectory, &frames, self.choice.look)?;
        match self.format {
            FormatName::Gif => film.write_gif(&self.path),
            _ if self.is_folder => film.write_pngs(&self.path),
            _ => {
                film.write_png(&self.path)?;
                Ok(End::Complete)
            }
        }
    }

    fn write_numbers(
        &self,
        trajectory: &Trajectory,
        format: ExportFormat,
        frames: usize,
    ) -> anyhow::Result<End> {
        let usual = ExportOptions::usual(format);
        let options = ExportOptions {
            format,
            frames: self.choice.frames,
            up: self.choice.up,
            normals: self.choice.normals.unwrap_or(usual.normals),
            velocities: self.choice.velocities.unwrap_or(usual.velocities),
        };
        if let Some(bytes) = planned_bytes(trajectory, &options)?
            && bytes > HEAVY
        {
            tracing::warn!(
                "{}: {:.1} GB, a morph target for each of {frames} frames: --every, .abc or .pc2 are lighter",
                self.path.display(),
                bytes as f64 / 1e9
            );
        }
        let what = format!("writing {}", self.path.display());
        let progress = Progress::new(what, frames, "frames");
        let is_complete = export(trajectory, &self.path, &options, &mut || progress.step())?;
        Ok(if is_complete { End::Complete } else { End::Interrupted })
    }
}

/// Returns the exports that `--export` asks for, each checked.
pub(crate) fn exports(paths: &[PathBuf]) -> anyhow::Result<Vec<Export>> {
    let export = |path: &PathBuf| {
        let export = Export::new(path, None)?;
        if export.holds_one_frame() {
            return Err(wrong(format!(
                "--export {}: such a file holds one frame: take `selvedge export`, which can choose one",
                path.display()
            )));
        }
        Ok(export)
    };
    paths.iter().map(export).collect()
}

/// All that the exports write, for [`place::check_outputs`].
pub(crate) fn outputs(exports: &[Export]) -> Vec<PathBuf> {
    exports.iter().flat_map(Export::outputs).collect()
}

/// Writes each export of a run that ended so, and says where; nothing after an interruption, which is
/// said.
pub(crate) fn write(
    exports: &[Export],
    trajectory: &Trajectory,
    mut end: End,
    wrote: &mut Vec<PathBuf>,
) -> anyhow::Result<End> {
    for export in exports {
        if end == End::Complete {
            end = export.write(trajectory)?;
        }
        match end {
            End::Complete => wrote.extend(export.outputs_of(trajectory)),
            End::Interrupted => {
                tracing::warn!("interrupted: {} was not written", export.path.display())
            }
        }
    }
    Ok(end)
}

/// Bytes of a file, or of all files in a folder.
pub(crate) fn size_of(path: &Path) -> u64 {
    let Ok(entries) = std::fs::read_dir(path) else {
        return std::fs::metadata(path).map_or(0, |found| found.len());
    };
    let found = entries.filter_map(|entry| entry.ok()?.metadata().ok());
    found.map(|found| found.len()).sum()
}

/// Bytes as people read them.
pub(crate) fn bytes(count: u64) -> String {
    match count {
        0..1_000 => format!("{count} bytes"),
        1_000..1_000_000 => format!("{:.1} kB", count as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", count as f64 / 1e6),
        _ => format!("{:.2} GB", count as f64 / 1e9),
    }
}
