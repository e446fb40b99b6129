//! The drape test: fabrics draped on meshes of many seeds, measured drapes of real fabrics, and a
//! fabric fitted to them. Folds are an instability, so that means over seeds are compared, not runs.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use rayon::prelude::*;
use selvedge_cloth::generate::{Shape, SheetSpec, sheet};
use selvedge_cloth::{
    BendTable, Cloth, Compression, Drape, HandleTargets, Handles, Material, Mesh, Stepper,
    StretchTable,
};
use selvedge_sim::laws::stretch::{Strain, StretchLaw};
use selvedge_sim::laws::stretch_energy::StretchEnergy;
use selvedge_sim::{Simulator, Threads};
use serde::Serialize;

use crate::event::{End, Event, OnEvent, Reporter};
use crate::workers;

/// Mean speed below which a cloth has come to rest `[m/s]`, and how long after all of gravity acts
/// anyone looks `[s]`.
const STILL: (f64, f64) = (2e-3, 0.5);
/// Gravity by which bending lengths are meant `[m/s²]`.
const GRAVITY: f64 = 9.8;

/// A drape test: so many vertices, a mesh for each seed.
#[derive(Clone, Debug)]
pub struct DrapeTest {
    /// Vertices of the disc.
    pub vertices: usize,
    /// Seeds of its meshes.
    pub seeds: Vec<u64>,
    /// Drapes that are made at once; by default one per processor.
    pub threads: Option<usize>,
}

/// What several drapes of one fabric have in common.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drapes {
    /// Number of drapes.
    pub count: usize,
    /// Mean drape coefficient, and its standard deviation.
    pub coefficient: [f64; 2],
    /// Mean number of folds, and its standard deviation.
    pub nodes: [f64; 2],
    /// Mean amplitudes of the harmonics 2 to 8 `[m]`.
    pub harmonics: [f64; 7],
}

impl Drapes {
    /// Means of `drapes`, of which there is one at least.
    fn of(drapes: &[Row]) -> Self {
        let count = drapes.len() as f64;
        let mean = |value: &dyn Fn(&Row) -> f64| drapes.iter().map(value).sum::<f64>() / count;
        let both = |value: &dyn Fn(&Row) -> f64| {
            let middle = mean(value);
            [middle, mean(&|row| (value(row) - middle).powi(2)).sqrt()]
        };
        Self {
            count: drapes.len(),
            coefficient: both(&|row| row.0),
            nodes: both(&|row| row.1),
            harmonics: std::array::from_fn(|k| mean(&|row| row.2[k])),
        }
    }

    /// Distance from `other`: squares of differences, of the coefficient in 0.02, of the nodes in
    /// 1.5, of each harmonic in a third of it or 1 mm, these on average.
    fn misfit(&self, other: &Self) -> f64 {
        let square = |a: f64, b: f64, unit: f64| ((a - b) / unit).powi(2);
        let waves = self.harmonics.iter().zip(other.harmonics);
        let waves = waves.map(|(a, b)| square(*a, b, (b / 3.0).max(1e-3)));
        square(self.coefficient[0], other.coefficient[0], 0.02)
            + square(self.nodes[0], other.nodes[0], 1.5)
            + waves.sum::<f64>() / 7.0
    }
}

/// Coefficient, nodes and amplitudes of harmonics of a drape.
type Row = (f64, f64, [f64; 7]);

