//! Settings of a study, and its plan: settings that fit the cases, checked before any work.

use super::case::Case;
use super::error::ChoiceError;
use super::method::Method;
use crate::evaluation::spread;

/// Settings of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The methods that are measured.
    pub rivals: Vec<Method>,
    /// The method of the run that counts as the truth.
    pub reference: Method,
    /// Numbers k of frames after which errors are taken.
    pub horizons: Vec<usize>,
    /// Runs from true states, per case and rival.
    pub starts: usize,
    /// Frame of the first start; by default the first of the run.
    pub from: Option<usize>,
    /// Frame in which the last run ends; by default the last of the motion.
    pub to: Option<usize>,
    /// Each method also runs from the first frame to the last.
    pub whole: bool,
    /// Threads; by default one per processor.
    pub threads: Option<usize>,
}

/// The part of a case's motion that is measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Window {
    /// Frames of the starts, rising.
    pub(super) starts: Vec<usize>,
    /// The last frame that is compared.
    pub(super) last: usize,
}

/// A study that can be made.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(super) settings: Settings,
    pub(super) cases: Vec<(Case, Window)>,
}

impl Plan {
    /// Checks that `settings` make sense and fit `cases`.
    ///
    /// # Errors
    /// Names the setting or the case, and what would be right.
    pub fn new(cases: Vec<Case>, mut settings: Settings) -> Result<Self, ChoiceError> {
        settings.horizons.sort_unstable();
        settings.horizons.dedup();
        settings.check()?;
        let mut planned: Vec<(Case, Window)> = Vec::with_capacity(cases.len());
        for case in cases {
            if planned.iter().any(|(other, _)| other.name == case.name) {
                let problem = format!("two cases are called {:?}: give each a name", case.name);
                return Err(ChoiceError::new(problem));
            }
            let methods = settings.rivals.iter().chain([&settings.reference]);
            for method in methods {
                let physics = case.scene_by(method).physics;
                let wrong = |error| format!("scene {:?} by {method}: {error}", case.name);
                physics
                    .validate()
                    .map_err(|error| ChoiceError::new(wrong(error)))?;
                case.beyond(method, 0)?;
            }
            let window = settings.window(&case)?;
            planned.push((case, window));
        }
        if planned.is_empty() {
            return Err(ChoiceError::new("there is no scene to study: name one"));
        }
        Ok(Self {
            settings,
            cases: planned,
        })
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
}

impl Settings {
    fn check(&self) -> Result<(), ChoiceError> {
        let wrong = |problem: String| Err(ChoiceError::new(problem));
        if self.starts == 0 {
            return wrong("starts: 0 runs measure nothing: ask for 1 at least".to_owned());
        }
        if self.horizons.first().is_none_or(|least| *least == 0) {
            return wrong("horizons: give numbers of frames, 1 at least".to_owned());
        }
        if self.rivals.is_empty() {
            return wrong("integrators, substeps: give one of each at least".to_owned());
        }
        let (reference, substeps) = (&self.reference, self.reference.substeps);
        if substeps < 2 || substeps % 2 == 1 {
            return wrong(format!(
                "reference-substeps: a second run has half as many, so that the number must be even, found {substeps}"
            ));
        }
        let is_as_fine =
            |m: &&Method| m.integrator == reference.integrator && m.substeps >= substeps;
        match self.rivals.iter().find(is_as_fine) {
            None => Ok(()),
            Some(rival) => wrong(format!(
                "reference-substeps: {rival} is no coarser than the reference, {reference}: ask for more substeps of the reference"
            )),
        }
    }

