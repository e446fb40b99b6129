//! Runs the quick commands of the book, page by page, each page in an empty folder with `assets`
//! and `docs` beside it. A shell runs a block, and ends at the first command that fails.
//!
//! A block marked `toml file=NAME` is written to that file where it stands.

use std::process::Command;
use std::time::Instant;
use std::{env, fs};

use crate::markdown::{self, Block};
use crate::{PAGES, files, root};

/// Folder in which pages are tried, relative to the root.
const FOLDER: &str = "target/book/run";
/// Folders of the repository that commands may name.
const BESIDE: [&str; 2] = ["assets", "docs"];

/// The quick commands of all pages, with the program that was built before.
#[test]
#[allow(clippy::print_stdout, reason = "it is waited for by people")]
#[ignore = "minutes: cargo xtask book --run builds the program and runs it"]
fn quick_commands_of_the_book_run() {
    let root = root();
    // The program is built beside the folder of the tests.
    let own = env::current_exe().unwrap();
    let mut path = own.ancestors().nth(2).unwrap().as_os_str().to_owned();
    path.push(":");
    path.push(env::var_os("PATH").unwrap_or_default());

    let folder = root.join(FOLDER);
    if folder.exists() {
        fs::remove_dir_all(&folder).unwrap();
    }
    let mut failed = Vec::new();
    for (page, text) in files().texts.iter().map(|file| (&file.path, &file.text)) {
        if !is_tried(page, text) {
            continue;
        }
        let folder = folder.join(page.replace(['/', '.'], "-"));
        fs::create_dir_all(&folder).unwrap();
        for name in BESIDE {
            #[cfg(unix)]
            std::os::unix::fs::symlink(root.join(name), folder.join(name)).unwrap();
        }
        for block in &markdown::blocks(text) {
            if let Some(name) = file_of(block) {
                fs::write(folder.join(name), text_of(block)).unwrap();
            }
            if is_quick(block) {
                let began = Instant::now();
                let mut shell = Command::new("bash");
                shell.args(["-euxo", "pipefail", "-c", &text_of(block)]);
                let is_done = shell
                    .current_dir(&folder)
                    .env("PATH", &path)
                    .status()
                    .unwrap()
                    .success();
                let place = format!("{page}:{}", block.opens_at);
                let seconds = began.elapsed().as_secs_f64();
                let how = if is_done { "done" } else { "FAILED" };
                println!("{how}: {place} ({seconds:.1} s)");
                failed.extend((!is_done).then_some(place));
            }
        }
    }
    assert!(failed.is_empty(), "blocks of commands failed: {failed:?}");
}

fn is_tried(page: &str, text: &str) -> bool {
    let is_page = page == "README.md" || page.starts_with(PAGES);
    is_page && markdown::blocks(text).iter().any(is_quick)
}

fn is_quick(block: &Block<'_>) -> bool {
    block.info.contains(&"quick")
}

/// Name of the file that a block is.
fn file_of<'a>(block: &Block<'a>) -> Option<&'a str> {
    block
        .info
        .iter()
        .find_map(|word| word.strip_prefix("file="))
}

fn text_of(block: &Block<'_>) -> String {
    block.lines.iter().map(|line| format!("{line}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_with_quick_blocks_are_tried() {
        let quick = "```console quick\nselvedge presets\n```\n";
        assert!(is_tried("docs/src/a.md", quick));
        assert!(!is_tried("notebook/a.md", quick));
        assert!(!is_tried("other/a.md", quick));
        assert!(!is_tried("docs/src/a.md", &quick.replace(" quick", "")));
    }

    #[test]
    fn a_block_names_its_file() {
        let blocks = markdown::blocks("```toml file=a.toml\nname = 1\n```\n```toml\n```\n");
        assert_eq!(file_of(&blocks[0]), Some("a.toml"));
        assert_eq!(text_of(&blocks[0]), "name = 1\n");
        assert_eq!(file_of(&blocks[1]), None);
    }
}
