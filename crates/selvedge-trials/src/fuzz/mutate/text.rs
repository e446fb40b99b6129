//! Damage to text: words and lines removed, repeated, swapped, replaced by what is likely wrong.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::pick::pick;

/// Words that a reader of numbers, names and signs may not expect.
const WORDS: [&str; 34] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "3",
    "4294967295",
    "4294967296",
    "18446744073709551616",
    "1e308",
    "-1e308",
    "1e-320",
    "1e39",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "NaN",
    "Infinity",
    "0x10",
    "1_000",
    "\"\"",
    "''",
    "true",
    "null",
    "[]",
    "{}",
    "[[",
    "/",
    "../x",
    "é\u{301}",
    "\u{feff}",
    "\u{0}",
    "\t",
];

/// `input` with a word or a line changed.
pub(super) fn damage(input: &[u8], other: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let text = String::from_utf8_lossy(input).into_owned();
    let damaged = match rng.random_range(0..8) {
        0..4 => with_tokens(&text, rng),
        4 => with_lines(&text, rng),
        5 => with_line_of(&text, &String::from_utf8_lossy(other), rng),
        6 => nested(&text, rng),
        _ => return super::binary::damage(input, other, rng),
    };
    damaged.into_bytes()
}

/// Runs of letters and digits, and single other characters.
fn tokens(text: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut start = 0;
    let is_part = |c: char| c.is_alphanumeric() || "._-+".contains(c);
    let mut before = false;
    for (place, character) in text.char_indices() {
        let part = is_part(character);
        if place > start && !(part && before) {
            tokens.push(&text[start..place]);
            start = place;
        }
        before = part;
    }
    tokens.push(&text[start..]);
    tokens
}

fn with_tokens(text: &str, rng: &mut ChaCha8Rng) -> String {
    let mut tokens = tokens(text);
    let at = rng.random_range(0..tokens.len());
    match rng.random_range(0..6) {
        0 => drop(tokens.remove(at)),
        1 => tokens.insert(at, tokens[at]),
        2 => {
            let with = rng.random_range(0..tokens.len());
            tokens.swap(at, with);
        }
        3 => tokens[at] = tokens[rng.random_range(0..tokens.len())],
        4 => tokens.insert(at, *pick(&WORDS, rng)),
        _ => {
            // Numbers most of all.
            let is_number = |t: &&str| t.starts_with(|c: char| c.is_ascii_digit() || c == '-');
            let places: Vec<usize> = (0..tokens.len())
                .filter(|&k| is_number(&tokens[k]))
                .collect();
            let at = if places.is_empty() {
                at
            } else {
                *pick(&places, rng)
            };
            tokens[at] = *pick(&WORDS, rng);
        }
    }
    tokens.concat()
}

fn with_lines(text: &str, rng: &mut ChaCha8Rng) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    if lines.is_empty() {
        return text.to_owned();
    }
    let [at, with] = [0; 2].map(|_| rng.random_range(0..lines.len()));
    match rng.random_range(0..5) {
        0 => drop(lines.remove(at)),
        1 => lines.insert(at, lines[with]),
        2 => lines.swap(at, with),
        3 => lines.truncate(at),
        _ => {
            let times = *pick(&[10, 300], rng);
            lines.splice(at..at, std::iter::repeat_n(lines[at], times));
        }
    }
    lines.join(if rng.random_ratio(1, 20) { "\r" } else { "\n" })
}

fn with_line_of(text: &str, other: &str, rng: &mut ChaCha8Rng) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    let from: Vec<&str> = other.lines().collect();
    if !from.is_empty() {
        let at = rng.random_range(0..=lines.len());
        lines.insert(at, *pick(&from, rng));
    }
    lines.join("\n")
}

/// Many brackets, or one very long word.
fn nested(text: &str, rng: &mut ChaCha8Rng) -> String {
    let tokens = tokens(text);
    let at = rng.random_range(0..=tokens.len());
    let sign = *pick(&["[", "{", "(", "\"", "a", "9", "]", "\n"], rng);
    let many = sign.repeat(*pick(&[2, 40, 200, 5000], rng));
    [tokens[..at].concat(), many, tokens[at..].concat()].concat()
}
