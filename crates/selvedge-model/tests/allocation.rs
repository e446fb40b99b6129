//! Frames after the first allocate nothing, on any thread.
//!
//! The counter is of the whole process, so this program has one test. Frames are taken on a thread
//! of the pool: from outside, the queue of the pool grows by a block every few dozen calls.
#![allow(unsafe_code, reason = "a counting allocator is an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DVec3, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::{Cloth, ClothArrays, Environment, HandleTargets, Handles, Stepper, Topology};
use selvedge_model::{
    ClothGraph, Encoder, LearnedStepper, Model, ModelSpec, Network, NodeFeature, Normalizer,
    Normalizers,
};

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn cloth() -> ClothGraph {
    let side = 16_u32;
    let mut faces = Vec::new();
    for row in 0..side - 1 {
        for column in 0..side - 1 {
            let a = row * side + column;
            faces.extend([[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]);
        }
    }
    let count = (side * side) as usize;
    let at = |v: u32| Vec2::new((v % side) as f32, (v / side) as f32) / 15.0;
    let material_coordinates: Vec<Vec2> = (0..side * side).map(at).collect();
    let rest = material_coordinates
        .iter()
        .map(|p| Vec3::new(p.x, -p.y, 0.0));
    let arrays = ClothArrays {
        rest_positions: rest.collect(),
        material_coordinates,
        vertex_mass: vec![1e-3; count],
        face_area: vec![2e-3; faces.len()],
    };
    let topology = Topology::new(count, &faces).expect("a sheet");
    let handles = Handles::new(&[0, side - 1], count).expect("two handles");
    let cloth = Cloth::new(topology, handles, arrays).expect("a cloth");
    ClothGraph::new(&cloth, Environment::default(), 60.0).expect("a graph")
}

fn model(encoder: Encoder) -> Model {
    let mut spec = ModelSpec::physical(encoder, 16, 2);
    spec.node_features.insert(NodeFeature::Acceleration);
    let network = Network::new(&spec).expect("a valid spec");
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let weights = network.initialise(&mut || rng.random::<f64>());
    let unit = |width| Normalizer::new(vec![0.0; width], vec![1.0; width]).expect("finite");
    let normalizers = Normalizers {
        nodes: unit(spec.node_width()),
        edges: unit(spec.edge_width()),
        acceleration: Normalizer::new(vec![0.0; 3], vec![1e-5; 3]).expect("finite"),
    };
    Model::new(&spec, weights, normalizers, String::new()).expect("a model")
}

#[test]
fn frames_after_the_first_allocate_nothing() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
    let pool = pool.expect("a pool");
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let graph = cloth();
        let rest = graph.rest_positions().to_vec();
        let ends: Vec<DVec3> = graph
            .handles()
            .select(&rest)
            .iter()
            .map(|p| p.as_dvec3())
            .collect();
        let targets = HandleTargets::at_frame_end(ends).expect("finite targets");
        let mut stepper =
            LearnedStepper::new(Arc::new(model(encoder)), graph, &[&rest]).expect("a start");
        pool.install(|| {
            for _ in 0..3 {
                stepper.step(&targets).expect("a frame");
            }
            // On a busy machine the second thread takes its first partition frames later, and has
            // its own queue then: a few rounds until no frame allocates.
            let mut round = || {
                let before = ALLOCATIONS.load(Ordering::Relaxed);
                for _ in 0..20 {
                    stepper.step(&targets).expect("a frame");
                }
                ALLOCATIONS.load(Ordering::Relaxed) - before
            };
            assert!((0..8).any(|_| round() == 0), "{encoder:?}");
        });
    }
}
