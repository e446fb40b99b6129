//! States are read as they were written, by any of the ways to name them.

use selvedge_cloth::{
    CaughtPair, ContactMemory, FrictionAnchor, Pushing, ReleasedContact, Still, Touching,
};

use super::*;
use crate::formats::npz::tests::{archive, floats, npy};
use crate::formats::tensor_file::TensorValues;
use crate::test_help::{provenance, says, table, with_header};

fn run() -> StateRun {
    let vector = |k: u32| DVec3::new(f64::from(k) / 3.0, 1e-17, -f64::from(k).sqrt());
    let vectors = |first: u32, state: u32| {
        let first = first + 2 * state;
        [first, first + 1].map(vector).to_vec()
    };
    let state = |k: u32| Checkpoint {
        positions: vectors(0, k),
        velocities: vectors(10, k),
        frame: 4 + k as usize,
        previous: (k > 0).then(|| PreviousSubstep {
            positions: vectors(20, k),
            velocities: vectors(30, k),
            seconds: 1.0 / f64::from(60 * k),
        }),
        contact: (k != 1).then(|| memory(2 - k / 2)),
        changes: (k != 1).then(|| (vectors(40, k), 1.0 / f64::from(120 + k))),
        obstacles: Vec::new(),
    };
    StateRun {
        states: (0..3).map(state).collect(),
    }
}

/// A memory of this many anchors, twice as many features that push, and two caught pairs.
fn memory(anchors: u32) -> ContactMemory {
    let vertex = |k: u32| Touching::Vertex {
        vertex: k,
        other: k / 2,
    };
    ContactMemory {
        anchors: (0..anchors)
            .map(|k| FrictionAnchor {
                of: vertex(k),
                normal: DVec3::new(0.6, 0.8, 0.0),
                pull: DVec3::new(1e-9, -f64::from(k) / 7.0, 0.1),
                pressed: f64::from(k) / 3.0,
            })
            .collect(),
        pushing: (0..2 * anchors)
            .map(|k| Pushing {
                of: vertex(k),
                firmly: k % 2 == 1,
            })
            .collect(),
        caught: [None, Some(2e-4)]
            .map(|gap| CaughtPair {
                of: Touching::Edges {
                    first: anchors,
                    second: 9 + u32::from(gap.is_some()),
                },
                gap,
            })
            .to_vec(),
        released: (1..anchors)
            .map(|k| ReleasedContact {
                vertex: k,
                body: 2,
                against: 1,
                parts: [7, 5],
                places: [DVec3::X * f64::from(k), DVec3::NEG_Y / 3.0],
                winding: -0.5,
            })
            .collect(),
        still: [3, 0]
            .map(|since| Still {
                since,
                place: DVec3::new(0.1, f64::from(since) / 7.0, -2.0),
            })
            .to_vec(),
    }
}

fn of(file: &str) -> StateChoice {
    StateChoice {
        file: file.to_owned(),
        ..StateChoice::default()
    }
}

fn at(file: &str, frame: usize) -> StateChoice {
    StateChoice {
        frame: Some(frame),
        ..of(file)
    }
}

fn error(folder: &Path, choice: &StateChoice, vertices: usize) -> String {
    let error = choice.read(folder, vertices).unwrap_err();
    let text = error.to_string();
    assert!(text.contains(&choice.file), "{text}");
    text
}

#[test]
fn every_bit_of_a_run_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let run = run();
    let path = folder.path().join("states.safetensors");
    run.write(&path, &provenance(60.0, "a test")).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(StateRun::from_bytes(&bytes).unwrap(), run);
    let at = |frame| at("states.safetensors", frame);
    for expected in &run.states {
        let (state, spec) = at(expected.frame).read(folder.path(), 2).unwrap();
        assert_eq!(state, *expected);
        assert_eq!(spec.blake3, hash(&bytes));
    }
    let problem = |frame, vertices| error(folder.path(), &at(frame), vertices);
    says(problem(7, 2), &["frames 4, 5, 6"]);
    says(problem(4, 3), &["positions: expected [3, 3]"]);
}