/// Drapes of `fabric` in a table (.csv): those of the `specimens` (all, where none is named), and
/// those of the others. The table may have other columns too.
fn measured(file: &Path, fabric: &str, specimens: &[String]) -> Result<(Vec<Row>, Vec<Row>)> {
    let name = || file.display().to_string();
    let mut reader = csv::Reader::from_path(file).with_context(name)?;
    let mut drapes = Vec::new();
    let mut fabrics = BTreeSet::new();
    for line in reader.deserialize::<BTreeMap<String, String>>() {
        let line = line.with_context(name)?;
        let cell = |key: &str| {
            line.get(key)
                .with_context(|| format!("{}: has no column {key}", name()))
        };
        let number = |key: &str| -> Result<f64> {
            let cell = cell(key)?;
            cell.parse()
                .with_context(|| format!("{}: {key} is {cell:?}, no number", name()))
        };
        if cell("fabric")? != fabric {
            fabrics.insert(cell("fabric")?.clone());
            continue;
        }
        let mut harmonics = [0.0; 7];
        for (k, amplitude) in harmonics.iter_mut().enumerate() {
            *amplitude = 1e-3 * number(&format!("a{}_mm", k + 2))?;
        }
        let row = (number("drape_coefficient")?, number("nodes")?, harmonics);
        drapes.push((cell("sample")?.clone(), row));
    }
    let others = Vec::from_iter(fabrics).join(", ");
    ensure!(
        !drapes.is_empty(),
        "{}: has no fabric {fabric:?}, but {others}",
        name()
    );
    for specimen in specimens {
        let is_there = drapes.iter().any(|drape| drape.0 == *specimen);
        ensure!(
            is_there,
            "{}: has no specimen {specimen:?} of fabric {fabric:?}",
            name()
        );
    }
    let is_fitted = |drape: &(String, Row)| specimens.is_empty() || specimens.contains(&drape.0);
    let (fitted, others): (Vec<_>, Vec<_>) = drapes.into_iter().partition(is_fitted);
    let rows = |drapes: Vec<(String, Row)>| drapes.into_iter().map(|drape| drape.1).collect();
    Ok((rows(fitted), rows(others)))
}

/// The shipped scene `drape` of another fabric and mesh, until it hangs still.
///
/// # Errors
/// A number of vertices that makes no disc, a solve that fails.
pub fn drape(material: &Material, vertices: usize, seed: u64) -> Result<Drape> {
    let mut scene = selvedge_data::open_scene("drape")?.scene;
    let spec = SheetSpec {
        shape: Shape::DrapeDisc,
        vertices,
        size: 0.3,
        width: None,
        seed,
    };
    let made = sheet(&spec)?;
    let points = made.mesh.material_coordinates().to_vec();
    let start: Vec<DVec3> = points
        .iter()
        .map(|p| DVec3::new(p.y - 0.15, 0.0, p.x - 0.15))
        .collect();
    let faces = made.mesh.topology().face_indices();
    scene.mesh = Mesh::new(&faces, points, start.clone())?;
    scene.handles = Handles::new(made.label("clamped")?, vertices)?;
    scene.material = material.clone();
    let targets = HandleTargets::at_frame_end(scene.handles.select(&start))?;
    let cloth = Cloth::of_scene(&scene, selvedge::rounded(&start))?;
    let mass: f64 = cloth.vertex_mass().iter().map(|m| f64::from(*m)).sum();
    let mut simulator = Simulator::with_state(&scene, start, vec![DVec3::ZERO; vertices])?;
    simulator.set_threads(Threads::One);
    for frame in 0..scene.frame_count()? {
        let step = simulator.step(&targets);
        step.with_context(|| format!("a drape of {}", material.name))?;
        let laid = (scene.environment.onset + STILL.1) * scene.frame_rate;
        let is_still = 2.0 * simulator.kinetic_energy() < mass * STILL.0.powi(2);
        if frame as f64 > laid && is_still {
            break;
        }
    }
    Drape::of(&cloth, simulator.positions()).context("the scene drape is no drape test")
}

impl DrapeTest {
    /// Drapes a fabric: the drapes, one for each seed, and what they have in common; none after an
    /// interruption.
    ///
    /// # Errors
    /// As of [`drape`].
    pub fn run(
        &self,
        material: &Material,
        on_event: &mut OnEvent<'_>,
    ) -> Result<Option<(Vec<Drape>, Drapes)>> {
        let reporter = Reporter::new(on_event);
        let what = format!("draping {}", material.name);
        let task = reporter.count(&what, self.seeds.len(), "drapes");
        let one = |seed: &u64| {
            if task.is_stopped() {
                return Ok(None);
            }
            let made = drape(material, self.vertices, *seed)?;
            Ok(task.advance().is_continue().then_some(made))
        };
        let pool = workers::pool(self.threads)?;
        let made: Result<Vec<Option<Drape>>> =
            pool.install(|| self.seeds.par_iter().map(one).collect());
        let made: Option<Vec<Drape>> = made?.into_iter().collect();
        Ok(made.map(|drapes| {
            let rows: Vec<Row> = drapes
                .iter()
                .map(|d| (d.coefficient, d.nodes as f64, d.harmonics))
                .collect();
            (drapes, Drapes::of(&rows))
        }))
    }
}

