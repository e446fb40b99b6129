//! The kernels of a frame's motion against their reference, `selvedge_model::advance`.

use glam::Vec3;
use selvedge_model::{
    ClothGraph, Encoder, LocalAcceleration, Model, ModelSpec, TwoFrames, Yaw, advance,
};

use super::RolloutPlan;
use crate::cloths::features::FeatureSources;
use crate::cloths::frames::FrameNumbers;
use crate::cloths::{UnionSizes, motion};
use crate::device::Precision;
use crate::schedule::Schedule;
use crate::test_graphs::{cloth, device, model, numbers, shaken};

/// Two frames of a cloth and the way of its handles.
struct Cloth {
    graph: ClothGraph,
    frames: Vec<Vec<Vec3>>,
    next_handles: Vec<Vec3>,
    yaw: Yaw,
}

fn moving(side: usize, seed: u64, history: usize) -> Cloth {
    let graph = cloth(side, seed);
    let rest = graph.rest_positions();
    let frames: Vec<Vec<Vec3>> = (0..history as u64)
        .map(|k| shaken(rest, 0.004, seed + k))
        .collect();
    let turn = Yaw::from_angle(0.05);
    let handles = graph.handles().select(rest);
    let now = graph.handles().select(&frames[history - 1]);
    Cloth {
        next_handles: handles.iter().map(|p| turn.to_world(*p)).collect(),
        yaw: graph.frame().yaw(&now, graph.frame().rest_yaw()),
        frames,
        graph,
    }
}

/// The next frame of a cloth by the reference, after normalised accelerations `output`.
fn expected(model: &Model, cloth: &Cloth, output: &[f32]) -> Vec<Vec3> {
    let [.., previous, current] = &cloth.frames[..] else {
        unreachable!("two frames at least")
    };
    let mut rows = output.to_vec();
    model.normalizers().acceleration.denormalize(&mut rows);
    let acceleration = LocalAcceleration {
        yaw: cloth.yaw,
        rows: &rows,
    };
    let frames = TwoFrames {
        graph: &cloth.graph,
        previous,
        current,
    };
    let mut next = vec![Vec3::ZERO; current.len()];
    advance(&frames, &cloth.next_handles, acceleration, &mut next).expect("finite");
    next
}

/// The next frames of all cloths by the kernels.
fn found(model: &Model, cloths: &[Cloth], output: &[f32]) -> Vec<Vec3> {
    let device = device();
    let graphs: Vec<&ClothGraph> = cloths.iter().map(|cloth| &cloth.graph).collect();
    let mut plan = RolloutPlan::new(model.network(), UnionSizes::of(&graphs));
    let given = plan.plan.floats("accelerations", output.len());
    let mut schedule = Schedule::new("the motion");
    let from = FeatureSources {
        cloths: &plan.cloths,
        frames: &plan.frames,
        normalizers: &plan.normalizers,
    };
    motion::advance(&mut schedule, from, given);
    let loaded = device.load(&plan.program, &plan.plan, Precision::Full);
    let mut loaded = loaded.expect("room");
    plan.upload(&mut *loaded, model, &graphs).expect("room");
    let history = model.spec().history();
    for slot in 0..history {
        let rows = cloths.iter().flat_map(|cloth| &cloth.frames[slot]);
        let rows: Vec<f32> = rows.flat_map(|p| p.to_array()).collect();
        loaded.put(plan.frames.slot(slot), &rows).expect("room");
    }
    let mut numbers = FrameNumbers::default();
    for cloth in cloths {
        numbers.add(&cloth.graph, cloth.yaw, &cloth.next_handles);
    }
    let uploaded = numbers.upload(&mut *loaded, &plan.frames, history - 1);
    uploaded.expect("room");
    loaded.put(given, output).expect("room");
    let prepared = loaded.prepare(&schedule).expect("a schedule");
    loaded.run(prepared).expect("a run");
    let next = loaded.get(plan.frames.slot(history)).expect("positions");
    let rows = next.as_chunks::<3>().0.iter();
    rows.map(|p| Vec3::from_array(*p)).collect()
}

fn compare(spec: &ModelSpec, size: f32) {
    let model = model(spec, 1.0, 7);
    let cloths = [moving(5, 1, spec.history()), moving(4, 2, spec.history())];
    let counts = cloths
        .each_ref()
        .map(|cloth| 3 * cloth.graph.vertex_count());
    let output = numbers(counts.iter().sum(), size, 3);
    let found = found(&model, &cloths, &output);
    let (first, second) = output.split_at(counts[0]);
    let expected = [
        expected(&model, &cloths[0], first),
        expected(&model, &cloths[1], second),
    ]
    .concat();
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(&expected) {
        // Half a dozen roundings of positions of 1 m.
        let off = found.distance(*expected);
        assert!(off < 1e-6, "{off} m off");
    }
}

#[test]
fn the_kernels_of_motion_lead_where_the_reference_does() {
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        compare(&ModelSpec::physical(encoder, 8, 1), 0.02);
    }
}
