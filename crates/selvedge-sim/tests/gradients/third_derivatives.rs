//! The laws over dual numbers: derivatives of a Jacobian's product, which are third derivatives of an
//! energy.

use glam::{DVec2, DVec3};
use selvedge_sim::laws::bend::angle_gradient;
use selvedge_sim::laws::number::{Dual, DualVector};
use selvedge_sim::laws::stretch::StretchElement;
use selvedge_sim::laws::stretch_energy::StretchEnergy;

use crate::scenes::{CAMEL, DENIM, GRAY, NAVY, material};

const REST: [DVec2; 3] = [
    DVec2::new(0.1, 0.2),
    DVec2::new(0.5, 0.1),
    DVec2::new(0.3, 0.6),
];

/// Corners stretched along both axes, so that no part of the stress is left out of the Jacobian.
fn stretched() -> [DVec3; 3] {
    REST.map(|c| DVec3::new(1.06 * c.x, 1.09 * c.y, 0.2 * c.x - 0.1 * c.y))
}

fn directions(from: usize) -> [DVec3; 3] {
    std::array::from_fn(|k| {
        let t = (from + k) as f64;
        DVec3::new((1.3 * t).sin(), (2.1 * t).cos(), (0.7 * t + 0.4).sin())
    })
}

fn dot<const N: usize>(a: [DVec3; N], b: [DVec3; N]) -> f64 {
    (0..N).map(|k| a[k].dot(b[k])).sum()
}

/// The derivative of J times `along` as the corners move by `moving`.
fn third(law: &StretchEnergy, along: [DVec3; 3], moving: [DVec3; 3]) -> [DVec3; 3] {
    let StretchElement {
        shape_u,
        shape_v,
        area,
    } = StretchElement::new(REST);
    let constant = |value| Dual {
        value,
        rates: [0.0],
    };
    let element = StretchElement {
        shape_u: shape_u.map(constant),
        shape_v: shape_v.map(constant),
        area: constant(area),
    };
    let places = std::array::from_fn(|k| DualVector::new(stretched()[k], [moving[k]]));
    let along = along.map(|a| DualVector::new(a, [DVec3::ZERO]));
    let product = element
        .respond(law, true, places)
        .negative_jacobian_times(along);
    product.map(|p| p.rates()[0])
}

#[test]
fn a_stretched_face() {
    for fabric in [GRAY, CAMEL, DENIM, NAVY] {
        let law = StretchEnergy::new(&material(fabric).stretch);
        let [a, b, c] = [directions(1), directions(20), directions(40)];
        let product = |part: f64| {
            let places = std::array::from_fn(|k| stretched()[k] + b[k] * part);
            let response = StretchElement::new(REST).respond(&law, true, places);
            response.negative_jacobian_times(a)
        };
        let step = 1e-6;
        let (before, after) = (product(-step), product(step));
        let found = third(&law, a, b);
        for (found, (after, before)) in found.iter().zip(after.into_iter().zip(before)) {
            let slope = (after - before) / (2.0 * step);
            let error = found.distance(slope) / slope.length();
            assert!(error < 1e-7, "{fabric}: {error}");
        }
        // The same in all orders of the three directions.
        let all = [[a, b, c], [b, a, c], [a, c, b], [c, b, a]];
        let forms = all.map(|[a, b, c]| dot(third(&law, a, b), c));
        for form in forms {
            assert!((form / forms[0] - 1.0).abs() < 1e-12, "{forms:?}");
        }
    }
}

#[test]
fn the_angle_of_a_hinge() {
    let corners = [
        DVec3::ZERO,
        DVec3::new(0.041, 0.01, 0.002),
        DVec3::new(0.01, 0.03, 0.012),
        DVec3::new(0.03, -0.02, 0.009),
    ];
    let direction = |from: usize| -> [DVec3; 4] {
        let ([a, b, c], [d, ..]) = (directions(from), directions(from + 3));
        [a, b, c, d]
    };
    let along = |by: [DVec3; 4]| -> [DVec3; 4] {
        let moved = std::array::from_fn(|k| DualVector::new(corners[k], [by[k]]));
        angle_gradient::<Dual>(moved).map(|p| p.rates()[0])
    };
    let (a, b) = (direction(3), direction(9));
    let moved =
        |part: f64| angle_gradient::<f64>(std::array::from_fn(|k| corners[k] + a[k] * part));
    let step = 1e-7;
    let (before, after, found) = (moved(-step), moved(step), along(a));
    for (found, (after, before)) in found.iter().zip(after.into_iter().zip(before)) {
        let slope = (after - before) / (2.0 * step);
        assert!(found.distance(slope) < 1e-6 * slope.length());
    }
    let forms = [dot(along(a), b), dot(along(b), a)];
    assert!((forms[0] / forms[1] - 1.0).abs() < 1e-12, "{forms:?}");
}
