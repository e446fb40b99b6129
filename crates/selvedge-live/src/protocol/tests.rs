//! The wire against garbage: whatever comes is either a message or a reason, and what we write has
//! the layout that is documented.

use super::*;
use crate::body::{Body, BodyKind};
use glam::{DVec3, Vec2, Vec3};
use proptest::prelude::*;
use selvedge_cloth::{Cloth, ClothArrays, Handles, Topology};

fn message(kind: u8, words: &[u32]) -> Vec<u8> {
    let mut bytes = vec![VERSION, kind, 0, 0];
    for word in words {
        bytes.extend_from_slice(&word.to_le_bytes());
    }
    bytes
}

fn word(bytes: &[u8], place: usize) -> u32 {
    u32::from_le_bytes(bytes[4 * place..4 * place + 4].try_into().unwrap())
}

proptest! {
    #[test]
    fn any_body_of_a_known_kind_is_a_message_or_a_reason(
        kind in 15_u8..21,
        body in prop::collection::vec(any::<u8>(), 0..100),
    ) {
        let mut bytes = vec![VERSION, kind, 0, 0];
        bytes.extend(body);
        match decode(&bytes) {
            Ok(ClientMessage::Drag(drag)) => {
                prop_assert!((1..=MOST_DRAGGED).contains(&drag.goals.len()));
                prop_assert!(drag.goals.iter().all(|(_, goal)| goal.abs().max_element() <= 1e3));
            }
            Ok(ClientMessage::Keys(push)) => {
                prop_assert!(push.direction.abs().max_element() <= 1.0 && push.turn.abs() <= 1.0);
            }
            Ok(_) => {}
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }

    #[test]
    fn a_drag_comes_through(
        number in any::<u32>(),
        goals in prop::collection::vec((any::<u32>(), prop::array::uniform3(-1e3_f32..1e3)), 1..20),
    ) {
        let mut words = vec![number, goals.len() as u32];
        for (vertex, goal) in &goals {
            words.push(*vertex);
            words.extend(goal.map(f32::to_bits));
        }
        let expected = Drag {
            number,
            goals: goals.iter().map(|(v, g)| (*v, Vec3::from_array(*g).as_dvec3())).collect(),
        };
        let bytes = message(kind::DRAG, &words);
        prop_assert_eq!(decode(&bytes).unwrap(), ClientMessage::Drag(expected));
        // One byte less or more is no drag.
        prop_assert!(decode(&bytes[..bytes.len() - 1]).is_err());
        prop_assert!(decode(&[&bytes[..], &[0]].concat()).is_err());
    }
}

/// A message with a command.
fn command(json: &str) -> Vec<u8> {
    [&message(kind::COMMAND, &[])[..], json.as_bytes()].concat()
}

#[test]
fn each_defect_has_its_reason() {
    let nan = f32::NAN.to_bits();
    for (bytes, words) in [
        (vec![], "the message has 0 bytes, its header alone has 4"),
        (vec![1, 16, 0, 0, 0, 0, 0, 0], "version 1"),
        (message(99, &[]), "kind 99"),
        (vec![VERSION, 16, 1, 0, 0, 0, 0, 0], "are 0"),
        (message(kind::READY, &[]), "has 8 bytes, found 4"),
        (message(kind::DRAG, &[1, u32::MAX]), "found 4294967295"),
        (message(kind::DRAG, &[1, 1, 0, nan, 0, 0]), "NaN"),
        (
            message(kind::KEYS, &[2.0_f32.to_bits(), 0, 0, 0]),
            "within 1",
        ),
        (vec![0; LONGEST + 1], "are the most"),
        (command(r#"{"do":"fly"}"#), "fly"),
        (command(r#"{"do":"seek","frame":1,"x":2}"#), "`x`"),
        (command(r#"{"do":"reset","x":2}"#), "`x`"),
    ] {
        let text = decode(&bytes).unwrap_err().to_string();
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn a_command_is_json() {
    let bytes = command(r#"{"do":"let-go","vertices":[3]}"#);
    let expected = Command::LetGo { vertices: vec![3] };
    assert_eq!(decode(&bytes).unwrap(), ClientMessage::Command(expected));
}

#[test]
fn cloths_and_frames_have_the_documented_layout() {
    let arrays = ClothArrays {
        rest_positions: vec![Vec3::ZERO; 3],
        material_coordinates: vec![Vec2::ZERO, Vec2::X, Vec2::new(0.0, 2.0)],
        vertex_mass: vec![1.0; 3],
        face_area: vec![1.0],
    };
    let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
    let of = Cloth::new(topology, Handles::new(&[1], 3).unwrap(), arrays).unwrap();
    let wedge = Body {
        name: "wedge".to_owned(),
        kind: BodyKind::Ball,
        points: 4,
        faces: vec![[0, 1, 3]],
    };
    let bytes = cloth(7, &of, &[wedge]);
    assert_eq!(bytes.len(), 20 + 2 * 12 + 24 + 4 + 24);
    let body = [0, 1, 2, 3, 4, 5, 6].map(|k| word(&bytes, 17 + k));
    assert_eq!(body, [1, 2, 4, 1, 0, 1, 3]);
    assert_eq!([0, 1, 2, 3].map(|k| word(&bytes, 1 + k)), [7, 3, 1, 3]);
    let faces = [0, 1, 2, 3, 4, 5].map(|k| word(&bytes, 5 + k));
    assert_eq!(faces, [0, 1, 2, 0, 1, 2]);
    assert_eq!(f32::from_bits(word(&bytes, 16)), 2.0);

    let track = [Vec3::X, Vec3::Y, Vec3::Z];
    let bytes = frame(&FrameParts {
        generation: 7,
        number: 9,
        time: 0.5,
        drag: [2, 11],
        goals: vec![(1, DVec3::new(0.0, -1.0, 0.0))],
        tracks: vec![&track, &track],
        bodies: vec![Vec3::splat(5.0)],
        gaps: vec![vec![0.25; 3], vec![0.5; 3]],
    });
    assert_eq!(bytes.len(), 44 + 16 + 2 * 36 + 12 + 24);
    let header = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map(|k| word(&bytes, 1 + k));
    assert_eq!(header, [7, 9, 0.5_f32.to_bits(), 2, 11, 1, 2, 3, 1, 6]);
    let number = |place| f32::from_bits(word(&bytes, place));
    assert_eq!(number(13), -1.0);
    assert_eq!(number(15), 1.0);
    assert_eq!([33, 36, 41].map(number), [5.0, 0.25, 0.5]);
}