#[test]
fn checkpoints_of_an_archive_are_found_by_their_frames() {
    let folder = tempfile::tempdir().unwrap();
    let frames: Vec<u8> = [60_i32, 120].iter().flat_map(|f| f.to_le_bytes()).collect();
    let x: Vec<f64> = (0..12).map(|k| f64::from(k) * 0.1).collect();
    let v: Vec<f64> = x.iter().map(|x| -x).collect();
    let zip = archive(&[
        ("positions", floats("(1, 2, 3)", &x[..6])),
        ("ckpt_x", floats("(2, 2, 3)", &x)),
        ("ckpt_v", floats("(2, 2, 3)", &v)),
        ("ckpt_frames", npy("<i4", "(2,)", &frames)),
        ("rest_x", floats("(2, 3)", &x[6..])),
        ("rest_v", floats("(2, 3)", &v[6..])),
    ]);
    std::fs::write(folder.path().join("run.npz"), zip).unwrap();
    let read = |choice: &StateChoice| choice.read(folder.path(), 2);
    let (state, spec) = read(&at("run.npz", 120)).unwrap();
    assert_eq!((state.frame, spec.positions.as_str()), (120, "ckpt_x"));
    assert_eq!(state.positions[1], DVec3::from_slice(&x[9..]));
    let named = |positions: &str, velocities: &str| StateChoice {
        positions: Some(positions.into()),
        velocities: Some(velocities.into()),
        ..of("run.npz")
    };
    let (rest, _) = read(&named("rest_x", "rest_v")).unwrap();
    assert_eq!(rest.frame, 0);
    assert_eq!(rest.velocities, state.velocities);
    let problem = |choice| error(folder.path(), &choice, 2);
    let words = ["frames 60, 120: say which"];
    says(problem(of("run.npz")), &words);
    let none = StateChoice {
        frame: Some(60),
        ..named("ckpt_y", "ckpt_v")
    };
    let words = ["no array named ckpt_y (found ckpt_frames"];
    says(problem(none), &words);
}

#[test]
fn what_is_no_state_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("x.txt", b"");
    write("cut.npz", b"PK");
    write("cut.safetensors", b"12");
    let at_rest = floats("(1, 3)", &[0.0; 3]);
    let nan = floats("(1, 3)", &[0.0, f64::NAN, 0.0]);
    let fast = floats("(1, 3)", &[0.0, 1e30, 0.0]);
    let both = floats("(2, 1, 3)", &[0.0; 6]);
    let state = |name: &str, positions: &[u8], velocities: &[u8], frames: &[i32]| {
        let mut arrays = vec![
            ("positions", positions.to_vec()),
            ("velocities", velocities.to_vec()),
        ];
        if !frames.is_empty() {
            let bytes: Vec<u8> = frames.iter().flat_map(|f| f.to_le_bytes()).collect();
            let shape = format!("({},)", frames.len());
            arrays.push(("frames", npy("<i4", &shape, &bytes)));
        }
        write(name, &archive(&arrays));
    };
    state("nan.npz", &nan, &nan, &[]);
    state("fast.npz", &at_rest, &fast, &[]);
    state("few.npz", &both, &both, &[7]);
    state("twice.npz", &both, &both, &[7, 7]);
    write("alone.npz", &archive(&[("positions", at_rest)]));
    let cases = r#"
        x.txt | read from .npz or .safetensors
        cut.npz | no complete .npz archive
        cut.safetensors | no complete safetensors
        nan.npz | array positions: the entry of vertex 0 must be
        fast.npz | array velocities: the entry of vertex 0 must be
        few.npz | array frames: expected <i4 [2]
        twice.npz | array frames: frame 7 stands twice
        alone.npz | no velocities beside positions (found positions)
        none.npz | could not be read
    "#;
    for [path, named] in table(cases) {
        says(error(folder.path(), &of(path), 1), &[named]);
    }
}

