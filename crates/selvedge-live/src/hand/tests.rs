//! Hands keep their limits, arrive, and brake, whatever they are asked.

use super::*;
use proptest::prelude::*;

const DT: f64 = 1.0 / 60.0;

fn vector() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-2.0..2.0_f64).prop_map(DVec3::from_array)
}

proptest! {
    #[test]
    fn a_hand_keeps_its_limits_and_arrives(
        goals in prop::collection::vec((vector(), 1_usize..40), 1..5),
        speed in 0.1..4.0_f64,
        acceleration in 1.0..20.0_f64,
    ) {
        let limits = HandLimits::clamped(speed, acceleration);
        let mut hands = Hands::at(&[DVec3::ZERO]);
        let mut before = (DVec3::ZERO, DVec3::ZERO);
        let mut last = DVec3::ZERO;
        let mut check = |hands: &Hands| {
            let position = hands.positions()[0];
            let velocity = (position - before.0) / DT;
            let change = (velocity - before.1).length();
            before = (position, velocity);
            // Rounding of positions of metres over dt, and the last nanometre.
            velocity.length() <= limits.speed + 1e-6 && change <= limits.acceleration * DT + 1e-6
        };
        for (goal, frames) in goals {
            last = goal;
            hands.want(0, goal);
            for _ in 0..frames {
                hands.advance(&limits, DT);
                prop_assert!(check(&hands));
            }
        }
        // At most 7 m at a tenth of a metre per second, and some for turning round.
        for _ in 0..6000 {
            hands.advance(&limits, DT);
            prop_assert!(check(&hands));
        }
        prop_assert!(hands.positions()[0].distance(last) < 1e-6, "{:?}", hands);
    }

    #[test]
    fn keys_move_handles_as_one_body_within_the_limits(
        direction in vector(), turn in -1.0..1.0_f64, frames in 1_usize..120,
    ) {
        let limits = HandLimits::default();
        let start = [DVec3::new(0.0, 0.0, -0.5), DVec3::new(0.0, 0.2, 0.5), DVec3::X];
        let mut hands = Hands::at(&start);
        hands.push(Push { direction, turn });
        let mut before = hands.positions();
        for frame in 0..frames + 200 {
            if frame == frames {
                hands.push(Push::default());
            }
            hands.advance(&limits, DT);
            let now = hands.positions();
            for (p, q) in before.iter().zip(&now) {
                // A chord is shorter than its arc.
                prop_assert!(p.distance(*q) <= limits.speed * DT + 1e-9);
            }
            before = now;
        }
        // Rigid: distances stay. And at rest long after the keys are let go.
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let change = before[i].distance(before[j]) - start[i].distance(start[j]);
            prop_assert!(change.abs() < 1e-9);
        }
        prop_assert!(hands.is_at_rest());
    }
}

#[test]
fn the_default_limits_are_those_of_an_eased_metre_in_a_second() {
    // p(t) = (1 - cos(π t))/2: p' peaks at t = 1/2, p'' at t = 0.
    let limits = HandLimits::default();
    let p = |t: f64| (1.0 - (PI * t).cos()) / 2.0;
    let h = 1e-4;
    assert!(((p(0.5 + h) - p(0.5 - h)) / (2.0 * h) - limits.speed).abs() < 1e-6);
    let second = (p(h) - 2.0 * p(0.0) + p(-h)) / (h * h);
    assert!((second - limits.acceleration).abs() < 1e-5);
}

#[test]
fn hands_that_were_led_brake_within_their_limits() {
    let limits = HandLimits::default();
    let mut hands = Hands::at(&[DVec3::ZERO]);
    // A path at 1.2 m/s, left in its middle.
    for frame in 1..=30 {
        hands = hands.led_to(&[DVec3::X * (0.02 * f64::from(frame))], DT);
    }
    // Where it was wanted is forgotten.
    hands.want(0, DVec3::X * 9.0);
    hands.brake(&limits);
    let mut velocity = DVec3::X * (0.02 / DT);
    for _ in 0..200 {
        let before = hands.positions()[0];
        hands.advance(&limits, DT);
        let now = (hands.positions()[0] - before) / DT;
        assert!((now - velocity).length() <= limits.acceleration * DT + 1e-6);
        velocity = now;
    }
    assert!(hands.is_at_rest(), "{hands:?}");
    // v²/2a on.
    let way = hands.positions()[0].x - 0.6;
    let expected = 1.2 * 1.2 / (2.0 * limits.acceleration);
    assert!((way - expected).abs() < 0.02, "{way}");
}

