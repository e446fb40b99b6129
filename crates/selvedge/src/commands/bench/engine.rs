//! `selvedge bench engine`: frames and training steps of the networks, beside their bare products
//! and, where asked for, another program's.

use std::thread::sleep;
use std::time::Duration;

use selvedge_model::{Connectivity, ModelSpec, Purpose};
use serde::Serialize;
use serde_json::json;

use super::peer::Peer;
use super::products::{Products, bare_products};
use super::variants::{Engine, Variant, cloth, named};
use super::{median, median_ratio, threads, time};
use crate::cli::EngineArgs;
use crate::commands::flops::{FirstEdgeLayer, flops};
use crate::interrupt;
use crate::output::{Answer, End, Table, percent};
use crate::progress::Progress;

/// Measures of a frame or of a step.
#[derive(Serialize)]
struct Row {
    variant: &'static str,
    what: &'static str,
    vertices: usize,
    arcs: usize,
    elapsed_ms: f64,
    /// Arithmetic as `selvedge presets` counts it; three times as much in a step.
    gflop: f64,
    gflop_per_second: f64,
    /// Of the products alone, by faer.
    products_ms: f64,
    /// Median over the runs of that to what the engine took.
    share_of_roofline: f64,
    peer_ms: Option<f64>,
    times_faster_than_peer: Option<f64>,
}

/// Frames and steps.
#[derive(Clone, Copy)]
enum What {
    Frame,
    Step,
}

impl What {
    fn name(self) -> &'static str {
        match self {
            Self::Frame => "frame",
            Self::Step => "step",
        }
    }

    fn purpose(self) -> Purpose {
        match self {
            Self::Frame => Purpose::Inference,
            Self::Step => Purpose::Training,
        }
    }

    /// Arithmetic in parts of that of a frame.
    fn times(self) -> f64 {
        match self {
            Self::Frame => 1.0,
            Self::Step => 3.0,
        }
    }
}

/// Measures them.
///
/// # Errors
/// When there is no such variant, or the other program fails.
pub(crate) fn run(args: &EngineArgs) -> anyhow::Result<Answer> {
    let variants = named(&args.variant)?;
    let (pool, threads) = threads(args.threads)?;
    let passes = 2 * variants.len() + PAIRS.len();
    let progress = Progress::new("measuring", passes * usize::from(args.runs), "runs at most");
    let mut rows = Vec::new();
    for variant in &variants {
        for what in [What::Frame, What::Step] {
            if interrupt::requested() {
                break;
            }
            let row = pool.install(|| measure(variant, what, args, threads, &progress))?;
            rows.push(row);
        }
    }
    let mut pairs = Vec::new();
    for pair in PAIRS {
        let of = |name: &str| variants.iter().find(|v| v.name == name);
        if let [Some(a), Some(b)] = pair.map(of)
            && !interrupt::requested()
        {
            pairs.push(pool.install(|| beside([a, b], args, &progress))?);
        }
    }
    drop(progress);
    let end = if interrupt::requested() {
        End::Interrupted
    } else {
        End::Complete
    };
    let mut note = format!(
        "{threads} threads, {} cloths in a pass, medians of {} runs. products: the matrix products alone, by faer; \
         share: that to ours, run by run.",
        args.cloths, args.runs
    );
    for pair in &pairs {
        note += &format!(
            "\nA frame of {} takes {} of one of {}, run by run; its arithmetic is {}.",
            pair.variant,
            percent(pair.times_the_other),
            pair.other,
            percent(pair.gflop_times_the_other)
        );
    }
    let report = json!({
        "threads": threads, "runs": args.runs, "cloths": args.cloths, "rows": rows, "pairs": pairs,
    });
    Ok(Answer::new(format!("{}\n{note}", table(&rows)), &report)?.ended(end))
}

/// The rest between programs that take turns `[s]`: threads of the last one go on waiting for work
/// for a while.
const REST: Duration = Duration::from_millis(30);

/// The least time of runs that do not count `[ms]`: the first meets cold caches, sleeping threads
/// and slow processors.
const WARM: f64 = 50.0;

/// The time of a run `[ms]`, after a rest and runs that do not count; `run` returns its own time.
fn rested(mut run: impl FnMut() -> anyhow::Result<f64>) -> anyhow::Result<f64> {
    sleep(REST);
    let mut elapsed = 0.0;
    while elapsed < WARM {
        elapsed += run()?;
    }
    run()
}

/// Frames whose times are of interest beside each other.
const PAIRS: [[&str; 2]; 1] = [["streaming-gru", "mlp"]];

/// The time of a frame of one variant beside one of another, run by run.
#[derive(Serialize)]
struct Beside {
    variant: &'static str,
    other: &'static str,
    times_the_other: f64,
    /// The same of their arithmetic.
    gflop_times_the_other: f64,
}

