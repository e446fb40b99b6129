//! The reckoning grows as it must, and what is beyond what there is, is refused with its cause.

use selvedge_data::SectionRule;
use selvedge_model::{Encoder, ModelSpec};

use super::*;
use crate::schedule::UnrollFrames;
use crate::test_data::{ENGINE, config, swinging, two_cloths};
use crate::trainer::{TrainError, Trainer};

const ON_PROCESSOR: Arithmetic = Arithmetic::OnProcessor { micro_batch: 1 };

fn slots(micro_batch: usize, change: impl Fn(&mut TrainConfig)) -> f64 {
    let mut cfg = config(Encoder::Gru { window: 3 });
    change(&mut cfg);
    let data = two_cloths();
    let set = TrainingSet::load(&data.dataset).expect("a set");
    Need::default()
        .with_slots(&cfg, &set, Arithmetic::OnProcessor { micro_batch })
        .slots
}

#[test]
fn slots_need_as_much_as_there_are_samples_and_as_the_largest_cloth_takes() {
    let with = |samples: usize, micro_batch: usize| {
        slots(micro_batch, move |cfg| cfg.batch.samples = samples)
    };
    assert_eq!(with(6, 1), 6.0 * with(1, 1));
    assert_eq!(
        with(6, 2),
        with(6, 6),
        "micro-batches share, they do not multiply"
    );
    let of = |plans: &[crate::test_data::Plan<'_>]| {
        let data = swinging(plans, SectionRule::Whole);
        let set = TrainingSet::load(&data.dataset).expect("a set");
        let need = Need::default().with_slots(&config(Encoder::MLP), &set, ON_PROCESSOR);
        need.slots
    };
    let (small, large) = (("a", 9, 14), ("b", 12, 11));
    assert_eq!(of(&[small, large]), of(&[large]));
    assert!(of(&[small]) < of(&[large]));
}

#[test]
fn frames_that_are_learned_through_are_kept_for_every_micro_batch() {
    let with = |frames: usize, micro_batch: usize| {
        slots(micro_batch, move |cfg| {
            cfg.batch.samples = 4;
            cfg.unroll = UnrollFrames::Constant { frames };
        })
    };
    // Linear in the frames from two on, with a slope for each micro-batch.
    let slope = |micro_batch| with(3, micro_batch) - with(2, micro_batch);
    assert_eq!(with(12, 1) - with(2, 1), 10.0 * slope(1));
    assert_eq!(slope(1), 4.0 * slope(4));
}

#[test]
fn a_network_of_known_size_needs_what_a_hand_counts() {
    let mut cfg = config(Encoder::MLP);
    cfg.model = ModelSpec::mesh_graph_nets(4, 2);
    cfg.batch.samples = 5;
    let on = Arithmetic::OnProcessor { micro_batch: 2 };
    // 12 columns of a vertex and 7 of an arc. Of a vertex: encoder 13, two blocks of 8 + 13,
    // decoder 8, 4 and twice 8, output 3; of an arc: 13, two blocks of 4 + 13, twice 4.
    let (vertex, arc) = (13 + 42 + 8 + 20 + 3, 13 + 34 + 8);
    let numbers = (vertex + 12 + 6) * 10 + (arc + 7) * 30;
    // Two frames of history, a reference and three positions in f64, twice; the history of the
    // slot.
    let positions = 2 * (2 * 12 * 10 + 12 * 10 + 3 * 24 * 10) + 2 * 12 * 10;
    assert_eq!(
        of_slots(&cfg, 2, 10, 30),
        f64::from(5 * (4 * numbers + positions))
    );
    let network = Network::new(&cfg.model).expect("a network");
    let data = two_cloths();
    let need = Need::before_reading(&cfg, &network, &data.dataset, on);
    // Three micro-batches; 14 frames of 9 vertices and 11 of 12.
    let weights = (8 + 3 + 3) * 4 * network.parameter_count();
    assert_eq!(need.weights, weights as f64);
    assert_eq!(need.trajectories, f64::from(12 * (14 * 9 + 11 * 12)));
}