/// A fabric to be fitted to measured drapes.
#[derive(Clone, Debug)]
pub struct FitOrder<'a> {
    /// The table of drapes (.csv).
    pub table: &'a Path,
    /// The fabric in it.
    pub fabric: &'a str,
    /// The specimens that are fitted; the others are a check. All are where none is named.
    pub specimens: &'a [String],
    /// Name of the fabric that is made.
    pub name: &'a str,
    /// Mass per area `[kg/m²]`. What hangs shows stiffness over mass alone.
    pub density: f64,
    /// Drapes of a try.
    pub test: DrapeTest,
    /// Fabrics that are tried at most.
    pub tries: usize,
}

/// A fabric after a fit.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The best fabric.
    pub material: Material,
    /// Its misfit to what was fitted; of a perfect one 0, of one off by each bound 3.
    pub misfit: f64,
    /// Its drapes.
    pub simulated: Drapes,
    /// The drapes that were fitted.
    pub fitted: Drapes,
    /// Those of the other specimens.
    pub checked: Option<Drapes>,
    /// Fabrics that were tried.
    pub tries: usize,
    /// The end that it came to.
    pub end: End,
}

/// Bending stiffness along u, bias and v over the mass `[m³/s²]` of a limp and of a stiff fabric,
/// and stiffness of its threads against stretching `[N/m]`.
const BENDING: [f64; 2] = [2e-6, 2e-3];
const STRETCH: [f64; 2] = [30.0, 3000.0];
/// Shear stiffness over that of the threads.
const SHEAR: f64 = 0.1;
/// The drape coefficient rises about so much where bending stiffness becomes e times as large.
const RISE: f64 = 0.12;
/// Ways in which a fabric is changed: bending as a whole, between u and v, along the bias, and in its
/// plane.
const WAYS: [[f64; 4]; 4] = [
    [1.0, 1.0, 1.0, 0.0],
    [1.0, 0.0, -1.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];
/// Factor of the first changes and, of the last, the least.
const FACTORS: [f64; 2] = [1.8, 1.1];

/// Fits a fabric to measured drapes: bending as a whole until the coefficient is right, then a compass
/// search (Kolda, Lewis and Torczon 2003): the logarithms of four stiffnesses are changed along four
/// ways in turn, and the changes become smaller where none helps. The seeds are the same in all tries.
///
/// # Errors
/// A table that cannot be read, a fabric or specimen that is not in it, a drape that fails.
pub fn fit(order: &FitOrder<'_>, on_event: &mut OnEvent<'_>) -> Result<Fitted> {
    let (fitted, others) = measured(order.table, order.fabric, order.specimens)?;
    let (fitted, checked) = (
        Drapes::of(&fitted),
        (!others.is_empty()).then(|| Drapes::of(&others)),
    );
    let reporter = Reporter::new(on_event);
    let task = reporter.count(&format!("fitting {}", order.name), order.tries, "fabrics");
    let mut tries = 0;
    let mut look = |logs: [f64; 4]| -> Result<Option<(f64, Drapes)>> {
        if tries == order.tries || task.is_stopped() {
            return Ok(None);
        }
        let mut quiet = |_: Event<'_>| {
            if task.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let Some((_, found)) = order.test.run(&fabric(order, logs), &mut quiet)? else {
            return Ok(None);
        };
        tries += 1;
        let misfit = found.misfit(&fitted);
        task.note(&format!("misfit {misfit:.2}"));
        let _ = task.advance();
        Ok(Some((misfit, found)))
    };
    let mut at = start(fitted.coefficient[0]);
    let Some(mut best) = look(at)? else {
        bail!("interrupted before the first fabric was draped");
    };
    loop {
        let off = fitted.coefficient[0] - best.1.coefficient[0];
        let mut next = std::array::from_fn(|k| at[k] + off / RISE * WAYS[0][k]);
        clamp(&mut next);
        match look(next)? {
            Some(found) if found.0 < best.0 => (at, best) = (next, found),
            _ => break,
        }
    }
    let mut step = FACTORS[0].ln();
    'search: while step >= FACTORS[1].ln() {
        let mut is_better = false;
        for way in WAYS {
            for sign in [1.0, -1.0] {
                let mut next: [f64; 4] = std::array::from_fn(|k| at[k] + sign * step * way[k]);
                clamp(&mut next);
                if next == at {
                    continue;
                }
                let Some(found) = look(next)? else {
                    break 'search;
                };
                if found.0 < best.0 {
                    (at, best, is_better) = (next, found, true);
                    break;
                }
            }
        }
        if !is_better {
            step *= 0.5;
        }
    }
    let is_stopped = task.is_stopped();
    drop(task);
    Ok(Fitted {
        material: fabric(order, at),
        misfit: best.0,
        simulated: best.1,
        fitted,
        checked,
        tries,
        end: if is_stopped { End::Interrupted } else { End::Complete },
    })
}

