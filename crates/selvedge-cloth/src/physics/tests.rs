//! Settings of the physics: bounds, words of files, modes.

use super::*;

type SpoilPhysics = fn(&mut PhysicsSettings);

#[test]
fn wrong_solver_settings_are_named() {
    let wrong: [(&str, SpoilPhysics); 7] = [
        ("physics.max_strain", |s| s.max_strain = 0.0),
        ("physics.max_strain", |s| s.max_strain = f64::INFINITY),
        ("physics.air must be \"implicit\"", |s| {
            s.air = AirLaw::Explicit
        }),
        ("physics.least_damping", |s| s.least_damping = Some(-1e-3)),
        (
            "physics.integrator.generalised-alpha.spectral_radius must be between 0 and 0.9",
            |s| {
                s.integrator = Integrator::GeneralisedAlpha(GeneralisedAlpha {
                    spectral_radius: Some(1.0),
                });
            },
        ),
        ("physics.integrator.generalised-alpha", |s| {
            s.integrator = Integrator::GeneralisedAlpha(GeneralisedAlpha {
                spectral_radius: Some(f64::NAN),
            });
        }),
        ("physics.solver.conjugate-gradients.max_iterations", |s| {
            s.solver = LinearSolver::ConjugateGradients(ConjugateGradients {
                max_iterations: 0,
                ..ConjugateGradients::default()
            });
        }),
    ];
    for (field, spoil) in wrong {
        let mut settings = PhysicsSettings {
            substeps: 4,
            ..PhysicsSettings::default()
        };
        spoil(&mut settings);
        let text = settings.validate().unwrap_err().to_string();
        assert!(text.starts_with(field), "{text}");
    }
}

#[test]
fn an_integrator_is_a_word_or_a_table() {
    #[derive(Deserialize)]
    struct File {
        integrator: Integrator,
    }
    let read = |text: &str| toml::from_str::<File>(text).map(|file| file.integrator);
    assert_eq!(
        read("integrator = { generalised-alpha = {} }"),
        Ok(Integrator::GeneralisedAlpha(GeneralisedAlpha::default()))
    );
    let settings = GeneralisedAlpha {
        spectral_radius: Some(0.5),
    };
    assert_eq!(
        read("integrator = { generalised-alpha = { spectral_radius = 0.5 } }"),
        Ok(Integrator::GeneralisedAlpha(settings))
    );
    let unknown = read("integrator = { generalised-alpha = { radius = 0.5 } }");
    assert!(unknown.unwrap_err().to_string().contains("spectral_radius"));
}

#[test]
fn solver_settings_are_written_as_people_write_them() {
    let text = "solver = { conjugate-gradients = { tolerance = 1e-6 } }\nair = \"implicit\"\nintegrator = \"linearised\"";
    let settings: PhysicsSettings = toml::from_str(text).unwrap();
    let expected = ConjugateGradients {
        tolerance: 1e-6,
        ..ConjugateGradients::default()
    };
    assert_eq!(settings.solver, LinearSolver::ConjugateGradients(expected));
    assert_eq!(settings.integrator, Integrator::Linearised);
    settings.validate().unwrap();
    let text = toml::to_string(&settings).unwrap();
    assert_eq!(toml::from_str::<PhysicsSettings>(&text).unwrap(), settings);
    assert!(!text.contains("max_strain"), "{text}");
    let stretchy: PhysicsSettings = toml::from_str("max_strain = 3.5").unwrap();
    assert_eq!(stretchy.max_strain, 3.5);
    let text = toml::to_string(&stretchy).unwrap();
    assert_eq!(toml::from_str::<PhysicsSettings>(&text).unwrap(), stretchy);
    let cholesky: PhysicsSettings = toml::from_str("solver = \"cholesky\"").unwrap();
    assert_eq!(cholesky.solver, LinearSolver::Cholesky);
    for (gone, named) in [
        ("integrator = { newton = {} }", "expected `linearised`"),
        (
            "integrator = { second-order-newton = {} }",
            "`generalised-alpha`",
        ),
        ("substepping = \"fixed\"", "unknown field `substepping`"),
    ] {
        let error = toml::from_str::<PhysicsSettings>(gone).unwrap_err();
        assert!(error.to_string().contains(named), "{error}");
    }
}

type Spoil = fn(&mut SagSettings);

#[test]
fn wrong_settings_are_named() {
    PhysicsSettings::default().validate().unwrap();
    SagSettings::default().validate().unwrap();
    for substeps in [0, 1001] {
        let settings = PhysicsSettings {
            substeps,
            ..PhysicsSettings::default()
        };
        let text = settings.validate().unwrap_err().to_string();
        let expected = format!("physics.substeps must be between 1 and 1000, found {substeps}");
        assert_eq!(text, expected);
    }
    let wrong: [(&str, Spoil); 5] = [
        ("sag.bulge", |s| s.bulge = f64::NAN),
        ("sag.tolerance", |s| s.tolerance = 0.0),
        ("sag.tolerance", |s| s.tolerance = f64::INFINITY),
        ("sag.tolerance", |s| s.tolerance = f64::NAN),
        ("sag.max_steps", |s| s.max_steps = 0),
    ];
    for (field, spoil) in wrong {
        let mut settings = SagSettings::default();
        spoil(&mut settings);
        let text = settings.validate().unwrap_err().to_string();
        assert!(text.starts_with(field), "{text}");
    }
}

#[test]
fn a_mode_is_its_settings() {
    let arcsim = PhysicsSettings::in_mode(PhysicsMode::Arcsim);
    assert_eq!(arcsim.handles, HandleConstraint::Spring);
    assert_eq!(arcsim.law, ElasticLaw::Arcsim);
    let own = PhysicsSettings::in_mode(PhysicsMode::default());
    assert_eq!(own, PhysicsSettings::default());
}

#[test]
fn toml_keeps_defaults_and_names_unknown_keys() {
    let text = "handles = \"spring\"\nlaw = \"arcsim\"";
    let settings: PhysicsSettings = toml::from_str(text).unwrap();
    assert_eq!(settings.substeps, PhysicsSettings::default().substeps);
    assert_eq!(settings.handles, HandleConstraint::Spring);
    assert_eq!(settings.law, ElasticLaw::Arcsim);
    let text = toml::to_string(&settings).unwrap();
    assert_eq!(toml::from_str::<PhysicsSettings>(&text).unwrap(), settings);
    for (text, named) in [
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
