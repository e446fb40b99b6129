//! A trial.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]
use std::time::Instant;

use glam::DVec3;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use selvedge_cloth::*;
use selvedge_data::LoadedScene;
use selvedge_model::*;
use selvedge_sim::{Simulator, Threads};
use selvedge_train::{Adam, AdamSettings, clip_norm};

fn arg(name: &str, default: f64) -> f64 {
    let key = format!("{name}=");
    std::env::args()
        .find_map(|a| a.strip_prefix(&key).map(|v| v.parse().unwrap()))
        .unwrap_or(default)
}

#[derive(Clone)]
struct Stage {
    scene: Scene,
    graph: ClothGraph,
    rest: Vec<DVec3>,
    stiffness: Stiffness,
}

fn loaded(vertices: usize, material: &str) -> LoadedScene {
    let text = format!(
        "name = \"s\"\nmaterial = \"{material}\"\nmotion = {{ named = \"forward\" }}\nhandles = {{ label = \"upper-corners\" }}\nmesh = {{ generator = {{ kind = \"square\", vertices = {vertices}, size = 1.0, seed = 1 }} }}\n"
    );
    selvedge_data::parse_scene(&text, ".".as_ref(), "s").unwrap()
}

fn stage(vertices: usize, material: &str) -> Stage {
    let scene = loaded(vertices, material).scene;
    let rest = selvedge_sim::sag(&scene).unwrap().positions;
    let cloth = Cloth::of_scene(&scene, rest.iter().map(|p| p.as_vec3()).collect()).unwrap();
    let graph = ClothGraph::new(&cloth, scene.environment, scene.frame_rate).unwrap();
    let m = &scene.material;
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let k: Vec<f64> = m.stretch.0.iter().flat_map(|r| [r[0], r[2]]).collect();
    let stiffness = Stiffness {
        stretch: 2.0 * mean(&k),
        bend: mean(m.bend.0.as_flattened()),
        density: m.density,
    };
    Stage {
        scene,
        graph,
        rest,
        stiffness,
    }
}

#[derive(Clone)]
struct St {
    x: Vec<DVec3>,
    v: Vec<DVec3>,
}
impl St {
    fn of(s: &Simulator) -> Self {
        Self {
            x: s.positions_f64().to_vec(),
            v: s.velocities_f64().to_vec(),
        }
    }
    fn r(&self) -> MotionState<'_> {
        MotionState {
            positions: &self.x,
            velocities: &self.v,
        }
    }
}

struct Sample {
    stage: usize,
    nodes: Vec<f32>,
    arcs: Vec<f32>,
    target: Vec<f32>,
}

struct Net {
    network: Network,
    weights: Vec<f32>,
    norm: Option<Normalizers>,
}
struct Pass2 {
    packed: PackedWeights<f32>,
    work: Workspace<f32>,
}

fn squash(rows: &mut [f32]) {
    for x in rows {
        *x = x.clamp(-10.0, 10.0);
    }
}

impl Net {
    fn pass(&self, p: Purpose) -> Pass2 {
        Pass2 {
            packed: self.network.pack(&self.weights, p, Instructions::Detected),
            work: Workspace::new(),
        }
    }
    fn correct(
        &self,
        pass: &mut Pass2,
        stage: &Stage,
        cols: &CorrectionColumns,
        out: &mut Vec<f32>,
    ) {
        let n = self.norm.as_ref().unwrap();
        let (mut nodes, mut arcs) = (cols.nodes.clone(), cols.arcs.clone());
        n.nodes.normalize(&mut nodes);
        n.edges.normalize(&mut arcs);
        squash(&mut nodes);
        squash(&mut arcs);
        let y = self.network.forward_carried(
            &pass.packed,
            stage.graph.connectivity(),
            Carried {
                input: Input {
                    nodes: &nodes,
                    arcs: &arcs,
                },
                state: &EncoderState::new(),
            },
            Pass::Inference,
            &mut pass.work,
        );
        out.clear();
        out.extend_from_slice(y);
        squash(out);
        n.acceleration.denormalize(out);
    }
}

