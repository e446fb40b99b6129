//! The fenced blocks of a page of Markdown.

/// A fenced block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Block<'a> {
    /// Words after the opening fence: the language, then attributes.
    pub(crate) info: Vec<&'a str>,
    pub(crate) lines: Vec<&'a str>,
    /// Number of the line of the opening fence, counted from 1.
    pub(crate) opens_at: usize,
}

/// The blocks of a page, in their order.
pub(crate) fn blocks(page: &str) -> Vec<Block<'_>> {
    let mut blocks = Vec::new();
    let mut open: Option<Block<'_>> = None;
    for (number, line) in (1..).zip(page.lines()) {
        let fence = line.trim_start().strip_prefix("```");
        match (fence, &mut open) {
            (Some(info), None) => {
                open = Some(Block {
                    info: info.split_whitespace().collect(),
                    lines: Vec::new(),
                    opens_at: number,
                });
            }
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some(block)) => block.lines.push(line),
            (None, None) => {}
        }
    }
    blocks.extend(open);
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_have_their_words_lines_and_place() {
        let found = blocks("# A\n\n```console quick\nrun\n```\nend `a`\n");
        let expected = Block {
            info: vec!["console", "quick"],
            lines: vec!["run"],
            opens_at: 3,
        };
        assert_eq!(found, [expected]);
    }
}
