//! All numbers as CSV: SI units, every digit, a line per run, mean, k or frame. A field in which a
//! comma, a quote or a line break stands is quoted; a number that is not there is an empty field.

use super::{Contest, Subject};
use crate::csv::Csv;
use crate::evaluation::{Horizon, Measures, Row, Timing, Who, summary};
use crate::watched::GuardSummary;

const GUARDED: &str = "frames,frames_corrected,frames_lost,largest_correction";

/// A line per contestant and mesh, and per contestant over all meshes ("all").
pub(super) fn means_csv(contest: &Contest<'_>) -> String {
    let measures = Measures::NAMES.join(",");
    let head = format!(
        "who,mesh,motions,runs_under_strain_limit,first_frame_over,{measures},runs_diverged,{GUARDED}"
    );
    let mut csv = Csv::new(&head);
    let meshes = contest.values(|row| &row.mesh);
    for (subject, name) in contest.subjects().zip(contest.names()) {
        let mut add = |mesh: &str, rows: &[&Row]| {
            let all = summary(rows);
            csv.texts([&name, mesh]);
            csv.number(Some(all.motions as f64));
            csv.number(Some(all.stable as f64));
            csv.number(all.unstable_frame.map(|frame| frame as f64));
            csv.measures(all.measures.as_ref());
            csv.number(Some(all.diverged as f64));
            csv.guarded(all.guarded.as_ref());
            csv.end();
        };
        for mesh in &meshes {
            let here = subject.rows.iter().filter(|row| row.mesh == *mesh);
            let here: Vec<&Row> = here.copied().collect();
            if !here.is_empty() {
                add(mesh, &here);
            }
        }
        add("all", &subject.rows);
    }
    csv.text()
}

/// A line per contestant and motion.
pub(super) fn motions_csv(contest: &Contest<'_>) -> String {
    let measures = Measures::NAMES.join(",");
    let head = format!(
        "who,data,mesh,motion,first_frame_over,{measures},first_frame_diverged,{GUARDED},failure"
    );
    let mut csv = Csv::new(&head);
    each(contest, |name, row| {
        csv.texts([name, &row.data, &row.mesh, &row.motion]);
        csv.number(row.unstable_frame.map(|frame| frame as f64));
        csv.measures(row.measures.as_ref());
        csv.number(row.diverged_frame.map(|frame| frame as f64));
        csv.guarded(row.guarded.as_ref());
        csv.texts([row.failure.as_deref().unwrap_or_default()]);
        csv.end();
    });
    csv.text()
}

/// A line per contestant, motion and k; the motion "all" is their mean.
pub(super) fn steps_csv(contest: &Contest<'_>) -> String {
    let head = "who,data,motion,steps,position_rmse,last_position_rmse,edge_length_rmse";
    let mut csv = Csv::new(head);
    let mut add = |texts: [&str; 3], horizon: &Horizon| {
        csv.texts(texts);
        csv.number(Some(horizon.steps as f64));
        csv.number(Some(horizon.position_rmse));
        csv.number(Some(horizon.last_position_rmse));
        csv.number(Some(horizon.edge_length_rmse));
        csv.end();
    };
    each(contest, |name, row| {
        for horizon in &row.horizons {
            add([name, &row.data, &row.motion], horizon);
        }
    });
    for (subject, name) in contest.subjects().zip(contest.names()) {
        for horizon in &summary(&subject.rows).horizons {
            add([&name, "all", "all"], horizon);
        }
    }
    csv.text()
}

/// A line per contestant, motion and frame, but for the truth.
pub fn curves_csv(contest: &Contest<'_>) -> String {
    let head = "who,data,motion,frame,time,position_rmse,edge_length_rmse,largest_strain";
    let mut csv = Csv::new(head);
    each(contest, |name, row| {
        if row.who == Who::Truth {
            return;
        }
        let curves = &row.curves;
        let errors = curves.position_rmse.iter().zip(&curves.edge_length_rmse);
        for (frame, ((position, edge), strain)) in errors.zip(&curves.largest_strain).enumerate() {
            csv.texts([name, &row.data, &row.motion]);
            csv.number(Some(frame as f64));
            csv.number(Some(frame as f64 / row.frame_rate));
            for value in [position, edge, strain] {
                csv.number(Some(*value));
            }
            csv.end();
        }
    });
    csv.text()
}

/// A line per contestant and mesh.
pub(super) fn times_csv(timings: &[Timing]) -> String {
    let mut csv = Csv::new("who,mesh,ms_per_frame");
    for timing in timings {
        csv.texts([&timing.name, &timing.mesh]);
        csv.number(Some(timing.ms_per_frame));
        csv.end();
    }
    csv.text()
}

fn each(contest: &Contest<'_>, mut row: impl FnMut(&str, &Row)) {
    for (Subject { rows, .. }, name) in contest.subjects().zip(contest.names()) {
        rows.iter().for_each(|one| row(&name, one));
    }
}

impl Csv {
    fn measures(&mut self, measures: Option<&Measures>) {
        match measures {
            Some(measures) => measures.values().for_each(|value| self.number(Some(value))),
            None => Measures::NAMES.iter().for_each(|_| self.number(None)),
        }
    }

    fn guarded(&mut self, guarded: Option<&GuardSummary>) {
        self.number(guarded.map(|g| g.frames as f64));
        self.number(guarded.map(|g| g.corrected as f64));
        self.number(guarded.map(|g| g.lost as f64));
        self.number(guarded.map(|g| g.largest_correction));
    }
}