struct Slot {
    stage: usize,
    cheap: Simulator,
    teacher: Simulator,
    path: HandlePath,
    cols: CorrectionColumns,
    last: St,
    before: Option<St>,
    left: usize,
    mode_left: usize,
    model: bool,
    rng: ChaCha8Rng,
    made: u64,
    speed: f64,
    steps: u64,
    sub: u32,
    forgets: bool,
}

fn cheap_scene(s: &Scene, sub: u32, int: Integrator) -> Scene {
    let mut s = s.clone();
    s.physics.substeps = sub;
    s.physics.integrator = int;
    s.physics.least_damping = Some(2e-4);
    s
}

impl Slot {
    fn begin(&mut self, stages: &[Stage], base: &PhysicsBase, teach: u32) {
        self.made += 1;
        self.stage = self.rng.random_range(0..stages.len());
        let st = &stages[self.stage];
        let number = self.rng.next_u64();
        let motion = RandomMotion {
            seed: 77,
            number,
            duration: 12.0,
            speed: self.speed * self.rng.random_range(0.5..1.5),
        }
        .motion();
        let mut scene = st.scene.clone();
        scene.motion = motion;
        self.path = scene.handle_path().unwrap();
        let zero = vec![DVec3::ZERO; st.rest.len()];
        let mut lead = Simulator::with_state(
            &cheap_scene(&scene, 2, Integrator::SecondOrder),
            st.rest.clone(),
            zero.clone(),
        )
        .unwrap()
        .at_frame(20);
        lead.set_threads(Threads::One);
        for f in 20..20 + self.rng.random_range(0..300) {
            if lead.step(&self.path.targets(f, 2).unwrap()).is_err() {
                println!("lead failed");
                break;
            }
        }
        let start = lead.frame();
        let mk = |sub, int| {
            let mut s = Simulator::with_state(
                &cheap_scene(&scene, sub, int),
                lead.positions_f64().to_vec(),
                lead.velocities_f64().to_vec(),
            )
            .unwrap();
            s.set_threads(Threads::One);
            s.at_frame(start)
        };
        self.cheap = mk(base.substeps, base.integrator);
        self.teacher = mk(teach, Integrator::SecondOrder);
        self.cols = CorrectionColumns::new(&st.graph, st.stiffness, 1.0 / scene.frame_rate);
        self.last = St::of(&self.cheap);
        self.before = None;
        self.left = self.rng.random_range(100..400);
    }
    fn advance(
        &mut self,
        stages: &[Stage],
        base: &PhysicsBase,
        teach: u32,
        net: &Net,
        pass: &mut Pass2,
        longest: usize,
    ) -> Option<Sample> {
        if self.left == 0 {
            self.begin(stages, base, teach);
        }
        self.left -= 1;
        if self.mode_left == 0 {
            self.model = !self.model && longest > 0;
            self.mode_left = if self.model {
                self.rng.random_range(1..=longest)
            } else {
                self.rng.random_range(5..20)
            };
        }
        self.mode_left -= 1;
        let frame = self.cheap.frame();
        if self.forgets || self.rng.random_bool(0.02) {
            let _ = self
                .cheap
                .resume(frame, &self.last.x.clone(), &self.last.v.clone());
            self.before = None;
        }
        let t1 = self.path.targets(frame, base.substeps as usize).unwrap();
        let t2 = self.path.targets(frame, teach as usize).unwrap();
        self.teacher
            .resume(frame, &self.last.x, &self.last.v)
            .unwrap();
        if self.cheap.step(&t1).is_err() || self.teacher.step(&t2).is_err() {
            println!("failed");
            self.left = 0;
            return None;
        }
        let (pred, truth) = (St::of(&self.cheap), St::of(&self.teacher));
        let st = &stages[self.stage];
        let turns = HalfTurns {
            along: self.rng.random(),
            over: self.rng.random(),
        };
        let f = PredictedFrame {
            before: self.before.as_ref().map(St::r),
            last: self.last.r(),
            predicted: pred.r(),
            wind: st.scene.environment.wind,
            gravity: st.scene.environment.gravity,
            held: st.graph.handle_mask(),
        };
        self.cols.write(&st.graph, &f, turns);
        let mut target = Vec::new();
        self.cols.target(pred.r(), truth.r(), &mut target);
        let sample = Sample {
            stage: self.stage,
            nodes: self.cols.nodes.clone(),
            arcs: self.cols.arcs.clone(),
            target,
        };
        let mut next = pred;
        if self.model && net.norm.is_some() {
            let mut out = Vec::new();
            net.correct(pass, st, &self.cols, &mut out);
            self.cols
                .apply(&out, st.graph.handle_mask(), &mut next.x, &mut next.v);
        } else {
            next = truth;
        }
        let far = next
            .x
            .iter()
            .zip(self.teacher.positions_f64())
            .map(|(a, b)| a.distance(*b))
            .fold(0.0, f64::max);
        if !(far < 0.05) {
            println!("diverged {far}");
            self.left = 0;
            return None;
        }
        if self.cheap.correct(&next.x, &next.v).is_err() {
            self.left = 0;
            return None;
        }
        self.before = Some(std::mem::replace(&mut self.last, next));
        Some(sample)
    }
}

