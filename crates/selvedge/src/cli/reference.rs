//! Every command with its options and defaults, as a page of Markdown: the commands reference of
//! the book. It is made of what clap knows, so that it says the same as `--help`.

use clap::{Arg, ArgAction, Command, CommandFactory};

use super::Cli;

/// Columns of a line of the page.
const COLUMNS: usize = 100;

pub(super) fn page() -> String {
    let mut program = Cli::command().term_width(COLUMNS);
    program.build();
    let mut page = Page::default();
    page.line("# Commands");
    page.paragraph(
        "This page is made by `cargo xtask book --write` from what `selvedge --help` says; do not \
         edit it.",
    );
    page.help(&program);
    page.options("Every command takes these options:", &program, |arg| {
        arg.is_global_set()
    });
    page.commands(&program);
    page.text
}

/// A page under way.
#[derive(Default)]
struct Page {
    text: String,
}

impl Page {
    /// Adds a section for each command below `parent`, and for those below them.
    fn commands(&mut self, parent: &Command) {
        for command in parent.get_subcommands() {
            if command.is_hide_set() || command.get_name() == "help" {
                continue;
            }
            let name = command.get_bin_name().unwrap_or(command.get_name());
            self.blank();
            self.line(&format!("## `{name}`"));
            // Some take arguments of their own beside their subcommands.
            if !command.has_subcommands() || command.is_args_conflicts_with_subcommands_set() {
                let usage = command.clone().render_usage().to_string();
                let usage = usage.strip_prefix("Usage: ").unwrap_or(&usage);
                self.code(usage.lines());
            }
            self.help(command);
            self.options("Options:", command, |arg| !arg.is_global_set());
            self.commands(command);
        }
    }

    /// Adds the description of a command and what stands after its help.
    fn help(&mut self, command: &Command) {
        let about = command.get_long_about().or(command.get_about());
        for paragraph in blocks(&about.map(ToString::to_string).unwrap_or_default()) {
            self.paragraph(&paragraph);
        }
        let after = command.get_after_help().map(ToString::to_string);
        for block in blocks(&after.unwrap_or_default()) {
            match block.split_once('\n') {
                Some((heading, lines)) if lines.starts_with("  ") => {
                    self.paragraph(heading);
                    let indent = |line| str::strip_prefix(line, "  ").unwrap_or(line);
                    self.code(lines.lines().map(indent));
                }
                _ => self.paragraph(&block),
            }
        }
    }

    /// Adds a list of the options that `wanted` picks, under a heading.
    fn options(&mut self, heading: &str, command: &Command, wanted: impl Fn(&Arg) -> bool) {
        let shown = |arg: &&Arg| {
            let own = !matches!(arg.get_id().as_str(), "help" | "version");
            own && !arg.is_hide_set() && wanted(arg)
        };
        let options: Vec<&Arg> = command.get_arguments().filter(shown).collect();
        if options.is_empty() {
            return;
        }
        self.paragraph(heading);
        self.blank();
        for option in options {
            self.wrapped("- ", "  ", &described(option));
        }
    }

    fn paragraph(&mut self, text: &str) {
        if !text.is_empty() {
            self.blank();
            self.wrapped("", "", text);
        }
    }

    fn code<'a>(&mut self, lines: impl Iterator<Item = &'a str>) {
        self.blank();
        self.line("```sh");
        lines.for_each(|line| self.line(line));
        self.line("```");
    }

    /// Adds a text in lines of up to [`COLUMNS`] characters; words that are longer stay whole.
    fn wrapped(&mut self, first: &str, others: &str, text: &str) {
        let mut line = first.to_owned();
        let mut is_empty = true;
        for word in text.split_whitespace() {
            if !is_empty && line.chars().count() + 1 + word.chars().count() > COLUMNS {
                self.line(&line);
                line = others.to_owned();
                is_empty = true;
            }
            if !is_empty {
                line.push(' ');
            }
            line.push_str(word);
            is_empty = false;
        }
        self.line(&line);
    }

    fn blank(&mut self) {
        self.text.push('\n');
    }

    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }
}

/// The blocks of a text that empty lines part.
fn blocks(text: &str) -> Vec<String> {
    let blocks = text.split("\n\n").map(str::trim_end);
    blocks
        .filter(|block| !block.is_empty())
        .map(str::to_owned)
        .collect()
}

/// An argument's call, help, values and default.
fn described(arg: &Arg) -> String {
    let mut call = Vec::new();
    call.extend(arg.get_short().map(|short| format!("-{short}")));
    call.extend(arg.get_long().map(|long| format!("--{long}")));
    let takes_values = matches!(arg.get_action(), ArgAction::Set | ArgAction::Append);
    let names = arg.get_value_names().unwrap_or_default();
    let value = names.iter().map(|name| format!("<{name}>"));
    let value: String = value.collect::<Vec<_>>().join(" ");
    let mut call = call.join(", ");
    if takes_values {
        let space = if call.is_empty() { "" } else { " " };
        call = format!("{call}{space}{value}");
    }
    let required = if arg.is_required_set() {
        " (required)"
    } else {
        ""
    };
    let help = arg.get_long_help().or(arg.get_help());
    let help = help.map(ToString::to_string).unwrap_or_default();
    let end = if help.ends_with('.') { "" } else { "." };
    let mut text = format!("`{call}`{required}: {help}{end}");
    let values = arg.get_possible_values();
    let values: Vec<String> = values
        .iter()
        .filter(|value| takes_values && !value.is_hide_set())
        .map(|value| match value.get_help() {
            Some(help) => format!("`{}` ({help})", value.get_name()),
            None => format!("`{}`", value.get_name()),
        })
        .collect();
    if !values.is_empty() {
        text.push_str(&format!(" Values: {}.", values.join(", ")));
    }
    let defaults = arg.get_default_values().iter();
    let defaults: Vec<String> = defaults
        .map(|value| format!("`{}`", value.to_string_lossy()))
        .collect();
    if takes_values && !defaults.is_empty() {
        text.push_str(&format!(" Default: {}.", defaults.join(", ")));
    }
    text
}
