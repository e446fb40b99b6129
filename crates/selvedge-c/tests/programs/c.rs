//! Programs in C: their positions, their mistakes, the header.

use std::process::Command;

use crate::common::{self, SMALL, TestFolder, declared};

#[test]
fn the_header_declares_every_exported_function_and_no_other() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src");
    let mut exported = Vec::new();
    for path in common::sources(folder.as_ref()) {
        let text = std::fs::read_to_string(path).unwrap();
        let names = text.split("extern \"C\" fn ").skip(1);
        let names = names.filter_map(|rest| rest.split('(').next().map(str::to_owned));
        exported.extend(names.filter(|name| name.starts_with("selvedge_")));
    }
    exported.sort_unstable();
    let header = std::fs::read_to_string(common::HEADER).unwrap();
    assert!(exported.len() > 20, "{exported:?}");
    assert_eq!(declared(&header), exported, "cargo xtask header --write");
}

#[test]
fn a_c_program_prints_the_positions_of_the_command_line_to_the_bit() {
    let dir = TestFolder::new();
    dir.write("small.toml", SMALL);
    let program = dir.compile("rollout.c", &[]);
    for model in ["physics", "paper"] {
        let said = dir.run(Command::new(&program).args(["small.toml", model, "12"]));
        let numbers = said.split_whitespace();
        let bits = numbers.map(|number| number.parse::<f32>().unwrap().to_bits());
        assert_eq!(bits.collect::<Vec<_>>(), dir.wanted(model, 12), "{model}");
    }
}

#[test]
fn mistakes_of_a_c_program_are_codes_also_under_the_address_sanitizer_and_valgrind() {
    let dir = TestFolder::new();
    dir.write("small.toml", SMALL);
    let program = dir.compile("mistakes.c", &["-pthread"]);
    let said = dir.run(Command::new(&program).arg("small.toml"));
    for words in [
        "no scene: 6 nowhere/at-all.toml",
        "a handle too many: 2 handles: expected 2 handles, found 3",
        "step after free: 4",
        "0 not as expected",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let flags = [
        "-pthread",
        "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
    ];
    match dir.try_compile("mistakes.c", &flags) {
        Ok(watched) => {
            dir.run(Command::new(watched).arg("small.toml"));
        }
        Err(why) => common::left_out(&format!("cc has no address sanitizer here: {why}")),
    }
    if common::is_absent("valgrind") {
        return;
    }
    let mut valgrind = Command::new("valgrind");
    valgrind.args([
        "--error-exitcode=9",
        "--leak-check=full",
        "--errors-for-leak-kinds=definite",
    ]);
    dir.run(valgrind.arg(&program).arg("small.toml"));
}

#[test]
fn a_c_program_takes_the_library_in() {
    let dir = TestFolder::new();
    dir.write("small.toml", SMALL);
    let shared = dir.compile("rollout.c", &[]);
    let whole = dir.compile_static("rollout.c");
    let arguments = ["small.toml", "physics", "3"];
    let wanted = dir.run(Command::new(shared).args(arguments));
    assert_eq!(dir.run(Command::new(whole).args(arguments)), wanted);
}
