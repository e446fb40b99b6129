//! What a data set holds, how its numbers are distributed, and a
//! picture of every trajectory. Every file is read and checked against its hash.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::bail;
use selvedge_data::{Dataset, DatasetIndex, Distribution, Distributions, Split, write_atomically};
use selvedge_lab::{folder, generation};
use selvedge_view::Image;
use selvedge_view::plot::{HistogramPlot, histogram_page};
use serde::Serialize;

use crate::interrupt;
use crate::output::{Answer, Facts, Table, length};
use crate::pictures::{Show, write_sheet};
use crate::progress::Progress;

#[derive(Serialize)]
struct Contents<'a> {
    kind: &'static str,
    folder: &'a Path,
    #[serde(flatten)]
    index: &'a DatasetIndex,
    distributions: &'a Distributions,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pictures: Vec<PathBuf>,
}

const SPLITS: [(Split, &str); 2] = [(Split::Train, "train"), (Split::Test, "test")];

/// Says what a data set holds, after checking all its files; with `pictures`, a folder, also draws
/// its histograms and every trajectory.
pub(crate) fn run(folder: &Path, pictures: Option<&Path>) -> anyhow::Result<Answer> {
    let dataset = generation::open(folder)?;
    if let Some(out) = pictures {
        folder::check_kind(out, None)?;
        folder::make_folder(out)?;
    }
    let (distributions, mut drawn) = read_all(&dataset, pictures)?;
    if let Some(out) = pictures {
        let path = out.join("histograms.png");
        draw_histograms(&path, &dataset.index().name, &distributions)?;
        drawn.push(path);
    }
    let contents = Contents {
        kind: "dataset",
        folder,
        index: dataset.index(),
        distributions: &distributions,
        pictures: drawn,
    };
    let facts = facts(&dataset, &contents);
    let (motions, quantities) = (motions(&dataset), quantities(&distributions));
    let note = "heights are logarithmic; --picture FOLDER draws them with their axes";
    let text = format!("{facts}\n{motions}\n{quantities}{note}\n");
    Answer::new(text, &contents)
}

/// Reads every trajectory, which checks its hash, and draws it where that is wanted.
fn read_all(
    dataset: &Dataset,
    pictures: Option<&Path>,
) -> anyhow::Result<(Distributions, Vec<PathBuf>)> {
    let count = dataset.index().statistics.trajectories;
    let progress = Progress::new("reading", count, "trajectories");
    let mut distributions = Distributions::default();
    let mut drawn = Vec::new();
    for (split, name) in SPLITS {
        for entry in dataset.entries(split) {
            if interrupt::requested() {
                bail!("interrupted before every trajectory was read");
            }
            let trajectory = dataset.read(entry)?;
            distributions.add(&trajectory);
            if let Some(out) = pictures {
                let path = out.join(format!("{name}-{}.png", entry.motion));
                let show = Show {
                    title: &format!("{}: {} ({name})", dataset.index().name, entry.motion),
                    label: name,
                    prediction: &trajectory,
                    truth: None,
                };
                write_sheet(&path, &show)?;
                drawn.push(path);
            }
            progress.advance();
        }
    }
    Ok((distributions, drawn))
}

fn facts(dataset: &Dataset, contents: &Contents<'_>) -> Facts {
    let index = dataset.index();
    let mut facts = Facts::new();
    facts.add("kind", "data set");
    facts.add("name", &index.name);
    facts.add("folder", dataset.folder().display());
    let [train, test] = [Split::Train, Split::Test].map(|split| dataset.entries(split));
    let split = format!("{} to train on, {} to test on", train.len(), test.len());
    facts.add("trajectories", split);
    let frames: usize = train.iter().chain(test).map(|entry| entry.frames).sum();
    facts.add("frames", frames);
    facts.add("training frames", index.statistics.train_frames);
    facts.add("sections", index.sections.len());
    facts.add("samples", index.statistics.samples);
    facts.add("files", "complete, all hashes right");
    if let Some(last) = contents.pictures.last() {
        let count = contents.pictures.len();
        let folder = last.parent().unwrap_or(last).display();
        facts.add("pictures", format!("{count} in {folder}"));
    }
    facts
}

fn motions(dataset: &Dataset) -> Table {
    let headings = [
        "motion",
        "split",
        "frames",
        "vertices",
        "mean speed",
        "largest speed",
        "mean edge",
    ];
    let mut table = Table::new(headings);
    for (split, name) in SPLITS {
        for entry in dataset.entries(split) {
            table.row([
                entry.motion.clone(),
                name.to_owned(),
                entry.frames.to_string(),
                entry.vertices.to_string(),
                format!("{:.3} m/s", entry.mean_speed),
                format!("{:.3} m/s", entry.max_speed),
                length(entry.mean_edge_length),
            ]);
        }
    }
    table
}

/// The distributions as a table with small histograms.
fn quantities(distributions: &Distributions) -> Table {
    let headings = [
        "over all frames",
        "mean",
        "deviation",
        "least",
        "most",
        "unit",
    ];
    let mut table = Table::new(headings.into_iter().chain(["from", "histogram", "to"]));
    for (name, unit, distribution) in distributions.named() {
        let number = |value: f64| format!("{value:.3}");
        let histogram = &distribution.histogram;
        table.row([
            name.to_owned(),
            number(distribution.mean),
            number(distribution.deviation),
            number(distribution.least),
            number(distribution.most),
            unit.to_owned(),
            number(histogram.low),
            bars(distribution),
            number(histogram.high),
        ]);
    }
    table
}

/// One character per bin; an empty bin is a space.
fn bars(distribution: &Distribution) -> String {
    const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let counts = distribution.histogram.counts;
    let most = counts.iter().copied().max().unwrap_or(0);
    let scale = (1.0 + most as f64).ln();
    let bar = |&count: &u64| match count {
        0 => ' ',
        count => {
            let share = (1.0 + count as f64).ln() / scale;
            LEVELS[((share * LEVELS.len() as f64) as usize).min(LEVELS.len() - 1)]
        }
    };
    counts.iter().map(bar).collect()
}

/// The histograms of a data set, as a picture.
pub(crate) fn histograms(folder: &Path) -> anyhow::Result<Image> {
    let dataset = generation::open(folder)?;
    let (distributions, _) = read_all(&dataset, None)?;
    histograms_of(&dataset.index().name, &distributions)
}

fn draw_histograms(path: &Path, name: &str, distributions: &Distributions) -> anyhow::Result<()> {
    let png = histograms_of(name, distributions)?.to_png()?;
    Ok(write_atomically(path, |out| out.write_all(&png))?)
}

fn histograms_of(name: &str, distributions: &Distributions) -> anyhow::Result<Image> {
    let named = distributions.named();
    let plots: Vec<HistogramPlot<'_>> = named
        .iter()
        .map(|(name, unit, distribution)| HistogramPlot {
            title: name,
            unit,
            range: [distribution.histogram.low, distribution.histogram.high],
            counts: &distribution.histogram.counts,
        })
        .collect();
    Ok(histogram_page(name, &plots)?)
}
