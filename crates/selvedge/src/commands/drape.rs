//! `selvedge drape`: drapes of fabrics, and a fabric fitted to measured drapes.

use anyhow::Context;
use selvedge_data::{materials, open_material};
use selvedge_lab::drape::{DrapeTest, Drapes, FitOrder, bending_length, fit, stretch_under};
use serde_json::json;

use crate::cli::{DrapeFitArgs, DrapeTestArgs, DrapedArgs};
use crate::output::{Answer, End, Facts, Table, percent};
use crate::{place, progress};

/// Directions from u in which a fabric is measured `[degrees]`.
const DIRECTIONS: [f64; 3] = [0.0, 45.0, 90.0];
/// Pull under which stretch is said `[N/m]`.
const PULL: f64 = 100.0;

fn order(seeds: u16, args: &DrapedArgs) -> DrapeTest {
    DrapeTest {
        vertices: args.vertices as usize,
        seeds: (1..=u64::from(seeds)).collect(),
        threads: args.jobs.map(usize::from),
    }
}

fn spread(value: [f64; 2], digits: usize) -> String {
    format!("{:.digits$} ± {:.digits$}", value[0], value[1])
}

fn millimetres(values: &[f64]) -> String {
    let values = values.iter().map(|value| format!("{:.1}", 1e3 * value));
    values.collect::<Vec<_>>().join(" ")
}

/// Drapes fabrics.
pub(crate) fn test(args: &DrapeTestArgs) -> anyhow::Result<Answer> {
    let test = order(args.seeds, &args.draped);
    let mut names = args.materials.clone();
    if names.is_empty() {
        names.extend(materials().iter().map(|entry| entry.0.to_owned()));
    }
    let fabrics = names.iter().map(|name| open_material(name));
    let fabrics = fabrics.collect::<Result<Vec<_>, _>>()?;
    let headings = [
        "fabric",
        "kg/m²",
        "bending length u/bias/v",
        "stretch at 100 N/m",
        "coefficient",
        "nodes",
        "a2 to a8 [mm]",
    ];
    let (mut table, mut all) = (Table::new(headings), Vec::new());
    let mut end = End::Complete;
    for fabric in &fabrics {
        let Some((drapes, means)) = test.run(fabric, &mut progress::listener())? else {
            end = End::Interrupted;
            break;
        };
        let lengths = DIRECTIONS.map(|degrees| bending_length(fabric, degrees));
        let stretch = DIRECTIONS.map(|degrees| stretch_under(fabric, degrees, PULL));
        table.row([
            fabric.name.clone(),
            format!("{:.3}", fabric.density),
            format!("{} mm", millimetres(&lengths)),
            stretch.map(percent).join(" "),
            spread(means.coefficient, 3),
            spread(means.nodes, 1),
            millimetres(&means.harmonics),
        ]);
        all.push(json!({
            "material": fabric.name,
            "density": fabric.density,
            "bending_length": lengths,
            "stretch": stretch,
            "means": means,
            "drapes": drapes,
        }));
    }
    let report = json!({ "vertices": test.vertices, "fabrics": all });
    Ok(Answer::new(table, report).ended(end))
}

/// Fits a fabric.
pub(crate) fn fit_to(args: &DrapeFitArgs) -> anyhow::Result<Answer> {
    place::check_file(&args.output, "--output", &["toml"])?;
    let name = args.output.file_stem().unwrap_or_default();
    let name = name.to_string_lossy();
    let order = FitOrder {
        table: &args.table,
        fabric: &args.fabric,
        specimens: &args.specimens,
        name: &name,
        density: args.density,
        test: order(args.seeds, &args.draped),
        tries: args.tries.into(),
    };
    let found = fit(&order, &mut progress::listener())?;
    let text = toml::to_string(&found.material).context("writing the fabric")?;
    place::write(&args.output, text.as_bytes())?;
    let mut facts = Facts::new();
    let lengths = DIRECTIONS.map(|degrees| bending_length(&found.material, degrees));
    facts.add("fabric", &name);
    let bending = format!("{} mm along u, bias, v", millimetres(&lengths));
    facts.add("bending length", bending);
    let shear = format!("{:.0} N/m", found.material.stretch.0[0][3]);
    facts.add("shear stiffness", shear);
    let mut tell = |what: &'static str, drapes: &Drapes| {
        let words = format!(
            "coefficient {}, nodes {}, a2 to a8 {} mm",
            spread(drapes.coefficient, 3),
            spread(drapes.nodes, 1),
            millimetres(&drapes.harmonics)
        );
        facts.add(what, words);
    };
    tell("fitted to", &found.fitted);
    tell("simulated", &found.simulated);
    if let Some(checked) = &found.checked {
        tell("not fitted", checked);
    }
    let misfit = format!("{:.2} after {} fabrics", found.misfit, found.tries);
    facts.add("misfit", misfit);
    facts.add("wrote", args.output.display());
    let report = json!({
        "material": found.material,
        "bending_length": lengths,
        "misfit": found.misfit,
        "tries": found.tries,
        "fitted": found.fitted,
        "simulated": found.simulated,
        "checked": found.checked,
        "out": args.output,
    });
    Ok(facts.answer_at(found.end, report))
}