fn beside(pair: [&Variant; 2], args: &EngineArgs, progress: &Progress) -> anyhow::Result<Beside> {
    let mut engines = Vec::new();
    let mut gflop = Vec::new();
    for variant in pair {
        let graph = Connectivity::of(&cloth(variant.vertices)?);
        let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
        gflop.push(arithmetic(&variant.spec, vertices, arcs));
        engines.push(Engine::new(&variant.spec, graph, args.instructions())?);
    }
    let mut elapsed: [Vec<f64>; 2] = Default::default();
    for _ in 0..args.runs {
        if interrupt::requested() && !elapsed[0].is_empty() {
            break;
        }
        progress.count();
        for (engine, elapsed) in engines.iter_mut().zip(&mut elapsed) {
            elapsed.push(rested(|| Ok(time(|| engine.frame())))?);
        }
    }
    let [variant, other] = pair.map(|v| v.name);
    Ok(Beside {
        variant,
        other,
        times_the_other: median_ratio(&elapsed[0], &elapsed[1]),
        gflop_times_the_other: gflop[0] / gflop[1],
    })
}

/// Arithmetic of a frame `[GFLOP]`.
fn arithmetic(spec: &ModelSpec, vertices: usize, arcs: usize) -> f64 {
    1e-9 * flops(spec, FirstEdgeLayer::Split).per_frame(vertices, arcs) as f64
}

fn measure(
    variant: &Variant,
    what: What,
    args: &EngineArgs,
    threads: usize,
    progress: &Progress,
) -> anyhow::Result<Row> {
    let spec = &variant.spec;
    let topology = cloth(variant.vertices)?;
    let one = Connectivity::of(&topology);
    let cloths = usize::from(args.cloths);
    let graph = Connectivity::union(std::iter::repeat_n(&one, cloths));
    let mut engine = Engine::new(spec, graph, args.instructions())?;
    if matches!(what, What::Step) {
        engine.learn()?;
    }
    let (vertices, arcs) = engine.counts();
    let mut products = Products::new(bare_products(spec, vertices, arcs, what.purpose()), threads);
    let peer = args.against.as_deref();
    let mut peer = peer
        .map(|command| Peer::start(command, spec, &topology, threads))
        .transpose()?;
    let runs = in_turn(args.runs, || {
        let elapsed = [
            rested(|| {
                Ok(time(|| match what {
                    What::Frame => engine.frame(),
                    What::Step => engine.step(),
                }))
            })?,
            rested(|| Ok(time(|| products.run())))?,
        ];
        progress.count();
        let peers = peer.as_mut().map(|peer| rested(|| peer.run(what.name())));
        Ok((elapsed, peers.transpose()?))
    })?;
    let [ours, bare, peers] = runs;
    let gflop = what.times() * arithmetic(spec, vertices, arcs);
    let share_of_roofline = median_ratio(&bare, &ours);
    let times_faster = (!peers.is_empty()).then(|| median_ratio(&peers, &ours));
    let elapsed_ms = median(ours);
    Ok(Row {
        variant: variant.name,
        what: what.name(),
        vertices,
        arcs,
        elapsed_ms,
        gflop,
        gflop_per_second: 1e3 * gflop / elapsed_ms,
        products_ms: median(bare),
        share_of_roofline,
        times_faster_than_peer: times_faster,
        peer_ms: times_faster.map(|_| median(peers)),
    })
}

/// Times of so many rounds `[ms]`: of a pass, of its products, and of another program where there
/// is one. Ends early where an end is asked for.
fn in_turn(
    rounds: u16,
    mut round: impl FnMut() -> anyhow::Result<([f64; 2], Option<f64>)>,
) -> anyhow::Result<[Vec<f64>; 3]> {
    let mut times: [Vec<f64>; 3] = Default::default();
    for _ in 0..rounds {
        if interrupt::requested() {
            break;
        }
        let (elapsed, peer) = round()?;
        for (to, x) in times.iter_mut().zip(elapsed.into_iter().chain(peer)) {
            to.push(x);
        }
    }
    Ok(times)
}

fn table(rows: &[Row]) -> Table {
    let mut table = Table::new([
        "variant", "what", "vertices", "arcs", "ms", "GFLOP", "GFLOP/s", "products", "share",
        "other", "ratio",
    ]);
    for row in rows {
        let or_dash = |x: Option<f64>, text: fn(f64) -> String| x.map_or("-".to_owned(), text);
        table.row([
            row.variant.to_owned(),
            row.what.to_owned(),
            row.vertices.to_string(),
            row.arcs.to_string(),
            format!("{:.2}", row.elapsed_ms),
            format!("{:.2}", row.gflop),
            format!("{:.0}", row.gflop_per_second),
            format!("{:.2}", row.products_ms),
            percent(row.share_of_roofline),
            or_dash(row.peer_ms, |x| format!("{x:.2}")),
            or_dash(row.times_faster_than_peer, |x| format!("{x:.2}")),
        ]);
    }
    table
}
