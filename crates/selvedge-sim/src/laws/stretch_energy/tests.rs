use super::*;
use crate::laws::stretch::StretchElement;
use crate::laws::stretch_energy::fit::{dot, mandel, measured_stress, principal, weight};
use glam::{DVec2, DVec3};

/// Gray interlock, the shipped fabric whose measured law gains the most from nothing.
const GRAY: StretchTable = StretchTable([
    [16.593832, -14.69599, 34.477123, 36.860302],
    [46.364765, 53.694656, 261.013855, -29.691301],
    [49.28511, 87.5961, 206.373993, 22.768457],
    [123.98922, 105.18177, 365.966217, 44.217571],
    [139.686325, 73.59256, 413.553162, -174.43853],
    [127.44381, 85.848587, 405.872833, 32.238411],
]);

const REST: [DVec2; 3] = [
    DVec2::new(0.1, 0.2),
    DVec2::new(0.5, 0.1),
    DVec2::new(0.3, 0.6),
];

/// Strains that no ramp begins or ends at: tension, shear, compression, and beyond the fit.
const STRAINS: [[f64; 3]; 6] = [
    [0.011, 0.023, 0.004],
    [0.07, -0.031, 0.05],
    [-0.021, -0.013, -0.006],
    [0.16, 0.052, -0.08],
    [0.9, 0.4, 0.3],
    [-0.3, 0.05, 0.02],
];

fn strain([uu, vv, uv]: [f64; 3]) -> Strain {
    Strain { uu, vv, uv }
}

/// Central differences of step h of a function that is smooth but for kinks of its second
/// derivative.
fn differences(at: [f64; 3], h: f64, of: impl Fn(Strain) -> f64) -> [f64; 3] {
    std::array::from_fn(|k| {
        let moved = |by: f64| {
            let mut to = at;
            to[k] += by;
            of(strain(to))
        };
        (moved(h) - moved(-h)) / (2.0 * h)
    })
}

/// ∂W/∂(G00, G11, G01) of a law's answer.
fn slope(elastic: Elastic) -> [f64; 3] {
    let Strain { uu, vv, uv } = elastic.stress;
    [uu, vv, 2.0 * uv]
}

#[test]
fn stress_is_the_gradient_of_the_energy_and_tangent_that_of_the_stress() {
    let energy = StretchEnergy::new(&GRAY);
    for at in STRAINS {
        let found = energy.at(strain(at), true);
        let h = 1e-5;
        let gradient = differences(at, h, |g| energy.energy(g));
        for (found, measured) in slope(found).iter().zip(gradient) {
            // h² of a third derivative of at most 2e4 N/m, and 1e-16/h of an energy of 300 J/m².
            assert!(
                (found - measured).abs() < 1e-5,
                "{at:?}: {found} {measured}"
            );
        }
        let [a, b, c, d, e, f] = found.tangent;
        for (row, expected) in [[a, b, e], [b, c, f], [e, f, d]].iter().enumerate() {
            let measured = differences(at, h, |g| slope(energy.at(g, true))[row]);
            for (expected, measured) in expected.iter().zip(measured) {
                assert!((expected - measured).abs() < 1e-3 * 900.0, "{at:?} {row}");
            }
        }
    }
}

#[test]
fn tangent_is_positive_semidefinite_everywhere() {
    let energy = StretchEnergy::new(&GRAY);
    for at in STRAINS {
        let [a, b, c, d, e, f] = energy.at(strain(at), true).tangent;
        let minor = a * c - b * b;
        let determinant = a * (c * d - f * f) - b * (b * d - f * e) + e * (b * f - c * e);
        assert!(a >= 0.0 && minor >= -1e-9 && determinant >= -1e-6, "{at:?}");
    }
}

#[test]
fn tension_is_the_stress_without_its_compression() {
    let at = |uu, vv, uv| positive_part(Strain { uu, vv, uv });
    assert_eq!(at(3.0, 2.0, 1.0), [3.0, 2.0, 1.0]);
    assert_eq!(at(-3.0, -2.0, 1.0), [0.0; 3]);
    // Eigenvalues 2 and -1 along (1, 1) and (1, -1).
    let [uu, vv, uv] = at(0.5, 0.5, 1.5);
    assert!([uu, vv, uv].iter().all(|t| (t - 1.0).abs() < 1e-15));
}

#[test]
fn a_stiffness_that_does_not_change_is_met_exactly() {
    let table = StretchTable([[40.0, 15.0, 80.0, 30.0]; 6]);
    let energy = StretchEnergy::new(&table);
    for at in STRAINS {
        let strain = strain(at);
        assert_eq!(
            energy.at(strain, true).stress,
            measured_stress(&table, strain)
        );
    }
}

#[test]
fn fit_is_as_near_as_the_documentation_says() {
    // Strains between those of the fit.
    let mut samples = Vec::new();
    for along in [0.004, 0.015, 0.04, 0.09, 0.16] {
        for ratio in [-0.4, -0.1, 0.1, 0.4, 0.9] {
            for angle in [0.1, 0.4, 0.8, 1.2, 1.5] {
                samples.push(principal(along, ratio * along, angle));
            }
        }
    }
    let energy = StretchEnergy::new(&GRAY);
    let (mut error, mut size) = (0.0, 0.0);
    for strain in samples {
        let scaled = |stress| mandel(stress).map(|s| s * weight(strain));
        let (fitted, measured) = (
            scaled(energy.at(strain, true).stress),
            scaled(measured_stress(&GRAY, strain)),
        );
        let difference = std::array::from_fn(|k| fitted[k] - measured[k]);
        error += dot(difference, difference);
        size += dot(measured, measured);
    }
    let relative = (error / size).sqrt();
    assert!((0.1..0.26).contains(&relative), "{relative}");
}

#[test]
fn tables_that_no_fabric_has_are_fitted_all_the_same() {
    for table in [
        StretchTable([[0.0; 4]; 6]),
        StretchTable([[-5.0; 4]; 6]),
        StretchTable([[1e6, 2e6, 1e6, 1e-3]; 6]),
        StretchTable([[1.0, 900.0, 1.0, 0.0]; 6].map(|mut row| {
            row[2] += row[1];
            row
        })),
    ] {
        let elastic = StretchEnergy::new(&table).at(strain([0.03, -0.01, 0.02]), true);
        assert!(elastic.tangent.iter().all(|k| k.is_finite()), "{table:?}");
    }
}

#[test]
fn jacobian_of_a_face_in_tension_is_exact() {
    let energy = StretchEnergy::new(&GRAY);
    let element = StretchElement::new(REST);
    let (u, v) = (DVec3::new(0.1, 1.08, 0.02), DVec3::new(0.04, -0.03, 1.06));
    let corners = REST.map(|c| u * c.x + v * c.y);
    let response = element.respond(&energy, true, corners);
    assert_eq!(
        response.elastic.tension[..2],
        [response.elastic.stress.uu, response.elastic.stress.vv]
    );
    let h = 1e-6;
    for column in 0..3 {
        for axis in 0..3 {
            let force = |by: f64| {
                let mut corners = corners;
                corners[column][axis] += by;
                element.respond(&energy, true, corners).force()
            };
            let (up, down) = (force(h), force(-h));
            for row in 0..3 {
                let measured = (down[row] - up[row]) / (2.0 * h);
                let block = response.negative_jacobian(row, column);
                assert!(block[axis].distance(measured) < 1e-5 * 900.0);
            }
        }
    }
}