/// Logarithms to begin with: an isotropic sheet of about this drape coefficient.
fn start(coefficient: f64) -> [f64; 4] {
    let bending = 1e-5_f64.ln() + 6.6 * (coefficient - 0.35).max(0.0);
    // Limp fabrics give way in their plane too.
    let stretch = 1e3_f64.ln() - 10.0 * (0.4 - coefficient).max(0.0);
    let mut logs = [bending, bending, bending, stretch];
    clamp(&mut logs);
    logs
}

fn clamp(logs: &mut [f64; 4]) {
    for (k, log) in logs.iter_mut().enumerate() {
        let [low, high] = if k < 3 { BENDING } else { STRETCH };
        *log = log.clamp(low.ln(), high.ln());
    }
}

/// The fabric of these logarithms.
fn fabric(order: &FitOrder<'_>, logs: [f64; 4]) -> Material {
    let [u, bias, v, stretch] = logs.map(f64::exp);
    // An edge bends the cloth across itself. Tables hold four times the stiffness of a plate, and half
    // of the stiffness in the plane.
    let bend = [v, bias, u].map(|stiffness| [4.0 * order.density * stiffness; 5]);
    Material {
        name: order.name.to_owned(),
        source: format!(
            "fitted to drapes of fabric {} in {}",
            order.fabric,
            order.table.display()
        ),
        density: order.density,
        damping: 0.0,
        stretch: StretchTable([[0.5 * stretch, 0.0, 0.5 * stretch, SHEAR * stretch]; 6]),
        bend: BendTable(bend),
        compression: Compression::default(),
    }
}

/// Bending length `[m]` of a fabric that curves a little along a direction from u `[degrees]`, the
/// cube root of bending stiffness over weight: hinges of equilateral triangles in all directions.
/// `[eq:bending-length]`
pub fn bending_length(material: &Material, degrees: f64) -> f64 {
    const EDGES: usize = 720;
    let stiffness = |edge: usize| {
        let turn = 180.0 * edge as f64 / EDGES as f64;
        let place = turn.min(180.0 - turn) / 45.0;
        let (low, rows) = ((place as usize).min(1), &material.bend.0);
        let part = place - low as f64;
        let ke = (1.0 - part) * rows[low][0] + part * rows[low + 1][0];
        // θ ∝ 3 cos² - sin² of the angle between curvature and the edge's normal, whose fourth
        // moment is 3.
        let across = (turn + 90.0 - degrees).to_radians().cos().powi(2);
        ke * (4.0 * across - 1.0).powi(2) / 3.0
    };
    let mean = (0..EDGES).map(stiffness).sum::<f64>() / EDGES as f64;
    (0.25 * mean / (material.density * GRAVITY)).cbrt()
}

