//! Moves a sheet by one of the peers in Rust: `rapier-peers METHOD SCENE SUBSTEPS FRAMES OUTPUT`,
//! as `common.py` has it for the others. METHOD is `constraints`, `fem`, `xpbd` or `implicit`.

mod cloth_core;
mod scene;
mod soft_bodies;

use std::fs;

use anyhow::{Context, Result, bail, ensure};
use cpu_time::ProcessTime;

use crate::scene::Scene;

/// What moves a sheet by a frame.
trait Mover {
    /// Moves by 1/60 s and returns the positions, m.
    fn frame(&mut self) -> Result<Vec<[f32; 3]>>;
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [method, scene, substeps, frames, output] = words.as_slice() else {
        bail!("usage: rapier-peers METHOD SCENE SUBSTEPS FRAMES OUTPUT");
    };
    let (substeps, frames): (usize, usize) = (substeps.parse()?, frames.parse()?);
    let scene: Scene = serde_json::from_str(&fs::read_to_string(scene).context("the scene")?)?;
    let mut mover: Box<dyn Mover> = match method.as_str() {
        "constraints" | "fem" => {
            Box::new(soft_bodies::Sheet::new(&scene, substeps, method == "fem"))
        }
        "xpbd" | "implicit" => Box::new(cloth_core::Sheet::new(
            &scene,
            substeps,
            method == "implicit",
        )?),
        _ => bail!("there is no method {method}"),
    };
    let mut motion = vec![
        scene
            .positions
            .iter()
            .map(|p| p.map(|x| x as f32))
            .collect(),
    ];
    let mut seconds = 0.0;
    for frame in 1..=frames {
        let began = ProcessTime::now();
        let positions = mover.frame().with_context(|| format!("frame {frame}"))?;
        seconds += began.elapsed().as_secs_f64();
        ensure!(
            positions.iter().flatten().all(|x| x.is_finite()),
            "frame {frame} is not finite"
        );
        motion.push(positions);
    }
    let bytes = motion.iter().flatten().flatten();
    fs::write(
        output,
        bytes.flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>(),
    )?;
    println!("{seconds}");
    Ok(())
}