fn rms(a: &[DVec3], b: &[DVec3]) -> f64 {
    (a.iter()
        .zip(b)
        .map(|(a, b)| a.distance_squared(*b))
        .sum::<f64>()
        / a.len() as f64)
        .sqrt()
}

fn folds(g: &ClothGraph, x: &[DVec3]) -> f64 {
    let h = g.hinges();
    h.iter()
        .map(|h| {
            geometry::dihedral_angle(
                x[h.from as usize],
                x[h.to as usize],
                x[h.left as usize],
                x[h.right as usize],
            )
            .abs()
        })
        .sum::<f64>()
        / h.len() as f64
}

struct Exam {
    stage: Stage,
    path: HandlePath,
    truth: Vec<St>,
    starts: Vec<usize>,
}

fn exam(stage: &Stage, motion: &str) -> Exam {
    let mut stage = stage.clone();
    let l = loaded(stage.rest.len(), "gray-interlock")
        .of_motion(motion)
        .unwrap();
    stage.scene.motion = l.scene.motion;
    let path = stage.scene.handle_path().unwrap();
    let mut s = Simulator::with_state(
        &cheap_scene(&stage.scene, 16, Integrator::SecondOrder),
        stage.rest.clone(),
        vec![DVec3::ZERO; stage.rest.len()],
    )
    .unwrap();
    s.set_threads(Threads::One);
    let mut truth = vec![St::of(&s)];
    for f in 0..380 {
        s.step(&path.targets(f, 16).unwrap()).unwrap();
        truth.push(St::of(&s));
    }
    Exam {
        stage,
        path,
        truth,
        starts: (0..5).map(|i| 70 + i * 60).collect(),
    }
}
const HORIZONS: [usize; 5] = [1, 5, 10, 20, 50];
impl Exam {
    fn run(&self, sub: u32, int: Integrator, forgets: bool, net: Option<&Net>) -> ([f64; 5], f64) {
        let rows: Vec<([f64; 5], f64)> = self
            .starts
            .par_iter()
            .map(|&start| {
                let mut pass = net.map(|n| n.pass(Purpose::Inference));
                let t = &self.truth[start];
                let mut s = Simulator::with_state(
                    &cheap_scene(&self.stage.scene, sub, int),
                    t.x.clone(),
                    t.v.clone(),
                )
                .unwrap()
                .at_frame(start);
                s.set_threads(Threads::One);
                let mut cols =
                    CorrectionColumns::new(&self.stage.graph, self.stage.stiffness, 1.0 / 60.0);
                let (mut last, mut before): (St, Option<St>) = (t.clone(), None);
                let mut out = [f64::NAN; 5];
                let mut y = Vec::new();
                let mut fold = f64::NAN;
                for k in 1..=50 {
                    if forgets {
                        s.resume(start + k - 1, &last.x, &last.v).unwrap();
                        before = None;
                    }
                    if s.step(&self.path.targets(start + k - 1, sub as usize).unwrap())
                        .is_err()
                    {
                        break;
                    }
                    if let (Some(n), Some(p)) = (net, &mut pass) {
                        let pred = St::of(&s);
                        cols.write(
                            &self.stage.graph,
                            &PredictedFrame {
                                before: before.as_ref().map(St::r),
                                last: last.r(),
                                predicted: pred.r(),
                                wind: DVec3::ZERO,
                                gravity: self.stage.scene.environment.gravity,
                                held: self.stage.graph.handle_mask(),
                            },
                            HalfTurns::default(),
                        );
                        n.correct(p, &self.stage, &cols, &mut y);
                        let mut next = pred;
                        cols.apply(&y, self.stage.graph.handle_mask(), &mut next.x, &mut next.v);
                        if s.correct(&next.x, &next.v).is_err() {
                            break;
                        }
                        before = Some(std::mem::replace(&mut last, next));
                    } else {
                        last = St::of(&s);
                    }
                    if let Some(h) = HORIZONS.iter().position(|&h| h == k) {
                        out[h] = 1e3 * rms(s.positions_f64(), &self.truth[start + k].x);
                    }
                    if k == 50 {
                        fold = folds(&self.stage.graph, s.positions_f64())
                            / folds(&self.stage.graph, &self.truth[start + k].x);
                    }
                }
                (out, fold)
            })
            .collect();
        let n = rows.len() as f64;
        (
            std::array::from_fn(|i| rows.iter().map(|r| r.0[i]).sum::<f64>() / n),
            rows.iter().map(|r| r.1).sum::<f64>() / n,
        )
    }
}
fn say(name: &str, exams: &[Exam], f: &dyn Fn(&Exam) -> ([f64; 5], f64)) {
    let rows: Vec<_> = exams.iter().map(f).collect();
    let n = rows.len() as f64;
    let m: Vec<String> = (0..5)
        .map(|i| format!("{:.3}", rows.iter().map(|r| r.0[i]).sum::<f64>() / n))
        .collect();
    println!(
        "{name}: {} folds {:.3}",
        m.join(" "),
        rows.iter().map(|r| r.1).sum::<f64>() / n
    );
}