#[test]
fn what_a_device_keeps_is_not_reckoned_here() {
    let data = two_cloths();
    let set = TrainingSet::load(&data.dataset).expect("a set");
    let needed = |change: fn(&mut TrainConfig)| {
        let mut cfg = config(Encoder::Gru { window: 3 });
        cfg.batch.samples = 4;
        change(&mut cfg);
        let network = Network::new(&cfg.model).expect("a network");
        let need = |on| {
            let need = Need::before_reading(&cfg, &network, &data.dataset, on);
            need.with_slots(&cfg, &set, on)
        };
        [ON_PROCESSOR, Arithmetic::OnDevice].map(need)
    };
    let [processor, device] = needed(|_| ());
    assert_eq!(device.trajectories, processor.trajectories);
    // Without those packed and the gradients of four micro-batches: 8 of 15 copies.
    assert_eq!(15.0 * device.weights, 8.0 * processor.weights);
    // Neither blocks nor frames that are learned through are kept, but samples show what they show.
    let [_, larger] = needed(|cfg| {
        cfg.model.blocks *= 10;
        cfg.unroll = UnrollFrames::Constant { frames: 50 };
    });
    assert_eq!(larger.slots, device.slots);
    let [_, more] = needed(|cfg| cfg.batch.samples = 8);
    assert_eq!(more.slots, 2.0 * device.slots);
}

#[test]
fn what_does_not_fit_is_refused_with_its_cause() {
    let cfg = config(Encoder::MLP);
    let need = Need {
        trajectories: GIB,
        weights: 2.0 * GIB,
        slots: 4.5 * GIB,
    };
    assert_eq!(need.check_against(&cfg, 7.5 * GIB), Ok(()));
    let error = need.check_against(&cfg, 7.4 * GIB).expect_err("too much");
    let text = error.to_string();
    let expected = "needs about 7.5 GiB of memory (4.5 GiB for 3 samples per step, 2.0 GiB for the weights and what goes with them, 1.0 GiB for the trajectories), but there are 7.4 GiB: lower batch.samples";
    assert!(text.contains(expected), "{text}");
}

#[test]
fn a_training_that_no_machine_has_room_for_is_an_error() {
    let data = two_cloths();
    type Edit = fn(&mut TrainConfig);
    // Numbers within their own bounds: petabytes of weights, or of frames to learn through.
    let edits: [Edit; 2] = [
        |cfg| {
            cfg.model.latent = 4096;
            cfg.model.blocks = 256;
            cfg.batch.samples = 65_536;
        },
        |cfg| {
            cfg.model.latent = 1024;
            cfg.model.blocks = 100;
            cfg.batch.samples = 65_536;
            cfg.unroll = UnrollFrames::Constant { frames: 1000 };
            cfg.losses.kinetic_energy = 0.0;
        },
    ];
    for edit in edits {
        let mut cfg = config(Encoder::MLP);
        edit(&mut cfg);
        let error = Trainer::new(cfg, &data.dataset, &ENGINE)
            .err()
            .expect("too much");
        assert!(matches!(error, TrainError::Memory(_)), "{error}");
    }
}

#[test]
fn the_least_that_the_system_says_counts() {
    let text = "MemFree:  1 kB\nMemTotal:       32768 kB\n";
    assert_eq!(machine(text), Some(32.0 * 1024.0 * 1024.0));
    let limits =
        "Limit  Soft Limit  Hard Limit  Units\nMax address space  8589934592  unlimited  bytes\n";
    assert_eq!(address_space(limits), Some(8.0 * GIB));
    let limits = limits.replace("8589934592", "unlimited");
    assert_eq!(address_space(&limits), None);
    assert_eq!(control_group("1073741824\n"), Some(GIB));
    assert_eq!(control_group("max\n"), None);
    assert_eq!(
        [machine(""), address_space(""), control_group("")],
        [None; 3]
    );
    assert!(available_memory() > 0.0);
}
