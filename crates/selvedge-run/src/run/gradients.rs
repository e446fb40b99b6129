//! The derivatives of a recorded run.

use selvedge_sim::{Gradient, GradientError, GradientSettings, StateGradient};

use super::{Mover, Run};

impl Run {
    /// Records the steps of the solver from here on, so that [`Self::backward`] can differentiate
    /// them; they keep their bytes. [`Self::restore`] and [`Self::reset`] end the recording.
    ///
    /// # Errors
    /// [`GradientError`]: a scene with a law that has no energy, contact with the formula `linearised`, or
    /// another stepper.
    pub fn record_gradient(&mut self, settings: GradientSettings) -> Result<(), GradientError> {
        match &mut self.mover {
            Mover::Solver(solver) => solver.record_gradient(settings),
            _ => Err(GradientError::NoSolver),
        }
    }

    /// The derivatives of a value of the recorded frames, by where the recording began, where the
    /// handles and the bodies were led, gravity, air, wind and all numbers of the materials. `seed` is asked for each
    /// frame, counted from the beginning of the recording, the last one first, and adds the value's
    /// derivatives by the state there.
    ///
    /// ```
    /// use selvedge::parts::{Handles, Isotropic, Material, Scene, generate};
    /// use selvedge::glam::DVec3;
    ///
    /// let sheet = generate::square(49, 1.0, 1)?;
    /// let elastic = Isotropic { youngs_modulus: 1e6, poissons_ratio: 0.3, thickness: 5e-4 };
    /// let rubber = Material {
    ///     name: "rubber".to_owned(),
    ///     source: String::new(),
    ///     density: 0.5,
    ///     damping: 0.0,
    ///     stretch: elastic.stretch_table(),
    ///     bend: elastic.bend_table(),
    ///     compression: selvedge::parts::Compression::default(),
    /// };
    /// let handles = Handles::new(&sheet.labels["upper-corners"], 49)?;
    /// let mut run = selvedge::Run::new(&selvedge::Scene::of(Scene::of("a", sheet.mesh, handles, rubber)))?;
    /// run.record_gradient(selvedge::GradientSettings::default())?;
    /// for _ in 0..10 {
    ///     run.step()?;
    /// }
    /// // The height of vertex 20 after ten frames.
    /// let gradient = run.backward(&mut |frame, by| {
    ///     if frame == 10 {
    ///         by.positions[20] += DVec3::Y;
    ///     }
    /// })?;
    /// assert!(gradient.gravity.y > 0.0, "less gravity, and it hangs higher");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`GradientError`]; the run is as it was.
    pub fn backward(
        &mut self,
        seed: &mut dyn FnMut(usize, &mut StateGradient),
    ) -> Result<Gradient, GradientError> {
        match &mut self.mover {
            Mover::Solver(solver) => solver.backward(seed),
            _ => Err(GradientError::NoSolver),
        }
    }
}