#[test]
fn hands_that_come_apart_while_they_turn_keep_the_speed_limit() {
    let limits = HandLimits::default();
    let mut hands = Hands::at(&[DVec3::ZERO, DVec3::X * 0.004]);
    let (direction, turn) = (DVec3::ZERO, 0.5);
    hands.push(Push { direction, turn });
    for frame in 0..180 {
        if frame == 60 {
            hands.want(1, DVec3::X);
        }
        let reach = hands.reach();
        hands.advance(&limits, DT);
        let speed = hands.drift.length() + hands.spin.abs() * reach;
        assert!(speed <= limits.speed + 1e-9, "{speed} in frame {frame}");
    }
}

#[test]
fn a_hand_that_joins_those_that_turn_keeps_the_speed_limit() {
    let limits = HandLimits::default();
    let mut hands = Hands::at(&[DVec3::ZERO, DVec3::X * 0.004]);
    let (direction, turn) = (DVec3::ZERO, 1.0);
    hands.push(Push { direction, turn });
    (0..60).for_each(|_| hands.advance(&limits, DT));
    let mut places = hands.positions();
    places.push(DVec3::X);
    hands = hands.rearranged(&places, &[Some(0), Some(1), None]);
    for _ in 0..60 {
        let before = hands.positions();
        hands.advance(&limits, DT);
        for (p, q) in before.iter().zip(hands.positions()) {
            // A chord is shorter than its arc.
            assert!(p.distance(q) <= limits.speed * DT + 1e-9);
        }
    }
}

#[test]
fn hands_that_stay_keep_their_way() {
    let limits = HandLimits::default();
    let mut hands = Hands::at(&[DVec3::ZERO, DVec3::Z]);
    hands.want(1, DVec3::X);
    hands.advance(&limits, DT);
    let changed = hands.rearranged(&[DVec3::Y, DVec3::Z], &[None, Some(1)]);
    assert_eq!(changed.positions(), [DVec3::Y, hands.positions()[1]]);
    assert_eq!(changed.goals(), [DVec3::Y, DVec3::X]);
}

#[test]
fn hands_that_the_cloth_between_them_keeps_resist() {
    // Handles at two corners, with an edge of 1 m between them.
    let cloth = crate::test_cloth::cloth();
    let reach = Reach::of(&cloth, cloth.handles());
    assert!(reach.is_of(cloth.handles()));
    let most = reach.between(0, 1);
    assert!((most - 1.1).abs() < 1e-6, "{most}");
    let limits = HandLimits::default();
    let mut hands = Hands::at(&[DVec3::ZERO, DVec3::Z]);
    let apart = |hands: &Hands| {
        let at = hands.positions();
        at[0].distance(at[1])
    };
    hands.want(1, DVec3::new(0.0, 0.0, 4.0));
    for _ in 0..300 {
        let before = hands.positions();
        hands.advance_within(&limits, DT, &reach);
        assert!(apart(&hands) <= most + 1e-9, "{}", apart(&hands));
        // The hand that is not pulled stays.
        assert_eq!(hands.positions()[0], before[0]);
    }
    assert!(apart(&hands) > most - 1e-3, "{}", apart(&hands));
    // Round about the other one it goes on.
    hands.want(1, DVec3::new(0.0, 4.0, 0.0));
    for _ in 0..600 {
        hands.advance_within(&limits, DT, &reach);
        assert!(apart(&hands) <= most + 1e-9, "{}", apart(&hands));
    }
    assert!(hands.positions()[1].y > 1.0, "{:?}", hands.positions());
    // Within the cloth's length it arrives.
    let goal = DVec3::new(0.0, 0.3, 0.5);
    hands.want(1, goal);
    (0..600).for_each(|_| hands.advance_within(&limits, DT, &reach));
    assert!(hands.positions()[1].distance(goal) < 1e-9);
    // Many handles are not limited.
    let none = Reach::of(&cloth, &selvedge_cloth::Handles::new(&[], 4).unwrap());
    assert_eq!(none.between(0, 1), f64::INFINITY);
}
