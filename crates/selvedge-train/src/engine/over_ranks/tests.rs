//! A training on any number of ranks has the bytes of a training on one.

use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use selvedge_cloth::Stop;
use selvedge_cluster::threads;
use selvedge_model::Encoder;

use super::*;
use crate::test_data::{ENGINE, Swinging, busy, config, saved, stepped, through, two_cloths};
use crate::trainer::{TrainError, Trainer};

/// A configuration whose slots go on from predictions, in five pieces.
fn five_pieces(encoder: Encoder) -> TrainConfig {
    let mut cfg = busy(encoder);
    cfg.batch.samples = 9;
    cfg
}

/// What `work` gives on each of so many ranks.
fn on_all<R: Send>(count: usize, work: impl Fn(Ranks) -> R + Sync) -> Vec<R> {
    thread::scope(|scope| {
        let (work, ranks) = (&work, threads(count).into_iter());
        let all: Vec<_> = ranks.map(|rank| scope.spawn(move || work(rank))).collect();
        all.into_iter().map(|rank| rank.join().unwrap()).collect()
    })
}

/// Trains up to step `steps` on so many ranks, from the checkpoint in `from` if there is one; gives
/// the bytes of the checkpoint that rank 0 has written to `to`.
fn trained(data: &Swinging, cfg: &TrainConfig, count: usize, names: [Option<&str>; 2]) -> Vec<u8> {
    let [from, to] = names.map(|name| name.map(|name| data.folder.path().join(name)));
    let train = |ranks: Ranks| {
        let engine = OverRanks {
            engine: &ENGINE,
            ranks: ranks.clone(),
        };
        let mut trainer = match &from {
            Some(from) => Trainer::resume(cfg.clone(), &data.dataset, from, &engine).unwrap(),
            None => Trainer::new(cfg.clone(), &data.dataset, &engine).unwrap(),
        };
        while trainer.steps_done() < cfg.steps {
            trainer.step().unwrap();
        }
        trainer.collect().unwrap();
        if ranks.is_first() {
            let to: &PathBuf = to.as_ref().unwrap();
            trainer.save(to).unwrap();
        }
        trainer.learned().clone()
    };
    let all: Vec<Learned> = on_all(count, train);
    assert!(
        all.iter().all(|learned| *learned == all[0]),
        "{count} ranks"
    );
    std::fs::read(to.unwrap()).unwrap()
}

#[test]
fn any_number_of_ranks_gives_the_bytes_of_one_with_a_resume_on_another_number() {
    let data = two_cloths();
    let cases = [
        ("perceptrons", five_pieces(Encoder::MLP)),
        ("recurrent", five_pieces(Encoder::Gru { window: 3 })),
        ("several frames", through(3, five_pieces(Encoder::MLP))),
    ];
    for (name, mut cfg) in cases {
        cfg.steps = 10;
        let whole = trained(&data, &cfg, 1, [None, Some("whole")]);
        // Without ranks at all.
        let alone = stepped(cfg.clone(), &data.dataset, 10);
        assert!(saved(&alone, &data, "alone").1 == whole);
        for (count, then) in [(2, 3), (3, 1), (4, 5), (5, 2)] {
            cfg.steps = 4;
            trained(&data, &cfg, count, [None, Some("half")]);
            cfg.steps = 10;
            let resumed = trained(&data, &cfg, then, [Some("half"), Some("resumed")]);
            assert!(resumed == whole, "{name}: {count} ranks, then {then}");
        }
    }
}

/// A rank that is asked to stop says so to the others, at whatever moment it hears of it.
#[test]
fn where_one_rank_gives_a_step_up_all_do_and_all_go_on_from_before_it() {
    let data = two_cloths();
    let mut cfg = five_pieces(Encoder::MLP);
    cfg.steps = 8;
    let whole = trained(&data, &cfg, 1, [None, Some("whole")]);
    let path = data.folder.path().join("given-up");
    let train = |ranks: Ranks| {
        let engine = OverRanks {
            engine: &ENGINE,
            ranks: ranks.clone(),
        };
        let mut trainer = Trainer::new(cfg.clone(), &data.dataset, &engine).unwrap();
        let mut given_up = Vec::new();
        for wait in [0, 0, 50, 200, 1000, 3000].map(Duration::from_micros) {
            let stop = Stop::default();
            trainer.stop_by(stop.clone());
            if ranks.rank() == 1 && wait.is_zero() {
                stop.ask();
            }
            thread::scope(|scope| {
                if ranks.rank() == 1 {
                    scope.spawn(|| {
                        thread::sleep(wait);
                        stop.ask();
                    });
                }
                if trainer.steps_done() < cfg.steps {
                    match trainer.step() {
                        Ok(_) => {}
                        Err(TrainError::Stopped { step }) => given_up.push(step),
                        Err(error) => panic!("{error}"),
                    }
                }
            });
        }
        trainer.stop_by(Stop::default());
        while trainer.steps_done() < cfg.steps {
            trainer.step().unwrap();
        }
        trainer.collect().unwrap();
        if ranks.is_first() {
            trainer.save(&path).unwrap();
        }
        given_up
    };
    let given_up: Vec<Vec<u64>> = on_all(3, train);
    assert!(given_up[0].starts_with(&[1, 1]), "{given_up:?}");
    assert!(given_up.iter().all(|steps| *steps == given_up[0]));
    assert!(std::fs::read(path).unwrap() == whole);
}

/// The error of rank 0 where every rank makes a trainer of its own configuration.
fn error_of(count: usize, cfg: impl Fn(usize) -> TrainConfig + Sync) -> String {
    let data = two_cloths();
    let make = |ranks: Ranks| {
        let cfg = cfg(ranks.rank());
        let engine = OverRanks {
            engine: &ENGINE,
            ranks,
        };
        let made = Trainer::new(cfg, &data.dataset, &engine);
        made.err()
            .map_or_else(String::new, |error| error.to_string())
    };
    on_all(count, make).remove(0)
}

#[test]
fn more_ranks_than_pieces_and_other_configurations_are_refused() {
    let error = error_of(3, |_| TrainConfig {
        batch: crate::config::BatchConfig { samples: 4 },
        ..config(Encoder::MLP)
    });
    let words = [
        "work to 2 of 3 ranks",
        "rank 2 would have none",
        "batch.samples=6 or more",
    ];
    assert!(words.iter().all(|words| error.contains(words)), "{error}");
    let error = error_of(2, |rank| TrainConfig {
        seed: rank as u64,
        ..five_pieces(Encoder::MLP)
    });
    assert!(
        error.contains("rank 1 has another configuration"),
        "{error}"
    );
}
