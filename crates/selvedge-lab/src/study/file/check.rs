//! Checks of a study: mistakes are found before anything is done.

use selvedge_train::TrainConfig;

use super::{Question, Study, Training};
use crate::evaluation::Contestant;
use crate::study::error::{OfPart, StudyError};

impl Study {
    /// Checks everything that can be known before anything is done.
    ///
    /// # Errors
    /// Names the entry and the remedy.
    pub(super) fn check(&self) -> Result<(), StudyError> {
        self.check_names()?;
        if self.data.is_empty() {
            return Err(StudyError::new("data: there is no data set: write [data] and a line such as small = { preset = \"small\" }".to_string()));
        }
        for name in &self.evaluation.data {
            self.check_data(name).of(|| "evaluation.data".to_owned())?;
        }
        for (field, bad) in [
            (
                "steps",
                self.evaluation.steps.iter().flatten().any(|&k| k == 0),
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
        for question in &self.question {
            self.check_question(question)
                .of(|| format!("question {:?}", question.title))?;
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
        if self.scale_schedules {
            return Err(StudyError::new("after: with scale_schedules every training is a whole one: leave one of the two out".to_string()));
        }
        let Some(before) = before.iter().find(|entry| entry.name == *after) else {
            return Err(StudyError::new(format!(
                "after: no training before this one is called {after:?}"
            )));
        };
        if self.data_of(before)? != self.data_of(entry)? {
            return Err(StudyError::new(format!(
                "after: {after:?} learns from another data set: a training goes on with its own"
            )));
        }
        // A budget of steps decides when each ends.
        let comparable = |mut cfg: TrainConfig| {
            cfg.steps = 0;
            cfg.log_every = 1;
            cfg.name.clear();
            cfg
        };
        if comparable(self.config(before)?) != comparable(cfg) {
            return Err(StudyError::new(format!(
                "after: {after:?} has another configuration: a training goes on with its own"
            )));
        }
        Ok(())
    }

    fn check_names(&self) -> Result<(), StudyError> {
        let mut seen: Vec<&str> = Vec::new();
        let rivals = Contestant::rivals().map(|rival| rival.name);
        let trained = self.train.iter().map(|entry| &entry.name);
        let models = trained.chain(self.model.iter().map(|entry| &entry.name));
        for name in models {
            let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
            if name.is_empty() || !name.chars().all(plain) {
                return Err(StudyError::new(format!(
                    "name {name:?}: use letters, digits, - and _, since it is the name of a folder"
                )));
            }
            if rivals.contains(name) {
                return Err(StudyError::new(format!(
                    "name {name:?}: a rival has this name: take another"
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

    fn check_question(&self, question: &Question) -> Result<(), StudyError> {
        if question.models.is_empty() == question.groups.is_empty() {
            return Err(StudyError::new("write either models or groups".to_string()));
        }
        for group in question.groups() {
            let mut seen: Vec<&String> = Vec::new();
            for name in &group.models {
                if seen.contains(&name) {
                    return Err(StudyError::new(format!(
                        "{name:?} stands twice: name everyone once"
                    )));
                }
                seen.push(name);
            }
        }
        for name in question.groups().iter().flat_map(|group| &group.models) {
            if self.label(name).is_none() {
                return Err(StudyError::new(format!(
                    "there is nobody called {name:?}: name trainings, models or rivals of the study"
                )));
            }
        }
        Ok(())
    }
}