/// [`run`] as written in `folder`, with `from` in the header become `to`.
fn write_edited(folder: &Path, from: &str, to: &str) {
    let path = folder.join("states.safetensors");
    run().write(&path, &provenance(60.0, "a test")).unwrap();
    let edited = with_header(&std::fs::read(&path).unwrap(), |header| {
        assert!(header.contains(from), "{from}: {header}");
        header.replace(from, to)
    });
    std::fs::write(&path, edited).unwrap();
}

#[test]
fn states_of_another_version_or_frame_rate_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at_rate = |rate: f64| StateChoice {
        frame_rate: Some(rate),
        ..at("states.safetensors", 5)
    };
    let read = |rate: f64| at_rate(rate).read(folder.path(), 2);
    let error_at = |rate: f64| read(rate).unwrap_err().to_string();
    write_edited(folder.path(), "selvedge-states", "selvedge-states");
    assert_eq!(read(60.0).unwrap().0.frame, 5);
    let words = ["was saved at 60 frames", "set frame_rate = 60"];
    says(error_at(120.0), &words);
    write_edited(folder.path(), r#""version":"1""#, r#""version":"2""#);
    says(error_at(60.0), &["version: expected 1, found \"2\""]);
    let bytes = std::fs::read(folder.path().join("states.safetensors")).unwrap();
    says(StateRun::from_bytes(&bytes).unwrap_err(), &["version"]);
    write_edited(folder.path(), r#""fps":"60""#, r#""fps":"6o""#);
    says(error_at(60.0), &["fps: expected a number"]);
    // What another program wrote says nothing of its frames.
    write_edited(folder.path(), "selvedge-states", "somebodys-array");
    assert_eq!(read(120.0).unwrap().0.frame, 5);
}

#[test]
fn a_shape_that_no_bytes_stand_behind_is_an_error_and_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.safetensors");
    let tensor = |name: &'static str| {
        TensorOut::new(name, &[1 << 61, 0, 3], TensorValues::F64(vec![].into()))
    };
    let tensors = ["positions", "velocities"].map(tensor);
    write_tensors(&path, &tensors, &std::collections::BTreeMap::new()).unwrap();
    for vertices in [0, 2] {
        let problem = error(folder.path(), &at("empty.safetensors", 0), vertices);
        says(problem, &["array positions: expected ["]);
    }
    let read = StateRun::from_bytes(&std::fs::read(&path).unwrap());
    says(read.unwrap_err(), &["a vertex at least"]);
}

#[test]
fn contact_that_does_not_fit_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("states.safetensors");
    let write = |name: &'static str, text: &str| {
        let at_rest = |name: &'static str| {
            TensorOut::new(name, &[1, 3], TensorValues::F64(vec![0.0; 3].into()))
        };
        let bytes = TensorValues::U8(text.as_bytes().into());
        let contact = TensorOut::new(name, &[text.len()], bytes);
        let tensors = [at_rest("positions"), at_rest("velocities"), contact];
        write_tensors(&path, &tensors, &std::collections::BTreeMap::new()).unwrap();
    };
    let memory = serde_json::to_string(&memory(2)).unwrap();
    let far = memory.replacen("0.6", "1e300", 1);
    for (name, text, word) in [
        ("contact", format!("[{memory}, null]"), "2 for 1 states"),
        ("contact", "[{}]".to_owned(), "missing field `anchors`"),
        ("contact", format!("[{memory}"), "EOF"),
        ("contact", format!("[{far}]"), "a number beyond"),
    ] {
        write(name, &text);
        says(error(folder.path(), &of("states.safetensors"), 1), &[word]);
    }
    write("contact", &format!("[{memory}]"));
    let (state, _) = of("states.safetensors").read(folder.path(), 1).unwrap();
    assert_eq!(state.contact, Some(self::memory(2)));
}
