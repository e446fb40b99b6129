//! Times a frame with and without contact: a sheet that hangs and swings without it, with contact
//! where nothing touches, draped over a ball, and crumpled on the ground. Counts what was done.
//!
//! `cargo run --release -p selvedge-sim --example contact_times -- [VERTICES] [THREADS]`
#![allow(clippy::print_stdout, reason = "an example that prints its result")]

use std::time::{Duration, Instant};

use glam::DVec3;
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{
    ContactSettings, Environment, HandleSchedule, HandleTargets, Handles, Material, Mesh, Motion,
    Obstacle, PhysicsSettings, SagSettings, Scene, Stepper,
};
use selvedge_sim::{ContactCounts, Simulator, Threads};

/// Anything that can go wrong.
type Failure = Box<dyn std::error::Error + Send + Sync>;

const GRAY: &str = selvedge_assets::materials::GRAY_INTERLOCK;
/// Frames that are timed.
const FRAMES: u32 = 60;

fn main() -> Result<(), Failure> {
    let mut numbers = std::env::args()
        .skip(1)
        .map(|number| number.parse::<usize>());
    let vertices = numbers.next().transpose()?.unwrap_or(1024);
    let threads = numbers.next().transpose()?.unwrap_or(1);
    println!("{vertices} vertices, {threads} threads, {FRAMES} frames each");
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()?;
    pool.install(|| -> Result<(), Failure> {
        let contact = Some(ContactSettings::default());
        let hanging = scene(vertices, true)?;
        let touching = Scene {
            contact,
            ..hanging.clone()
        };
        let draped = Scene {
            contact,
            obstacles: vec![sphere(DVec3::new(0.0, -0.35, 0.0), 0.3)?],
            ..scene(vertices, false)?
        };
        let fallen = Scene {
            contact,
            obstacles: vec![ground(-1.05)?],
            handles: Handles::new(&[], vertices)?,
            ..hanging.clone()
        };
        time("without contact", &hanging, 30)?;
        time("contact, nothing touches", &touching, 30)?;
        time("draping over a ball", &draped, 20)?;
        time("draped and at rest", &draped, 180)?;
        time("falling into folds", &fallen, 10)?;
        time("crumpled", &fallen, 90)
    })
}

fn time(name: &str, scene: &Scene, before: u32) -> Result<(), Failure> {
    let mut simulator = Simulator::new(scene)?;
    simulator.set_threads(Threads::Pool);
    let start = scene.handles.select(scene.mesh.positions());
    let step = |simulator: &mut Simulator, frame: u32| {
        let aside = 0.1 * (1.0 - (f64::from(frame) * 0.1).cos());
        let targets = start.iter().map(|p| *p + DVec3::X * aside).collect();
        simulator.step(&HandleTargets::at_frame_end(targets)?)?;
        Ok::<(), Failure>(())
    };
    for frame in 1..=before {
        step(&mut simulator, frame)?;
    }
    let counts = simulator.stats().contact;
    let mut longest = Duration::ZERO;
    let (clock, began) = (Instant::now(), on_processor());
    for frame in before + 1..=before + FRAMES {
        let clock = Instant::now();
        step(&mut simulator, frame)?;
        longest = longest.max(clock.elapsed());
    }
    let per_frame = |time: Duration| time.as_secs_f64() * 1e3 / f64::from(FRAMES);
    let mean = per_frame(clock.elapsed());
    let own = began
        .zip(on_processor())
        .map(|(from, to)| per_frame(to - from));
    println!(
        "{name}: {mean:.2} ms per frame ({:.2} on this thread), longest {:.1}; {} intersections at the end",
        own.unwrap_or(f64::NAN),
        longest.as_secs_f64() * 1e3,
        simulator.intersection_count()
    );
    tell(
        &counts,
        &simulator.stats().contact,
        simulator.solver_iterations(),
    );
    Ok(())
}

