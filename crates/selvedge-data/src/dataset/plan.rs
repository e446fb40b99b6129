//! The plan of a data set: its configuration, motions and sections.

use selvedge_cluster::Shard;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::dataset::check::{check_names, of_motion};
use crate::dataset::preset::DatasetConfig;
use crate::dataset::sections::{Section, SectionRule};
use crate::dataset::{DatasetIndex, Entry, Split, Splits};
use crate::formats::file_error::Problem;

/// Planned contents of a data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetPlan {
    /// Name of the data set.
    pub name: String,
    /// The resolved configuration.
    pub config: Value,
    /// Motions of the training split, in order.
    pub train: Vec<String>,
    /// Motions of the test split, in order.
    pub test: Vec<String>,
    /// Rule for the sections to learn from.
    pub sections: SectionRule,
}

impl DatasetPlan {
    /// The motions of a split, in order.
    pub fn motions(&self, split: Split) -> &[String] {
        split.of(&self.train, &self.test)
    }

    /// The motions of a part, the training split first; all of them without one.
    pub(super) fn of_part(&self, part: Option<Shard>) -> Vec<(Split, &str)> {
        Split::BOTH
            .into_iter()
            .flat_map(|split| self.motions(split).iter().map(move |m| (split, m.as_str())))
            .enumerate()
            .filter(|(number, _)| part.is_none_or(|part| part.has(*number)))
            .map(|(_, motion)| motion)
            .collect()
    }

    /// Returns the difference between the data set of `index` and the one that the plan makes, as
    /// "has other sections"; none where they agree. Keys that an older configuration lacks count as
    /// their defaults.
    pub fn difference(&self, index: &DatasetIndex) -> Option<String> {
        let motions = |entries: &[Entry]| entries.iter().map(|e| e.motion.clone()).collect();
        let found = Self {
            name: index.name.clone(),
            config: index.config.clone(),
            train: motions(&index.splits.train),
            test: motions(&index.splits.test),
            sections: self.sections,
        };
        self.difference_of_plan(&found).or_else(|| {
            // The index has no rule, but what the rule gave.
            let expected = sections(self.sections, &index.splits);
            let is_same = expected.is_ok_and(|sections| sections == index.sections);
            (!is_same).then(other_sections)
        })
    }

    pub(super) fn difference_of_plan(&self, found: &Self) -> Option<String> {
        if found.name != self.name {
            return Some(format!("is called {:?}, not {:?}", found.name, self.name));
        }
        let list = |motions: &[String]| format!("[{}]", motions.join(", "));
        for split in Split::BOTH {
            let [ours, found] = [self, found].map(|plan| plan.motions(split));
            if found != ours {
                let (what, found, ours) = (split.of("training", "test"), list(found), list(ours));
                return Some(format!("has the {what} motions {found}, not {ours}"));
            }
        }
        if !is_same_config(&found.config, &self.config) {
            return Some("has another configuration".to_owned());
        }
        (found.sections != self.sections).then(other_sections)
    }

    pub(super) fn validate(&self) -> Result<(), Problem> {
        for split in Split::BOTH {
            let motions = self.motions(split).iter().map(String::as_str);
            check_names(motions).map_err(|(motion, problem)| of_motion(motion, problem))?;
        }
        Ok(())
    }
}

fn other_sections() -> String {
    "has other sections".to_owned()
}

/// Returns true when two configurations say the same, those of presets with every default filled
/// in.
fn is_same_config(a: &Value, b: &Value) -> bool {
    let read = |config: &Value| DatasetConfig::deserialize(config).ok();
    a == b || read(a).is_some_and(|a| read(b) == Some(a))
}

/// The sections of the training split, whose entries are in the order of the plan.
pub(super) fn sections(rule: SectionRule, splits: &Splits) -> Result<Vec<Section>, Problem> {
    let train = splits.train.iter();
    let lengths: Vec<(&str, usize)> = train.map(|e| (e.motion.as_str(), e.frames)).collect();
    rule.sections(&lengths)
}
