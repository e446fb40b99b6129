//! The features of a device against those of the CPU engine.

use glam::{DVec3, Vec3};
use selvedge_cloth::{Environment, Handles};
use selvedge_model::{ClothGraph, Frames, ModelSpec, Place, Window, Yaw};

use super::*;
use crate::cloths::UnionSizes;
use crate::cloths::frames::FrameNumbers;
use crate::device::Precision;
use crate::kernels::{Program, Sizes};
use crate::schedule::Trace;
use crate::test_graphs::{cloth, device, full_specs, hanging, model, shaken};

/// A cloth that swings, and its last frames, oldest first.
struct Moving {
    graph: ClothGraph,
    positions: Vec<Vec<Vec3>>,
    yaw: Yaw,
}

impl Moving {
    fn new(graph: ClothGraph, history: usize) -> Self {
        let at = |frame: usize| {
            let angle = 0.2 + 0.05 * frame as f64;
            let turn = Yaw::from_angle(angle);
            let turned = graph.rest_positions().iter().map(|p| turn.to_world(*p));
            let moved: Vec<Vec3> = turned.map(|p| p + 0.01 * frame as f32 * Vec3::X).collect();
            shaken(&moved, 0.01, frame as u64)
        };
        let positions: Vec<Vec<Vec3>> = (0..history).map(at).collect();
        let newest = graph.handles().select(&positions[history - 1]);
        let yaw = graph.frame().yaw(&newest, graph.frame().rest_yaw());
        Self {
            graph,
            positions,
            yaw,
        }
    }
}

/// Normalised features of the CPU.
fn of_cpu(spec: &ModelSpec, cloths: &[Moving], norms: &Normalizers) -> Window {
    let graphs: Vec<&ClothGraph> = cloths.iter().map(|cloth| &cloth.graph).collect();
    let places = Place::side_by_side(&graphs);
    let mut window = Window::default();
    window.fit(spec, &places[0]);
    for (cloth, place) in cloths.iter().zip(&places) {
        let frames = Frames {
            positions: &cloth.positions,
            yaw: cloth.yaw,
        };
        window.write(spec, &cloth.graph, frames, place);
    }
    window.normalize(&norms.nodes, &norms.edges);
    window
}

/// The same of the device.
fn of_device(spec: &ModelSpec, cloths: &[Moving], norms: &Normalizers) -> [Vec<f32>; 2] {
    let device = device();
    let graphs: Vec<&ClothGraph> = cloths.iter().map(|cloth| &cloth.graph).collect();
    let sizes = UnionSizes::of(&graphs);
    let (mut plan, mut program) = (Plan::new(), Program::new(Sizes::of(spec)));
    crate::kernels::features::define(&mut program, spec);
    let arrays = ClothArrays::new(&mut plan, sizes);
    let frames = FrameArrays::new(&mut plan, spec, sizes);
    let normalizers = NormalizerArrays::new(&mut plan, spec);
    let network = selvedge_model::Network::new(spec).expect("a spec");
    let input = InputArrays::new(&mut plan, &network, &arrays.graph);
    let mut schedule = Schedule::new("features");
    let sources = FeatureSources {
        cloths: &arrays,
        frames: &frames,
        normalizers: &normalizers,
    };
    features(&mut schedule, sources, &input);
    let mut trace = Trace::new(&plan, program.sizes());
    let given = [
        arrays.regions(),
        frames.regions().to_vec(),
        normalizers.regions(),
    ]
    .concat();
    given.into_iter().for_each(|region| trace.give(region));
    trace.follow(&schedule).expect("a schedule");
    let mut loaded = device
        .load(&program, &plan, Precision::Full)
        .expect("kernels");
    arrays.upload(&mut *loaded, &graphs).expect("cloths");
    normalizers.upload(&mut *loaded, norms).expect("statistics");
    // The newest frame does not stand last in the ring.
    let (history, newest) = (spec.history(), 1);
    for frame in 0..history {
        let slot = (newest + frames.slots + 1 + frame - history) % frames.slots;
        let all = cloths.iter().flat_map(|cloth| &cloth.positions[frame]);
        let all: Vec<f32> = all.flat_map(|p| p.to_array()).collect();
        loaded.put(frames.slot(slot), &all).expect("positions");
    }
    let mut numbers = FrameNumbers::default();
    for cloth in cloths {
        let handles = cloth.graph.handles();
        let next = handles.select(&cloth.positions[history - 1]);
        numbers.add(&cloth.graph, cloth.yaw, &next);
    }
    numbers
        .upload(&mut *loaded, &frames, newest)
        .expect("numbers");
    let prepared = loaded.prepare(&schedule).expect("a schedule");
    loaded.run(prepared).expect("a run");
    [input.nodes, input.arcs].map(|region| loaded.get(region).expect("features"))
}

#[test]
fn a_window_of_several_cloths_is_that_of_the_cpu() {
    for spec in full_specs() {
        let norms = model(&spec, 1.0, 1).normalizers().clone();
        let none = Handles::new(&[], 16).expect("none");
        let free = hanging(4, 5).with_handles(none).expect("a cloth");
        let vacuum = Environment {
            air_drag: 0.0,
            air_density: 0.0,
            wind: DVec3::new(0.4, 0.1, -0.7),
            ..Environment::default()
        };
        let graphs = [
            cloth(5, 3),
            cloth(4, 4),
            ClothGraph::new(&free, vacuum, 60.0).expect("a graph"),
        ];
        let cloths = graphs.map(|graph| Moving::new(graph, spec.history()));
        let window = of_cpu(&spec, &cloths, &norms);
        let [nodes, arcs] = of_device(&spec, &cloths, &norms);
        for (found, expected) in [(nodes, &window.nodes), (arcs, &window.arcs)] {
            assert_eq!(found.len(), expected.len());
            for (number, (x, y)) in found.iter().zip(expected).enumerate() {
                // Ten times what f32 positions of 1 m are rounded by, in statistics of 0.1.
                assert!((x - y).abs() < 1e-5 * y.abs().max(1.0), "{number}: {x} {y}");
            }
        }
    }
}