fn main() {
    let int = if arg("first", 0.0) > 0.0 {
        Integrator::Linearised
    } else {
        Integrator::SecondOrder
    };
    let base = PhysicsBase {
        integrator: int,
        substeps: arg("sub", 1.0) as u32,
        forgets: arg("forgets", 0.0) > 0.0,
    };
    let (latent, blocks, minutes, batch) = (
        arg("latent", 48.0) as usize,
        arg("blocks", 4.0) as usize,
        arg("minutes", 15.0),
        arg("batch", 4.0) as usize,
    );
    let (rate, reuse, teach, keep) = (
        arg("rate", 1e-3),
        arg("reuse", 4.0),
        arg("teach", 8.0) as u32,
        arg("keep", 2000.0) as usize,
    );
    let base_stage = stage(400, "gray-interlock");
    let exams: Vec<Exam> = ["test-xy-minus-z", "test-rotation-first-ccw"]
        .par_iter()
        .map(|m| exam(&base_stage, m))
        .collect();
    println!("ready");
    if arg("rivals", 1.0) > 0.0 {
        say("first 1", &exams, &|e| {
            e.run(1, Integrator::Linearised, false, None)
        });
        say("second 1", &exams, &|e| {
            e.run(1, Integrator::SecondOrder, false, None)
        });
        say("second 1 forgets", &exams, &|e| {
            e.run(1, Integrator::SecondOrder, true, None)
        });
        say("second 2", &exams, &|e| {
            e.run(2, Integrator::SecondOrder, false, None)
        });
        say("second 2 forgets", &exams, &|e| {
            e.run(2, Integrator::SecondOrder, true, None)
        });
        say("second 4", &exams, &|e| {
            e.run(4, Integrator::SecondOrder, false, None)
        });
    }
    let mut stages = vec![base_stage.clone()];
    if arg("many", 0.0) > 0.0 {
        for (n, m) in [
            (400, "11oz-black-denim"),
            (400, "navy-sparkle-sweat"),
            (400, "camel-ponte-roma"),
            (200, "gray-interlock"),
            (700, "gray-interlock"),
        ] {
            stages.push(stage(n, m));
        }
    }
    let spec: ModelSpec = ModelSpec {
        node_features: Default::default(),
        edge_features: Default::default(),
        encoder: Encoder::MLP,
        latent,
        blocks,
        coarse_levels: 0,
        integration: Integration::default(),
        edge_limits: None,
        base: Some(base),
    };
    let network = Network::new(&spec).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let weights = network.initialise(&mut || rng.random::<f64>());
    println!(
        "{} weights, {:.1} MFLOP",
        weights.len(),
        flops(&spec, FirstEdgeLayer::Split).per_frame(400, base_stage.graph.arc_count()) as f64
            / 1e6
    );
    let mut adam = Adam::new(AdamSettings::default(), weights.len()).unwrap();
    let mut net = Net {
        network,
        weights,
        norm: None,
    };
    let count = arg("slots", 24.0) as usize;
    let mut slots: Vec<Slot> = (0..count)
        .map(|i| {
            let st = &base_stage;
            let s = Simulator::new(&st.scene).unwrap();
            let s2 = Simulator::new(&st.scene).unwrap();
            Slot {
                stage: 0,
                cheap: s,
                teacher: s2,
                path: st.scene.handle_path().unwrap(),
                cols: CorrectionColumns::new(&st.graph, st.stiffness, 1.0 / 60.0),
                last: St {
                    x: vec![],
                    v: vec![],
                },
                before: None,
                left: 0,
                mode_left: 0,
                model: false,
                rng: {
                    let mut r = ChaCha8Rng::seed_from_u64(5);
                    r.set_stream(i as u64);
                    r
                },
                made: 0,
                speed: 1.0,
                steps: 0,
                sub: 1,
                forgets: base.forgets,
            }
        })
        .collect();
    let mut store: Vec<Sample> = Vec::new();
    let mut next_place = 0;
    // Warm up: spread the slots.
    let policy = arg("policy", 1e9);
    let begun = Instant::now();
    let mut passes: Vec<Pass2> = slots.iter().map(|_| net.pass(Purpose::Inference)).collect();
    let mut works: Vec<Workspace<f32>> = (0..batch).map(|_| Workspace::new()).collect();
    let mut grads = vec![vec![0.0_f32; net.weights.len()]; batch];
    let mut packed = net
        .network
        .pack(&net.weights, Purpose::Training, Instructions::Detected);
    let mut step = 0_u64;
    let mut mean = 0.0;
    let mut means = 0.0;
    let mut drawn = 0.0;
    let mut made = 0.0;
    let mut evaluated = 0;
    let mut average = net.weights.clone();
    loop {
        let minutes_now = begun.elapsed().as_secs_f64() / 60.0;
        if minutes_now > minutes {
            break;
        }
        let ready = (minutes_now - policy) / (minutes - policy).max(1e-9);
        let longest = if ready <= 0.0 {
            0
        } else {
            (2.0 + 150.0 * ready) as usize
        };
        // Data.
        while store.len() < 400 || drawn >= made * reuse {
            if net.norm.is_some() {
                for p in &mut passes {
                    net.network.repack(&net.weights, &mut p.packed);
                }
            }
            let got: Vec<Option<Sample>> = slots
                .par_iter_mut()
                .zip(&mut passes)
                .map(|(s, p)| s.advance(&stages, &base, teach, &net, p, longest))
                .collect();
            for s in got.into_iter().flatten() {
                made += 1.0;
                if store.len() < keep {
                    store.push(s);
                } else {
                    store[next_place % keep] = s;
                    next_place += 1;
                }
            }
            if store.len() < 400 {
                drawn = made * reuse - 1.0;
            }
        }
        if net.norm.is_none() && store.len() >= 400 {
            let mut n = RunningStatistics::new(&[3, 3, 3, 3, 3, 3, 1, 1]);
            let mut e = RunningStatistics::new(&[3, 3, 3, 3, 3, 2, 2, 2, 1, 1, 1]);
            let mut t = RunningStatistics::new(&[3, 3]);
            for s in &store {
                n.add(&s.nodes);
                e.add(&s.arcs);
                t.add(&s.target);
            }
            let freeze = |s: &RunningStatistics| s.freeze();
            net.norm = Some(Normalizers {
                nodes: freeze(&n),
                edges: freeze(&e),
                acceleration: freeze(&t),
            });
            println!(
                "data after {:.0} s, target deviation {:?}",
                begun.elapsed().as_secs_f64(),
                net.norm.as_ref().unwrap().acceleration.deviation()
            );
        }
        if arg("linear", 0.0) > 0.0 && store.len() >= 400 {
            let n = net.norm.as_ref().unwrap();
            for neighbours in [false, true] {
                let w = if neighbours { 41 } else { 21 };
                let mut a = vec![vec![0.0_f64; w]; w];
                let mut b = vec![[0.0_f64; 6]; w];
                let mut tt = [0.0_f64; 6];
                let fit = 300;
                let mut left = [0.0_f64; 6];
                let mut solved: Vec<[f64; 6]> = vec![];
                for (i, s) in store.iter().enumerate() {
                    if i == fit {
                        // solve
                        for r in 0..w {
                            a[r][r] += 1e-6;
                        }
                        let mut m = a.clone();
                        let mut y = b.clone();
                        for p in 0..w {
                            for r in 0..w {
                                if r != p {
                                    let f = m[r][p] / m[p][p];
                                    for c in 0..w {
                                        let t = m[p][c];
                                        m[r][c] -= f * t;
                                    }
                                    for c in 0..6 {
                                        let t = y[p][c];
                                        y[r][c] -= f * t;
                                    }
                                }
                            }
                        }
                        solved = (0..w)
                            .map(|r| std::array::from_fn(|c| y[r][c] / m[r][r]))
                            .collect();
                    }
                    let st = &stages[s.stage];
                    let (mut nodes, mut target) = (s.nodes.clone(), s.target.clone());
                    n.nodes.normalize(&mut nodes);
                    n.acceleration.normalize(&mut target);
                    squash(&mut nodes);
                    squash(&mut target);
                    let g = st.graph.connectivity();
                    for v in 0..st.rest.len() {
                        if st.graph.handle_mask()[v] {
                            continue;
                        }
                        let mut row: Vec<f64> = nodes[20 * v..20 * v + 20]
                            .iter()
                            .map(|&x| f64::from(x))
                            .collect();
                        row.push(1.0);
                        if neighbours {
                            let arcs = g.first_arc()[v] as usize..g.first_arc()[v + 1] as usize;
                            let k = arcs.len() as f64;
                            for c in 0..20 {
                                let m: f64 = arcs
                                    .clone()
                                    .map(|a| f64::from(nodes[20 * g.senders()[a] as usize + c]))
                                    .sum::<f64>()
                                    / k;
                                row.push(m);
                            }
                        }
                        let t: [f64; 6] = std::array::from_fn(|c| f64::from(target[6 * v + c]));
                        if i < fit {
                            for r in 0..w {
                                for c in 0..w {
                                    a[r][c] += row[r] * row[c];
                                }
                                for c in 0..6 {
                                    b[r][c] += row[r] * t[c];
                                }
                            }
                        } else {
                            for c in 0..6 {
                                let y: f64 = (0..w).map(|r| row[r] * solved[r][c]).sum();
                                left[c] += (t[c] - y).powi(2);
                                tt[c] += t[c] * t[c];
                            }
                        }
                    }
                }
                println!(
                    "linear, neighbours {neighbours}: unexplained {:?}",
                    std::array::from_fn::<f64, 6, _>(|c| (100.0 * left[c] / tt[c]).round())
                );
            }
            break;
        }
        let norm = net.norm.as_ref().unwrap();
        let picks: Vec<usize> = (0..batch)
            .map(|_| rng.random_range(0..store.len()))
            .collect();
        drawn += batch as f64;
        net.network.repack(&net.weights, &mut packed);
        let losses: Vec<f64> = picks
            .par_iter()
            .zip(&mut works)
            .zip(&mut grads)
            .map(|((&p, work), grad)| {
                let s = &store[p];
                let st = &stages[s.stage];
                let (mut nodes, mut arcs, mut target) =
                    (s.nodes.clone(), s.arcs.clone(), s.target.clone());
                norm.nodes.normalize(&mut nodes);
                norm.edges.normalize(&mut arcs);
                norm.acceleration.normalize(&mut target);
                squash(&mut nodes);
                squash(&mut arcs);
                squash(&mut target);
                let carried = Carried {
                    input: Input {
                        nodes: &nodes,
                        arcs: &arcs,
                    },
                    state: &EncoderState::new(),
                };
                let y = net
                    .network
                    .forward_carried(
                        &packed,
                        st.graph.connectivity(),
                        carried,
                        Pass::Training(None),
                        work,
                    )
                    .to_vec();
                let n = st.rest.len();
                let mut loss = 0.0;
                let mut g = vec![0.0_f32; y.len()];
                let scale = 1.0 / (6.0 * n as f64);
                for v in 0..n {
                    if st.graph.handle_mask()[v] {
                        continue;
                    }
                    for c in 0..6 {
                        let d = f64::from(y[6 * v + c] - target[6 * v + c]);
                        loss += scale * d * d;
                        g[6 * v + c] = (2.0 * scale * d / batch as f64) as f32;
                    }
                }
                let w = (3.0 / loss).min(1.0) as f32;
                g.iter_mut().for_each(|g| *g *= w);
                grad.fill(0.0);
                net.network.backward_carried(
                    &packed,
                    st.graph.connectivity(),
                    carried,
                    Gradients::new(&g, grad),
                    work,
                );
                loss
            })
            .collect();
        let mut sum = vec![0.0_f32; net.weights.len()];
        for g in &grads {
            for (s, g) in sum.iter_mut().zip(g) {
                *s += g;
            }
        }
        clip_norm(&mut sum, 1.0);
        let progress = minutes_now / minutes;
        let lr = rate
            * (0.02 + 0.98 * 0.5 * (1.0 + (std::f64::consts::PI * progress).cos()))
            * ((step as f64 + 1.0) / 200.0).min(1.0);
        adam.step(&mut net.weights, &sum, lr);
        let share = 1.0 - (0.999_f64.min((1.0 + step as f64) / (10.0 + step as f64))) as f32;
        for (a, w) in average.iter_mut().zip(&net.weights) {
            *a += share * (w - *a);
        }
        step += 1;
        mean += losses.iter().sum::<f64>() / batch as f64;
        means += 1.0;
        if step % 200 == 0 {
            println!(
                "step {step} {:.1} min loss {:.4} samples {made}",
                minutes_now,
                mean / means
            );
            mean = 0.0;
            means = 0.0;
        }
        let due = (minutes_now / arg("every", 4.0)) as usize;
        if due > evaluated {
            evaluated = due;
            let averaged = Net {
                network: net.network.clone(),
                weights: average.clone(),
                norm: net.norm.clone(),
            };
            say("corrected", &exams, &|e| {
                e.run(
                    base.substeps,
                    base.integrator,
                    base.forgets,
                    Some(&averaged),
                )
            });
        }
    }
    let averaged = Net {
        network: net.network.clone(),
        weights: average.clone(),
        norm: net.norm.clone(),
    };
    say("corrected, end", &exams, &|e| {
        e.run(
            base.substeps,
            base.integrator,
            base.forgets,
            Some(&averaged),
        )
    });
    let mut pass = averaged.pass(Purpose::Inference);
    let mut cols = CorrectionColumns::new(&base_stage.graph, base_stage.stiffness, 1.0 / 60.0);
    let t = &exams[0].truth;
    let (mut a, mut b, mut y) = (1e9_f64, 1e9_f64, Vec::new());
    for i in 0..200 {
        let f = PredictedFrame {
            before: Some(t[99 + i % 50].r()),
            last: t[100 + i % 50].r(),
            predicted: t[101 + i % 50].r(),
            wind: DVec3::ZERO,
            gravity: DVec3::ZERO,
            held: base_stage.graph.handle_mask(),
        };
        let n = Instant::now();
        cols.write(&base_stage.graph, &f, HalfTurns::default());
        a = a.min(n.elapsed().as_secs_f64() * 1e3);
        let n = Instant::now();
        averaged.correct(&mut pass, &base_stage, &cols, &mut y);
        b = b.min(n.elapsed().as_secs_f64() * 1e3);
    }
    println!("columns {a:.3} ms, network {b:.3} ms");
    let model = Model::new(
        &spec,
        averaged.weights,
        averaged.norm.unwrap(),
        "trial".into(),
    )
    .unwrap();
    let name = std::env::args().find_map(|a| a.strip_prefix("out=").map(str::to_owned));
    if let Some(name) = name {
        std::fs::write(name, model.to_bytes().unwrap()).unwrap();
    }
}
