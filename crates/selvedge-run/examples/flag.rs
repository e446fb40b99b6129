//! A flag in the wind, made in code: `cargo run --release -p selvedge-run --example flag`.

use selvedge::glam::DVec3;
use selvedge::parts::{Handles, Isotropic, Scene as Parts, generate::square};
use selvedge::{Run, Scene};

/// One square metre, held along one side.
#[allow(clippy::print_stdout, reason = "the result of the example")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let flag = square(150, 1.0, 1)?;
    let places = flag.mesh.positions().iter().zip(0..);
    let pole: Vec<u32> = places
        .filter(|(p, _)| p.z < -0.49)
        .map(|(_, v)| v)
        .collect();
    let nylon = Isotropic {
        youngs_modulus: 5e5,
        poissons_ratio: 0.3,
        thickness: 2e-4,
    };
    let handles = Handles::new(&pole, 150)?;
    let mut flag = Parts::of("flag", flag.mesh, handles, nylon.material("nylon", 0.1));
    flag.environment.wind = DVec3::new(3.0, 0.0, 6.0);
    let mut run = Run::new(&Scene::of(flag))?;
    for _ in 0..60 {
        run.step()?;
    }
    println!(
        "frame {}: the first vertex is at {} m",
        run.frame(),
        run.positions()[0]
    );
    Ok(())
}

#[test]
fn the_example_runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
