//! Settings of the physics: bounds, words of files, modes.

use super::*;
use crate::error::refuses_toml;

#[test]
fn wrong_settings_are_named() {
    refuses_toml(
        PhysicsSettings::validate,
        "substeps = 0 | physics.substeps must be between 1 and 1000, found 0
         substeps = 1001 | physics.substeps
         substeps = -1 | -1
         max_strain = 0.0 | physics.max_strain
         max_strain = inf | physics.max_strain
         air = 'explicit' | physics.air must be \"implicit\"
         least_damping = -1e-3 | physics.least_damping
         integrator = { generalised-alpha = { spectral_radius = 1.0 } } \
             | physics.integrator.generalised-alpha.spectral_radius must be between 0 and 0.9
         integrator = { generalised-alpha = { spectral_radius = nan } } \
             | physics.integrator.generalised-alpha.spectral_radius must be between 0 and 0.9
         integrator = { generalised-alpha = { radius = 0.5 } } | spectral_radius
         integrator = { newton = {} } | expected `linearised`
         integrator = { second-order-newton = {} } | `generalised-alpha`
         solver = { conjugate-gradients = { max_iterations = 0 } } \
             | physics.solver.conjugate-gradients.max_iterations
         substepping = 'fixed' | unknown field `substepping`
         sub_steps = 4 | sub_steps
         handles = 'glue' | glue",
    );
    refuses_toml(
        SagSettings::validate,
        "bulge = nan | sag.bulge
         tolerance = 0.0 | sag.tolerance
         tolerance = inf | sag.tolerance
         tolerance = nan | sag.tolerance
         max_steps = 0 | sag.max_steps
         height = 1 | height",
    );
}

fn of_radius(radius: f64) -> Integrator {
    let spectral_radius = Some(radius);
    Integrator::GeneralisedAlpha(GeneralisedAlpha { spectral_radius })
}

#[test]
fn settings_are_read_as_people_write_them_and_come_back() {
    type Change = fn(&mut PhysicsSettings);
    let cases: [(&str, Change); 8] = [
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
        ("even_bending = true", |_| ()),
        ("solver = \"cholesky\"", |s| {
            s.solver = LinearSolver::Cholesky
        }),
        ("handles = \"spring\"\nlaw = \"arcsim\"", |s| {
            s.handles = HandleConstraint::Spring;
            s.law = ElasticLaw::Arcsim;
        }),
    ];
    for (text, change) in cases {
        let mut expected = PhysicsSettings {
            even_bending: text.contains("even_bending"),
            ..PhysicsSettings::default()
        };
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
fn frames_of_many_substeps_divide_too() {
    for substeps in [1, 8, 33, 1000] {
        let settings = PhysicsSettings {
            substeps,
            ..PhysicsSettings::default()
        };
        assert!(settings.most_substeps() >= 8 * substeps, "{substeps}");
    }
}