    /// The frames of `case` that are compared.
    fn window(&self, case: &Case) -> Result<Window, ChoiceError> {
        let about = |problem: String| ChoiceError::new(format!("{}: {problem}", case.name));
        let all = case.scene().frame_count();
        let all = all.map_err(|error| about(error.to_string()))?;
        let first = self.from.unwrap_or(case.first_frame());
        if first < case.first_frame() {
            let least = case.first_frame();
            return Err(about(format!(
                "from: the run begins in frame {least}, after {first}: choose a later frame"
            )));
        }
        let last = self.to.unwrap_or(all);
        if last > all {
            return Err(about(format!(
                "to: the motion has {all} frames, fewer than {last}: choose an earlier frame"
            )));
        }
        let longest = self.longest();
        let Some(room) = last.checked_sub(first + longest) else {
            return Err(about(format!(
                "horizons: a run of {longest} frames does not fit between frames {first} and {last}: ask for shorter ones, or for a wider span"
            )));
        };
        if self.starts > room + 1 {
            return Err(about(format!(
                "starts: between frames {first} and {last} runs of {longest} frames can start in {} frames, fewer than {}: ask for fewer",
                room + 1,
                self.starts
            )));
        }
        let starts = spread(room, self.starts).into_iter();
        Ok(Window {
            starts: starts.map(|start| first + start).collect(),
            last,
        })
    }

    /// Frames of the longest run.
    pub(super) fn longest(&self) -> usize {
        self.horizons.last().copied().unwrap_or(0)
    }

    /// The method of the second reference run, whose difference tells the error of the first.
    pub(super) fn half(&self) -> Method {
        Method {
            substeps: self.reference.substeps / 2,
            ..self.reference.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> Settings {
        let linearised = ["linearised".parse().unwrap()];
        Settings {
            rivals: Method::all(&linearised, &[1, 2]),
            reference: Method::all(&linearised, &[16]).remove(0),
            horizons: vec![20, 1, 20],
            starts: 5,
            from: None,
            to: None,
            whole: false,
            threads: None,
        }
    }

    fn plan(settings: Settings) -> Result<Plan, ChoiceError> {
        let scene = selvedge_data::open_scene("default").unwrap();
        Plan::new(Case::all(&[scene], &[], &[]).unwrap(), settings)
    }

    #[test]
    fn starts_are_spread_from_the_first_frame_to_the_last_that_leaves_room() {
        let window = |change: fn(&mut Settings)| {
            let mut settings = settings();
            change(&mut settings);
            plan(settings).unwrap().cases[0].1.clone()
        };
        let whole = window(|_| {});
        assert_eq!(whole.starts, [0, 310, 620, 930, 1240]);
        assert_eq!(whole.last, 1260);
        let swing = window(|s| (s.from, s.to) = (Some(70), Some(130)));
        assert_eq!(
            (swing.starts.as_slice(), swing.last),
            (&[70, 80, 90, 100, 110][..], 130)
        );
        // One start is in the middle; as many as there are frames take each.
        let one = window(|s| (s.from, s.to, s.starts) = (Some(70), Some(130), 1));
        assert_eq!(one.starts, [90]);
        let each = window(|s| (s.from, s.to) = (Some(70), Some(94)));
        assert_eq!(each.starts, [70, 71, 72, 73, 74]);
        assert_eq!(plan(settings()).unwrap().settings().horizons, [1, 20]);
    }

    type Spoil = fn(&mut Settings);

    #[test]
    fn what_does_not_fit_is_named_with_its_remedy() {
        let wrong: [(Spoil, &str, &str); 9] = [
            (|s| s.starts = 0, "starts", "1 at least"),
            (|s| s.horizons = vec![0, 3], "horizons", "1 at least"),
            (|s| s.horizons = Vec::new(), "horizons", "1 at least"),
            (|s| s.horizons = vec![1261], "default: horizons", "shorter"),
            (|s| s.rivals.clear(), "integrators", "one of each"),
            (|s| s.to = Some(1261), "default: to", "1260"),
            (
                |s| (s.from, s.to) = (Some(70), Some(93)),
                "default: starts",
                "4 frames",
            ),
            (|s| s.reference.substeps = 15, "reference-substeps", "even"),
            (
                |s| s.reference.substeps = 2,
                "reference-substeps",
                "no coarser",
            ),
        ];
        for (spoil, field, remedy) in wrong {
            let mut settings = settings();
            spoil(&mut settings);
            let error = plan(settings).unwrap_err().to_string();
            assert!(
                error.starts_with(field) && error.contains(remedy),
                "{error}"
            );
        }
        let scene = selvedge_data::open_scene("default").unwrap();
        let twice = Case::all(&[scene.clone(), scene], &[], &[]).unwrap();
        let error = Plan::new(twice, settings()).unwrap_err().to_string();
        assert!(error.contains("\"default\""), "{error}");
    }
}
