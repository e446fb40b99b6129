//! The classes for C# and the component for Unity, compiled and run by Mono.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{HEADER, SMALL, TestFolder, declared, is_absent};

const PACKAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/unity");

/// The program for the console, compiled; none where Mono is not here.
fn compiled(dir: &TestFolder) -> Option<PathBuf> {
    if ["mcs", "mono"].into_iter().any(is_absent) {
        return None;
    }
    dir.write("small.toml", SMALL);
    let program = dir.path("program.exe");
    let mut mcs = Command::new("mcs");
    mcs.args(["-langversion:7", "-warnaserror+"]);
    mcs.arg(format!("-out:{}", program.display()));
    for folder in ["Runtime", "Tests~"] {
        mcs.args(scripts(&Path::new(PACKAGE).join(folder)));
    }
    dir.run(&mut mcs);
    Some(program)
}

fn scripts(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    paths
        .filter(|path| path.extension().is_some_and(|e| e == "cs"))
        .collect()
}

fn mono(dir: &TestFolder, program: &Path, words: &str) -> String {
    let mut mono = Command::new("mono");
    dir.run(mono.arg(program).args(words.split(' ')))
}

/// Positions to the bit, mistakes as exceptions, and the component, which leads a mesh by two
/// transforms.
#[test]
fn a_program_in_csharp_does_what_the_command_line_does() {
    let dir = TestFolder::new();
    let Some(program) = compiled(&dir) else {
        return;
    };
    for model in ["physics", "paper"] {
        let said = mono(&dir, &program, &format!("small.toml {model} 12"));
        let bits = said.split_whitespace();
        let bits = bits.map(|bits| u32::from_str_radix(bits, 16).unwrap());
        assert_eq!(bits.collect::<Vec<_>>(), dir.wanted(model, 12), "{model}");
    }
    for (call, words) in [
        ("mistakes", "few targets: Count"),
        ("mistakes", "after disposal: Freed"),
        ("mistakes", "0 not as expected"),
        ("component", "the scene has 2, found 3"),
    ] {
        let said = mono(&dir, &program, &format!("small.toml {call}"));
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn the_package_is_of_this_version_and_declares_what_the_header_does() {
    let read = |path: &str| std::fs::read_to_string(Path::new(PACKAGE).join(path)).unwrap();
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(read("package.json").contains(&version), "{version}");
    let native = read("Runtime/Native.cs");
    let number = selvedge_c::process::SELVEDGE_INTERFACE;
    assert!(native.contains(&format!("const uint Interface = {number};")));
    let imported = native.lines().filter(|line| line.contains("static extern"));
    let names = imported.filter_map(|line| line.split_whitespace().nth(4)?.split('(').next());
    let mut names: Vec<&str> = names.collect();
    names.sort_unstable();
    assert_eq!(names, declared(&std::fs::read_to_string(HEADER).unwrap()));
}
