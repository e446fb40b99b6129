//! Draws a waving sheet that nobody simulated: a still, a contact sheet, a comparison with an
//! invented error, and a clip, into a folder:
//! `cargo run --release -p selvedge-view --example gallery -- FOLDER`.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use glam::Vec3;
use selvedge_cloth::{Topology, VertexId};
use selvedge_view::{
    ClipSettings, Colouring, EdgeLines, Orbit, Panel, Renderer, Run, ScalarField, SheetSettings,
    Stage, StillSettings, Supersampling, contact_sheet, still, write_clip,
};

/// Vertices along a side.
const SIDE: usize = 32;
const FRAME_RATE: f64 = 60.0;

/// A square metre in the yz-plane that hangs by its two upper corners and sways.
fn sheet(time: f32, wildness: f32) -> Vec<Vec3> {
    let sway = 0.5 * (1.0 - (1.05 * time).cos());
    (0..SIDE * SIDE)
        .map(|vertex| {
            let u = (vertex % SIDE) as f32 / (SIDE - 1) as f32;
            let v = (vertex / SIDE) as f32 / (SIDE - 1) as f32;
            let lag = 1.4 * time - 1.1 * v;
            let fold = (6.5 * u + 2.2 * v + 0.8 * lag.sin()).sin();
            let belly = (std::f32::consts::PI * u).sin();
            let depth = v * (0.10 * fold + 0.16 * lag.sin() * (0.4 + belly)) * wildness;
            let sag = 0.16 * belly * (1.0 - 0.55 * v);
            let across = (u - 0.5) * (0.94 - 0.10 * v * (1.0 + 0.5 * lag.cos()));
            let curl = 0.22 * v * v * v * (1.7 * time - 3.0 * u).sin() * u;
            Vec3::new(
                depth + curl,
                1.0 - v * (0.97 - 0.5 * curl.abs()) - sag,
                across + sway - 0.06 * v * v * (1.05 * time).sin(),
            )
        })
        .collect()
}

fn faces() -> Vec<[u32; 3]> {
    let mut faces = Vec::new();
    for row in 0..SIDE - 1 {
        for column in 0..SIDE - 1 {
            let corner = (row * SIDE + column) as u32;
            let (right, below) = (corner + 1, corner + SIDE as u32);
            // Alternating diagonals.
            if (row + column) % 2 == 0 {
                faces.push([corner, below, right]);
                faces.push([right, below, below + 1]);
            } else {
                faces.push([corner, below + 1, right]);
                faces.push([corner, below, below + 1]);
            }
        }
    }
    faces
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(
        std::env::args()
            .nth(1)
            .ok_or("name a folder to write into")?,
    );
    std::fs::create_dir_all(&folder)?;
    let topology = Topology::new(SIDE * SIDE, &faces())?;
    let handles = [VertexId(0), VertexId(SIDE as u32 - 1)];
    let motion = |wildness: f32| -> Vec<Vec<Vec3>> {
        (0..=360)
            .map(|frame| sheet(frame as f32 / FRAME_RATE as f32, wildness))
            .collect()
    };
    let (truth, prediction) = (motion(1.0), motion(1.12));
    let run = |frames| -> Result<Run<'_>, selvedge_view::ViewError> {
        let frames: &Vec<Vec<Vec3>> = frames;
        Run::new(
            &topology,
            frames.iter().map(Vec::as_slice),
            &handles,
            FRAME_RATE,
        )
    };
    let (truth, prediction) = (run(&truth)?, run(&prediction)?);
    let error = ScalarField::distance(&truth, &prediction)?;
    let panel = |label, run, colouring| Panel {
        label,
        run,
        colouring,
    };
    let first = panel("ground truth", &truth, Colouring::Plain);
    let second = panel("prediction", &prediction, Colouring::Plain);
    let third = panel("error", &prediction, Colouring::PerVertex(&error));

    let picture = still(&first, 150, &StillSettings::default())?;
    std::fs::write(folder.join("still.png"), picture.to_png()?)?;
    let sheet = contact_sheet("A waving sheet", &[first], &SheetSettings::default())?;
    std::fs::write(folder.join("sheet.png"), sheet.to_png()?)?;
    let settings = SheetSettings {
        tile: [240, 240],
        columns: 6,
        pictures: 6,
        ..SheetSettings::default()
    };
    let sheet = contact_sheet("Truth and prediction", &[first, second, third], &settings)?;
    std::fs::write(folder.join("comparison.png"), sheet.to_png()?)?;

    let start = Instant::now();
    let mut clip = Vec::new();
    write_clip(
        &mut clip,
        "Truth and prediction",
        &[first, second],
        &ClipSettings::default(),
        &mut |_| ControlFlow::Continue(()),
    )?;
    eprintln!("clip: {} bytes in {:.1?}", clip.len(), start.elapsed());
    std::fs::write(folder.join("clip.gif"), clip)?;
    time_frames(&first)?;
    Ok(())
}

/// Times pictures of 640 × 480 with each number of samples.
fn time_frames(panel: &Panel<'_>) -> Result<(), selvedge_view::ViewError> {
    let stage = Stage::of_runs(&[panel.run], &Orbit::default(), 4.0 / 3.0)?;
    for sampling in [Supersampling::One, Supersampling::Two, Supersampling::Four] {
        let mut renderer = Renderer::new(&stage, [640, 480], sampling, EdgeLines::All)?;
        let frames = panel.run.frames().len();
        let start = Instant::now();
        for frame in 0..frames {
            renderer.render(panel, frame)?;
        }
        let each = start.elapsed().as_secs_f64() / frames as f64;
        eprintln!(
            "640 x 480, samples {sampling:?}: {:.2} ms per picture",
            1e3 * each
        );
    }
    Ok(())
}
