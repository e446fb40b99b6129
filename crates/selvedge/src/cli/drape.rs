//! The calls of `selvedge drape`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::eval::MOST_THREADS;

/// Drape fabrics over a disc, as the drape test of textile laboratories does, and fit them.
///
/// A disc of 150 mm radius, clamped up to 90 mm, falls from flat and hangs over the rim. `selvedge
/// run drape` makes one such drape, and `selvedge info` of its trajectory has its measures.
#[derive(Debug, Subcommand)]
pub(crate) enum DrapeCommand {
    Test(DrapeTestArgs),
    Fit(DrapeFitArgs),
}

/// How drapes are made.
#[derive(Debug, Args)]
pub(crate) struct DrapedArgs {
    /// Vertices: 1720, 2250 and 3300 are edges of 10, 7 and 5 mm, beside the clamp of 5 mm.
    #[arg(long, value_name = "N", default_value = "1720", value_parser = clap::value_parser!(u32).range(100..=100_000))]
    pub(crate) vertices: u32,
    /// Drapes that are made at once [default: as many as there are processors].
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub(crate) jobs: Option<u16>,
}

/// Drape fabrics on meshes of several seeds, and give the means of their measures.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge drape test
  selvedge drape test gray-interlock my-fabric.toml --seeds 20 --vertices 3300")]
pub(crate) struct DrapeTestArgs {
    /// Fabrics: names or TOML files [default: all that ship].
    #[arg(value_name = "MATERIAL")]
    pub(crate) materials: Vec<String>,
    /// Drapes of each, on meshes of the seeds 1, 2 and so on.
    #[arg(long, value_name = "N", default_value = "10", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) seeds: u16,
    #[command(flatten)]
    pub(crate) draped: DrapedArgs,
}

/// Fit a fabric to measured drapes.
///
/// Bending stiffness along u, along v and along the bias and shear stiffness are searched for within
/// bounds, without derivatives. Every evaluation simulates a few drapes, a second each.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge drape fit drapes.csv --fabric 2 --density 0.192 -o blue-cotton.toml --specimens 1,5,9

The table has a line for each drape, with the columns fabric, sample, drape_coefficient, nodes, and
a2_mm to a8_mm, amplitudes of the harmonics of the shadow's radius; others are left alone.")]
pub(crate) struct DrapeFitArgs {
    /// The measured drapes (.csv).
    pub(crate) table: PathBuf,
    /// The fabric of the table.
    #[arg(long, value_name = "NAME")]
    pub(crate) fabric: String,
    /// Mass per area [kg/m²]. A drape shows stiffness over mass alone: where it is not known, any
    /// value serves.
    #[arg(long, value_name = "KG/M2")]
    pub(crate) density: f64,
    /// Specimens (column sample) that are fitted; the others are a check [default: all].
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) specimens: Vec<String>,
    /// The fabric's file (.toml).
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Drapes per evaluation, on meshes of the seeds 1, 2 and so on.
    #[arg(long, value_name = "N", default_value = "4", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) seeds: u16,
    /// Evaluations at most.
    #[arg(long, value_name = "N", default_value = "60", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) tries: u16,
    #[command(flatten)]
    pub(crate) draped: DrapedArgs,
}
