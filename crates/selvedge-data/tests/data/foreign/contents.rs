//! What of a foreign folder is taken, that nothing is left out unseen, and numbers that no cloth
//! has.

use selvedge_data::foreign::Purpose;

use super::*;

#[test]
fn folders_that_would_be_left_out_unseen_are_named() {
    let said = |change: &dyn Fn(&Path)| {
        let folder = copy_of("released");
        change(folder.path());
        open(ForeignFormat::Released, folder.path(), &released_options())
    };
    let lost = |folder: &Path| fs::remove_file(folder.join("side/cloth_pos.npy")).unwrap();
    let error = said(&lost).unwrap_err();
    assert!(error.contains("side: has no file cloth_pos.npy"), "{error}");
    let error = said(&|folder| {
        lost(folder);
        fs::create_dir(folder.join("side/cloth_pos.npy")).unwrap();
    })
    .unwrap_err();
    assert!(error.contains("side: has no file cloth_pos.npy"), "{error}");
    let error = said(&|folder| {
        fs::create_dir(folder.join("train")).unwrap();
        fs::rename(folder.join("forward"), folder.join("train/forward")).unwrap();
    })
    .unwrap_err();
    assert!(
        error.contains("side: stands beside train and test, and is neither"),
        "{error}"
    );
    // What other programs hide, and files, are no trajectories.
    let source = said(&|folder| {
        fs::create_dir(folder.join(".git")).unwrap();
        fs::write(folder.join("notes.txt"), "").unwrap();
    });
    assert_eq!(source.unwrap().runs().len(), 2);
}

#[test]
fn a_set_without_anything_to_train_on_is_wanted_or_an_error() {
    let testing = |options: ImportOptions| ImportOptions {
        purpose: Purpose::Testing,
        ..options
    };
    let folder = copy_of("flag_simple");
    let names = |source: ForeignSource| -> Vec<String> {
        source.runs().iter().map(|run| run.name.clone()).collect()
    };
    let flag = |options: &ImportOptions| open(ForeignFormat::FlagSimple, folder.path(), options);
    assert_eq!(
        names(flag(&testing(flag_options())).unwrap()),
        ["valid-0000"]
    );
    fs::remove_file(folder.path().join("train.tfrecord")).unwrap();
    let error = flag(&flag_options()).unwrap_err();
    assert!(error.contains("train.tfrecord is not there"), "{error}");
    assert_eq!(
        names(flag(&testing(flag_options())).unwrap()),
        ["valid-0000"]
    );
    fs::rename(
        folder.path().join("valid.tfrecord"),
        folder.path().join("train.tfrecord"),
    )
    .unwrap();
    let error = flag(&testing(flag_options())).unwrap_err();
    assert!(error.contains("has nothing to test on"), "{error}");

    let released =
        |options: &ImportOptions| open(ForeignFormat::Released, &fixture("released"), options);
    let all = ImportOptions {
        test: vec!["forward".to_owned(), "side".to_owned()],
        ..released_options()
    };
    let error = released(&all).unwrap_err();
    assert!(error.contains("nothing to train on: name fewer"), "{error}");
    assert_eq!(names(released(&testing(all)).unwrap()), ["forward", "side"]);
    let error = released(&testing(released_options())).unwrap_err();
    assert!(error.contains("nothing to test on: name some"), "{error}");
}

/// A .npy file of numbers of 8 bytes, as the format's version 1.0 has it.
fn npy(kind: &str, shape: &str, numbers: impl Iterator<Item = [u8; 8]>) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    let length = (10 + header.len() + 1).next_multiple_of(64);
    let header = format!("{header:<width$}\n", width = length - 11);
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(numbers.flatten());
    bytes
}

#[test]
fn faces_without_their_vertex_and_positions_out_of_this_world_are_named() {
    let whole = read_all(
        &open(
            ForeignFormat::Released,
            &fixture("released"),
            &released_options(),
        )
        .unwrap(),
    )
    .unwrap();
    let faces: Vec<i64> = whole[0]
        .topology()
        .face_indices()
        .concat()
        .iter()
        .map(|&v| v.into())
        .collect();
    let places: Vec<f64> = expected(0)
        .iter()
        .flat_map(|p| p.as_dvec3().to_array())
        .collect();
    let said = |name: &str, bytes: Vec<u8>| {
        let folder = copy_of("released");
        fs::write(folder.path().join("forward").join(name), bytes).unwrap();
        let source = open(ForeignFormat::Released, folder.path(), &released_options());
        read_all(&source.unwrap())
    };
    let faces_with = |at: usize, vertex: i64| {
        let mut faces = faces.clone();
        faces[at] = vertex;
        let numbers = faces.iter().map(|v| v.to_le_bytes());
        said("face.npy", npy("<i8", "(8, 3)", numbers))
    };
    let places_with = |at: usize, value: f64| {
        let mut places = places.clone();
        places[at] = value;
        let numbers = places.iter().map(|x| x.to_le_bytes());
        said("cloth_pos.npy", npy("<f8", "(3, 9, 3)", numbers))
    };
    assert_eq!(faces_with(0, faces[0]).unwrap(), whole);
    for vertex in [9, 4_000_000_000] {
        let error = faces_with(10, vertex).unwrap_err();
        let expected = format!("face 3 names vertex {vertex}, but there are 9 vertices");
        assert!(error.contains(&expected), "{error}");
    }
    assert_eq!(places_with(0, places[0]).unwrap(), whole);
    assert_ne!(places_with(3 * (9 + 4) + 1, 1e6).unwrap(), whole);
    for value in [1.1e6, -1e30, 1e300] {
        let error = places_with(3 * (9 + 4) + 1, value).unwrap_err();
        assert!(error.contains("frame 1: vertex 4 is at "), "{error}");
        assert!(error.contains("more than 1000000 m from"), "{error}");
    }
}

#[test]
fn a_released_mesh_that_is_clockwise_throughout_is_turned_round() {
    let folder = copy_of("released");
    let plain = open(ForeignFormat::Released, folder.path(), &released_options()).unwrap();
    let plain = read_all(&plain).unwrap().remove(0);
    for run in ["forward", "side"] {
        let rest = folder.path().join(run).join("rest.obj");
        let turned: String = fs::read_to_string(&rest)
            .unwrap()
            .lines()
            .map(|line| match line.strip_prefix("f ") {
                Some(corners) => {
                    let mut corners: Vec<&str> = corners.split_whitespace().collect();
                    corners.swap(1, 2);
                    format!("f {}\n", corners.join(" "))
                }
                None => format!("{line}\n"),
            })
            .collect();
        fs::write(&rest, turned).unwrap();
        let faces = folder.path().join(run).join("face.npy");
        let plain: Vec<[i64; 3]> = plain
            .cloth()
            .topology()
            .faces()
            .iter()
            .map(|face| face.map(|v| i64::from(v.0)))
            .collect();
        let turned = plain.iter().flat_map(|[a, b, c]| [*a, *c, *b]);
        let bytes = npy("<i8", "(8, 3)", turned.map(i64::to_le_bytes));
        fs::write(faces, bytes).unwrap();
    }
    let source = open(ForeignFormat::Released, folder.path(), &released_options()).unwrap();
    let found = read_all(&source).unwrap().remove(0);
    assert_eq!(found.cloth().topology(), plain.cloth().topology());
    assert_eq!(found.positions(), plain.positions());
    assert_eq!(
        found.cloth().material_coordinates(),
        plain.cloth().material_coordinates()
    );
}
