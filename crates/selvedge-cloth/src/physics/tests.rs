//! Settings of the physics: bounds, words of files, modes.

use super::*;
use crate::error::refuses;

#[test]
fn wrong_settings_are_named() {
    let alpha = "physics.integrator.generalised-alpha.spectral_radius must be between 0 and 0.9";
    refuses(
        &PhysicsSettings::default(),
        PhysicsSettings::validate,
        &[
            (
                "physics.substeps must be between 1 and 1000, found 0",
                |s| s.substeps = 0,
            ),
            ("physics.substeps", |s| s.substeps = 1001),
            ("physics.max_strain", |s| s.max_strain = 0.0),
            ("physics.max_strain", |s| s.max_strain = f64::INFINITY),
            ("physics.air must be \"implicit\"", |s| {
                s.air = AirLaw::Explicit
            }),
            ("physics.least_damping", |s| s.least_damping = Some(-1e-3)),
            (alpha, |s| s.integrator = of_radius(1.0)),
            (alpha, |s| s.integrator = of_radius(f64::NAN)),
            ("physics.solver.conjugate-gradients.max_iterations", |s| {
                s.solver = LinearSolver::ConjugateGradients(ConjugateGradients {
                    max_iterations: 0,
                    ..ConjugateGradients::default()
                });
            }),
        ],
    );
    refuses(
        &SagSettings::default(),
        SagSettings::validate,
        &[
            ("sag.bulge", |s| s.bulge = f64::NAN),
            ("sag.tolerance", |s| s.tolerance = 0.0),
            ("sag.tolerance", |s| s.tolerance = f64::INFINITY),
            ("sag.tolerance", |s| s.tolerance = f64::NAN),
            ("sag.max_steps", |s| s.max_steps = 0),
        ],
    );
}

fn of_radius(radius: f64) -> Integrator {
    let spectral_radius = Some(radius);
    Integrator::GeneralisedAlpha(GeneralisedAlpha { spectral_radius })
}

#[test]
fn settings_are_read_as_people_write_them_and_come_back() {
    type Change = fn(&mut PhysicsSettings);
    let cases: [(&str, Change); 7] = [
        ("integrator = { generalised-alpha = {} }", |_| ()),
        (
            "integrator = { generalised-alpha = { spectral_radius = 0.5 } }",
            |s| s.integrator = of_radius(0.5),
        ),
        (
            "solver = { conjugate-gradients = { tolerance = 1e-6 } }",
            |s| {
                s.solver = LinearSolver::ConjugateGradients(ConjugateGradients {
                    tolerance: 1e-6,
                    ..ConjugateGradients::default()
                });
            },
        ),
        ("integrator = \"linearised\"\nair = \"implicit\"", |s| {
            s.integrator = Integrator::Linearised;
        }),
        ("max_strain = 3.5", |s| s.max_strain = 3.5),
        ("solver = \"cholesky\"", |s| {
            s.solver = LinearSolver::Cholesky
        }),
        ("handles = \"spring\"\nlaw = \"arcsim\"", |s| {
            s.handles = HandleConstraint::Spring;
            s.law = ElasticLaw::Arcsim;
        }),
    ];
    for (text, change) in cases {
        let mut expected = PhysicsSettings::default();
        change(&mut expected);
        let settings: PhysicsSettings = toml::from_str(text).unwrap();
        assert_eq!(settings, expected, "{text}");
        let written = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str(&written), Ok(settings));
        let is_said = written.contains("max_strain");
        assert_eq!(is_said, text.contains("max_strain"), "{written}");
    }
}

#[test]
fn unknown_words_are_named() {
    for (text, named) in [
        ("integrator = { newton = {} }", "expected `linearised`"),
        (
            "integrator = { second-order-newton = {} }",
            "`generalised-alpha`",
        ),
        (
            "integrator = { generalised-alpha = { radius = 0.5 } }",
            "spectral_radius",
        ),
        ("substepping = \"fixed\"", "unknown field `substepping`"),
        ("sub_steps = 4", "sub_steps"),
        ("handles = \"glue\"", "glue"),
        ("substeps = -1", "-1"),
    ] {
        let error = toml::from_str::<PhysicsSettings>(text).unwrap_err();
        assert!(error.to_string().contains(named), "{error}");
    }
    let error = toml::from_str::<SagSettings>("bulge = 0.1\nheight = 1").unwrap_err();
    assert!(error.to_string().contains("height"), "{error}");
}
