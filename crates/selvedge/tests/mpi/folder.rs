//! The program on several ranks, in the folder of a test.

use std::process::{Command, Output, Stdio};

use serde_json::Value;

pub(crate) use crate::common::TestFolder;

/// A small network, four samples a step.
pub(crate) fn training() -> String {
    let fewer = crate::common::TRAINING.replace("steps = 6", "steps = 200");
    let four = fewer.replace("samples = 2 }", "samples = 4 }");
    let truth = "{ kind = \"linear\", start = 1, end = 20, probability = 0.3 }";
    let line = format!("\nscheduled_sampling = {{ truth = {truth} }}\n\n[model]");
    four.replace("\n[model]", &line)
}

/// Open MPI asks for leave to run as root, and with more ranks than processors. Containers may not
/// let processes read one another.
const OPEN_MPI: [(&str, &str); 4] = [
    ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
    ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
    ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
    ("OMPI_MCA_btl_vader_single_copy_mechanism", "none"),
];

fn mpirun(dir: &TestFolder, words: &[String]) -> Command {
    let mut mpirun = Command::new("mpirun");
    mpirun
        .args(words)
        .current_dir(dir.path(""))
        .env("SELVEDGE_CACHE", "off")
        .envs(OPEN_MPI)
        .stdin(Stdio::null());
    mpirun
}

/// Asserts that the program failed and said `words` in its line of an error.
pub(crate) fn must_fail(output: &Output, words: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{said}");
    let line = said.lines().find(|line| line.starts_with("error: "));
    let line = line.unwrap_or_else(|| panic!("no error: {said}"));
    for word in words {
        assert!(line.contains(word), "{word:?} is not in {said}");
    }
}

/// Ranks of one thread.
pub(crate) trait OnRanks {
    /// The program with these arguments on so many ranks; without `mpirun` for one.
    fn on(&self, ranks: usize, arguments: &str) -> Command;

    /// The program on two ranks; `sh` of each runs it as "$@".
    fn each(&self, scripts: [&str; 2], arguments: &str) -> Output;

    /// Runs the program, which must succeed, and gives the one JSON object that it prints.
    fn json_on(&self, ranks: usize, arguments: &str) -> Value;

    /// Runs the program, which must fail and say `words` in its line of an error.
    fn fails_on(&self, ranks: usize, arguments: &str, words: &[&str]) {
        must_fail(&self.on(ranks, arguments).output().unwrap(), words);
    }
}

impl OnRanks for TestFolder {
    fn on(&self, ranks: usize, arguments: &str) -> Command {
        let mut one = self.command(arguments);
        if ranks > 1 {
            let mut words = vec!["-n".to_owned(), ranks.to_string()];
            words.push(one.get_program().to_string_lossy().into_owned());
            words.extend(one.get_args().map(|arg| arg.to_string_lossy().into_owned()));
            one = mpirun(self, &words);
        }
        one.env("RAYON_NUM_THREADS", "1");
        one
    }

    fn each(&self, scripts: [&str; 2], arguments: &str) -> Output {
        let program = env!("CARGO_BIN_EXE_selvedge");
        let mut words: Vec<String> = Vec::new();
        for script in scripts {
            let shell = ["-n", "1", "sh", "-c", script, "sh", program];
            words.extend(shell.map(str::to_owned));
            words.extend(arguments.split_whitespace().map(str::to_owned));
            words.push(":".to_owned());
        }
        words.pop();
        let mut command = mpirun(self, &words);
        command.env("RAYON_NUM_THREADS", "1").output().unwrap()
    }

    fn json_on(&self, ranks: usize, arguments: &str) -> Value {
        let output = self.on(ranks, &format!("{arguments} --json")).output();
        let output = output.expect("mpirun is here");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{ranks}: {arguments}: {said}");
        let out = String::from_utf8(output.stdout).unwrap();
        serde_json::from_str(&out).unwrap_or_else(|_| panic!("one answer: {out}"))
    }
}