/// Stretch of a strip of a fabric along a direction from u `[degrees]` under a pull `[N/m]`: the
/// strain at which energy less work is least, across it free.
pub fn stretch_under(material: &Material, degrees: f64, pull: f64) -> f64 {
    let law = StretchEnergy::new(&material.stretch);
    let (s, c) = degrees.to_radians().sin_cos();
    // G along, across and between, turned to the fabric's axes.
    let stress = |[a, b, g]: [f64; 3]| {
        let elastic = law.at(
            Strain {
                uu: a * c * c + b * s * s - 2.0 * g * s * c,
                vv: a * s * s + b * c * c + 2.0 * g * s * c,
                uv: (a - b) * s * c + g * (c * c - s * s),
            },
            true,
        );
        let Strain { uu, vv, uv } = elastic.stress;
        [
            uu * c * c + vv * s * s + 2.0 * uv * s * c - pull / (1.0 + 2.0 * a).sqrt(),
            uu * s * s + vv * c * c - 2.0 * uv * s * c,
            2.0 * ((vv - uu) * s * c + uv * (c * c - s * s)),
        ]
    };
    // Newton's method with differences for the tangent; the energy is convex.
    let mut at = [0.0; 3];
    for _ in 0..60 {
        let residual = DVec3::from(stress(at));
        let column = |k: usize| {
            let mut near = at;
            near[k] += 1e-7;
            (DVec3::from(stress(near)) - residual) / 1e-7
        };
        let tangent = glam::DMat3::from_cols(column(0), column(1), column(2));
        let step = tangent.inverse() * residual;
        let part = (0.05 / step.abs().max_element().max(1e-300)).min(1.0);
        at = (DVec3::from(at) - part * step).to_array();
    }
    (1.0 + 2.0 * at[0]).sqrt() - 1.0
}

#[cfg(test)]
mod tests {
    use selvedge_cloth::Isotropic;

    use super::*;

    const SHEET: Isotropic = Isotropic {
        youngs_modulus: 1e6,
        poissons_ratio: 0.3,
        thickness: 1e-3,
    };

    #[test]
    fn an_isotropic_sheet_has_one_bending_length_and_its_modulus() {
        let material = SHEET.material("sheet", 0.2);
        let expected = (SHEET.plate_stiffness() / (0.2 * GRAVITY)).cbrt();
        for degrees in [0.0, 30.0, 45.0, 90.0] {
            let found = bending_length(&material, degrees);
            assert!(
                (found / expected - 1.0).abs() < 1e-6,
                "{degrees}: {found} {expected}"
            );
            // Green's strain of 1000 N/m under 10 N/m along: (λ² - 1)/2 E h λ = 10.
            let stretch = stretch_under(&material, degrees, 10.0);
            let pull = 1000.0 * (0.5 * ((1.0 + stretch).powi(2) - 1.0)) * (1.0 + stretch);
            assert!((pull - 10.0).abs() < 1e-3, "{degrees}: {pull}");
        }
    }

    #[test]
    fn a_fit_comes_nearer_to_the_drapes_and_names_what_a_table_lacks() {
        let folder = tempfile::tempdir().unwrap();
        let table = folder.path().join("drapes.csv");
        let head = "fabric,sample,capture,drape_coefficient,nodes,a2_mm,a3_mm,a4_mm,a5_mm,a6_mm,a7_mm,a8_mm";
        let lines = "7,1,Cap1,0.95,0,1,1,1,1,1,1,1\n7,3,Cap1,0.93,0,1,1,1,1,1,1,1\n";
        std::fs::write(&table, format!("{head}\n{lines}")).unwrap();
        let specimens = ["1".to_owned()];
        let order = FitOrder {
            table: &table,
            fabric: "7",
            specimens: &specimens,
            name: "stiff",
            density: 0.2,
            test: DrapeTest {
                vertices: 150,
                seeds: vec![1],
                threads: None,
            },
            tries: 4,
        };
        let mut ignore_events = |_: Event<'_>| ControlFlow::Continue(());
        let once = fit(
            &FitOrder {
                tries: 1,
                ..order.clone()
            },
            &mut ignore_events,
        )
        .unwrap();
        let more = fit(&order, &mut ignore_events).unwrap();
        assert!(more.tries <= 4 && more.misfit <= once.misfit);
        assert_eq!(more.checked.map(|drapes| drapes.coefficient[0]), Some(0.93));
        let other = FitOrder {
            fabric: "8",
            ..order.clone()
        };
        let error = fit(&other, &mut ignore_events).unwrap_err().to_string();
        assert!(error.contains("no fabric \"8\", but 7"), "{error}");
    }
}
