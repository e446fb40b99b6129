//! The parts of Markdown that the checks need: fenced blocks, links, code spans and the anchors of
//! headings.

use std::collections::BTreeMap;

/// A fenced block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Block<'a> {
    /// Words after the opening fence: the language, then attributes.
    pub(super) info: Vec<&'a str>,
    /// Its lines, each with its number, counted from 1.
    pub(super) lines: Vec<Line<'a>>,
    /// Number of the line of the opening fence.
    pub(super) opens_at: usize,
}

/// A line of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Line<'a> {
    /// Counted from 1.
    pub(super) number: usize,
    /// Without its end.
    pub(super) text: &'a str,
}

/// A link or an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Link<'a> {
    /// Line in which its target stands.
    pub(super) line: usize,
    /// Path without the fragment; empty for the page itself.
    pub(super) path: &'a str,
    /// Fragment after `#`.
    pub(super) anchor: Option<&'a str>,
}

/// A text, cut into prose and fenced blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct Page<'a> {
    /// Lines outside of fenced blocks.
    pub(super) prose: Vec<Line<'a>>,
    /// Fenced blocks, in their order.
    pub(super) blocks: Vec<Block<'a>>,
}

/// Cuts a text into prose and fenced blocks.
pub(super) fn page(text: &str) -> Page<'_> {
    let mut page = Page::default();
    let mut open: Option<Block<'_>> = None;
    for (index, text) in text.lines().enumerate() {
        let line = Line {
            number: index + 1,
            text,
        };
        let fence = text.trim_start().strip_prefix("```");
        match (fence, &mut open) {
            (Some(info), None) => {
                open = Some(Block {
                    info: info.split_whitespace().collect(),
                    lines: Vec::new(),
                    opens_at: line.number,
                });
            }
            (Some(_), Some(_)) => page.blocks.extend(open.take()),
            (None, Some(block)) => block.lines.push(line),
            (None, None) => page.prose.push(line),
        }
    }
    page.blocks.extend(open);
    page
}

/// Relative links and images of a page's prose, outside of code spans.
pub(super) fn links<'a>(page: &Page<'a>) -> Vec<Link<'a>> {
    let mut found = Vec::new();
    for line in &page.prose {
        for (before, rest) in targets(line.text) {
            let is_code = before.matches('`').count() % 2 == 1;
            let target = rest.split([')', ' ']).next().unwrap_or_default();
            if is_code || target.is_empty() || target.contains(':') {
                continue;
            }
            let (path, anchor) = match target.split_once('#') {
                Some((path, anchor)) => (path, Some(anchor)),
                None => (target, None),
            };
            found.push(Link {
                line: line.number,
                path,
                anchor,
            });
        }
    }
    found
}

/// Texts before and after each `](` of a line.
fn targets(line: &str) -> impl Iterator<Item = (&str, &str)> {
    let places = line.match_indices("](");
    places.map(|(place, opening)| (&line[..place], &line[place + opening.len()..]))
}

/// Code spans of a page's prose; one that goes on in the next line is left out.
pub(super) fn code_spans<'a>(page: &Page<'a>) -> Vec<Line<'a>> {
    let mut found = Vec::new();
    for line in &page.prose {
        let parts: Vec<&str> = line.text.split('`').collect();
        let closed = parts.len() - 1 + parts.len() % 2;
        let spans = parts.iter().take(closed).skip(1).step_by(2);
        found.extend(spans.map(|text| Line {
            number: line.number,
            text,
        }));
    }
    found
}

/// Anchors of a page's headings, as mdBook and GitHub make them: lower case, words joined by
/// hyphens, other signs left out, a number behind those that come again.
pub(super) fn anchors(page: &Page<'_>) -> Vec<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut found = Vec::new();
    for line in &page.prose {
        let title = line.text.trim_start_matches('#');
        if title.len() == line.text.len() || !title.starts_with(' ') {
            continue;
        }
        let anchor = slug(title.trim());
        let count = seen.entry(anchor.clone()).or_default();
        found.push(match *count {
            0 => anchor,
            again => format!("{anchor}-{again}"),
        });
        *count += 1;
    }
    found
}

fn slug(title: &str) -> String {
    let kept = |sign: char| match sign {
        ' ' => Some('-'),
        _ if sign.is_alphanumeric() || sign == '-' || sign == '_' => Some(sign),
        _ => None,
    };
    let kept: String = title.chars().filter_map(kept).collect();
    kept.to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# A `b` c's\n\nsee [x](y.md#z) `[n](o)` ![i](p.png)\n\n```console quick\nrun\n```\nend `a` `b\n# A b cs\n";

    #[test]
    fn a_page_is_prose_and_blocks() {
        let page = page(TEXT);
        assert_eq!(page.blocks.len(), 1);
        assert_eq!(page.blocks[0].info, ["console", "quick"]);
        assert_eq!(page.blocks[0].opens_at, 5);
        let run = Line {
            number: 6,
            text: "run",
        };
        assert_eq!(page.blocks[0].lines, [run]);
        assert_eq!(page.prose.len(), 6);
    }

    #[test]
    fn links_have_paths_and_anchors_and_are_no_code() {
        let page = page(TEXT);
        let found = links(&page);
        let paths: Vec<&str> = found.iter().map(|link| link.path).collect();
        assert_eq!(paths, ["y.md", "p.png"]);
        assert_eq!(found[0].anchor, Some("z"));
        assert_eq!(found[0].line, 3);
    }

    #[test]
    fn spans_are_closed_in_their_line() {
        let page = page(TEXT);
        let spans = code_spans(&page);
        let texts: Vec<&str> = spans.iter().map(|line| line.text).collect();
        assert_eq!(texts, ["b", "[n](o)", "a"]);
    }

    #[test]
    fn anchors_are_those_of_github() {
        assert_eq!(anchors(&page(TEXT)), ["a-b-cs", "a-b-cs-1"]);
        assert_eq!(slug("`[eq:ease]` Eased, progress"), "eqease-eased-progress");
    }
}