/// Time that this thread has had a processor, where the system tells (Linux): other work on the
/// machine does not count. Steps of the scheduler's tick.
fn on_processor() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}

fn tell(before: &ContactCounts, now: &ContactCounts, iterations: Option<u32>) {
    let solves = (now.solves - before.solves).max(1) as f64;
    let per = |of: fn(&ContactCounts) -> u64| (of(now) - of(before)) as f64 / solves;
    println!(
        "  {:.1} solves per frame, {:.2} of each in first order; per solve: {:.0} pairs certified by one direction, {:.1} by more, {:.2} not; \
         {:.2} repeats, {:.2} pushes, {:.3} rounds held back, {:.4} divisions; {} touch, {:?} \
         iterations",
        (now.solves - before.solves) as f64 / f64::from(FRAMES),
        per(|c| c.fell_back),
        per(|c| c.certified),
        per(|c| c.halved),
        per(|c| c.uncertified),
        per(|c| c.repeated),
        per(|c| c.projected),
        per(|c| c.held_back),
        per(|c| c.divisions),
        now.touching,
        iterations,
    );
}

fn scene(vertices: usize, hangs: bool) -> Result<Scene, Failure> {
    let sheet = square(&SquareSpec {
        vertices,
        size: 1.0,
        seed: 1,
    })?;
    let mesh = if hangs {
        sheet.mesh
    } else {
        let flat = sheet.mesh.positions().iter();
        let flat = flat.map(|p| DVec3::new(p.y + 0.5, 0.0, p.z)).collect();
        let coordinates = sheet.mesh.material_coordinates().to_vec();
        Mesh::new(&sheet.mesh.topology().face_indices(), coordinates, flat)?
    };
    let held = if hangs {
        sheet.labels["upper-corners"].clone()
    } else {
        Vec::new()
    };
    let material: Material = toml::from_str(GRAY)?;
    Ok(Scene {
        name: "sheet".to_owned(),
        handles: Handles::new(&held, vertices)?,
        mesh,
        fabrics: std::collections::BTreeMap::new(),
        schedule: HandleSchedule::default(),
        material,
        environment: Environment::default(),
        motion: Motion::still(10.0),
        physics: PhysicsSettings::default(),
        sag: SagSettings::default(),
        frame_rate: 60.0,
        contact: None,
        obstacles: Vec::new(),
    })
}

fn ground(height: f64) -> Result<Obstacle, Failure> {
    let corners = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
    let points = corners.map(|(x, z)| DVec3::new(x, height, z)).to_vec();
    Ok(Obstacle::new("ground", points, vec![[0, 2, 1], [0, 3, 2]])?)
}

/// A sphere of rings, 24 by 48.
fn sphere(centre: DVec3, radius: f64) -> Result<Obstacle, Failure> {
    let (rings, around) = (24_u32, 48_u32);
    let mut points = vec![centre + DVec3::Y * radius];
    for ring in 1..rings {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for k in 0..around {
            let azimuth = std::f64::consts::TAU * f64::from(k) / f64::from(around);
            let (sine, cosine) = azimuth.sin_cos();
            let out = DVec3::new(polar.sin() * cosine, polar.cos(), polar.sin() * sine);
            points.push(centre + out * radius);
        }
    }
    points.push(centre - DVec3::Y * radius);
    let last = points.len() as u32 - 1;
    let at = |ring: u32, k: u32| 1 + (ring - 1) * around + k % around;
    let mut faces = Vec::new();
    for k in 0..around {
        faces.push([0, at(1, k + 1), at(1, k)]);
        faces.push([last, at(rings - 1, k), at(rings - 1, k + 1)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, k), at(ring, k + 1)];
            let [c, d] = [at(ring + 1, k), at(ring + 1, k + 1)];
            faces.extend([[a, b, c], [b, d, c]]);
        }
    }
    Ok(Obstacle::new("ball", points, faces)?)
}
