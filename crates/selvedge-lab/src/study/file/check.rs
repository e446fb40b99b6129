//! Checks of a study: mistakes are found before anything is done.

use selvedge_train::TrainConfig;

use super::{Study, Training};
use crate::evaluation::Method;
use crate::study::error::{OfPart, StudyError};

impl Study {
    /// Checks everything that can be known before anything is done.
    pub(super) fn check(&self) -> Result<(), StudyError> {
        self.check_names()?;
        if self.data.is_empty() {
            return Err(StudyError::new("data: there is no data set: write [data] and a line such as small = { preset = \"small\" }".to_string()));
        }
        for name in &self.evaluation.data {
            self.check_data(name).of(|| "evaluation.data".to_owned())?;
        }
        for name in &self.evaluation.baselines {
            if Method::baseline(name).is_none() {
                return Err(StudyError::new(format!(
                    "evaluation.baselines: there is no baseline {name:?}: there are {}",
                    Method::BASELINES.join(", ")
                )));
            }
        }
        if self.train.is_empty() && self.model.is_empty() {
            return Err(StudyError::new(
                "there is nothing to measure: write a [[train]] or a [[model]]".to_owned(),
            ));
        }
        for (field, bad) in [
            (
                "horizons",
                self.evaluation.horizons.iter().flatten().any(|&k| k == 0),
            ),
            ("starts", self.evaluation.starts == 0),
        ] {
            if bad {
                return Err(StudyError::new(format!(
                    "evaluation.{field} must be at least 1, found 0"
                )));
            }
        }
        for (number, entry) in self.train.iter().enumerate() {
            self.check_training(entry, &self.train[..number])
                .of(|| format!("training {:?}", entry.name))?;
        }
        Ok(())
    }

    fn check_training(&self, entry: &Training, before: &[Training]) -> Result<(), StudyError> {
        self.check_data(self.data_of(entry)?)?;
        let cfg = self.config(entry)?;
        self.budget(entry)?;
        let Some(after) = &entry.after else {
            return Ok(());
        };
        let Some(before) = before.iter().find(|entry| entry.name == *after) else {
            return Err(StudyError::new(format!(
                "after: no training before this one is called {after:?}"
            )));
        };
        let mut network = self.config(before)?.model;
        network.encoder = cfg.model.encoder;
        if network != cfg.model {
            return Err(StudyError::new(format!(
                "after: {after:?} has another network; only its encoder may be another"
            )));
        }
        Ok(())
    }

    /// Whether `entry` is `before` with more steps, which goes on as if that had never ended.
    pub(in crate::study) fn continues(
        &self,
        entry: &Training,
        before: &Training,
    ) -> Result<bool, StudyError> {
        // A budget of steps decides when each ends.
        let comparable = |mut cfg: TrainConfig| {
            cfg.steps = 0;
            cfg.log_every = 1;
            cfg.name.clear();
            cfg
        };
        Ok(self.data_of(before)? == self.data_of(entry)?
            && comparable(self.config(before)?) == comparable(self.config(entry)?))
    }

    fn check_names(&self) -> Result<(), StudyError> {
        let mut seen: Vec<&str> = Vec::new();
        let trained = self.train.iter().map(|entry| &entry.name);
        let models = trained.chain(self.model.iter().map(|entry| &entry.name));
        for name in models {
            let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
            if name.is_empty() || !name.chars().all(plain) {
                return Err(StudyError::new(format!(
                    "name {name:?}: use letters, digits, - and _, since it is the name of a folder"
                )));
            }
            if Method::BASELINES.contains(&name.as_str()) {
                return Err(StudyError::new(format!(
                    "name {name:?}: a baseline has this name: take another"
                )));
            }
            if seen.contains(&name.as_str()) {
                return Err(StudyError::new(format!(
                    "two entries are called {name:?}: rename one"
                )));
            }
            seen.push(name);
        }
        Ok(())
    }

    fn check_data(&self, name: &str) -> Result<(), StudyError> {
        if self.data.contains_key(name) {
            return Ok(());
        }
        let known: Vec<&str> = self.data.keys().map(String::as_str).collect();
        Err(StudyError::new(format!(
            "there is no data set {name:?}: the study has {}",
            known.join(", ")
        )))
    }
}
