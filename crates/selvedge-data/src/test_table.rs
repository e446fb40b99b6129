//! Tables of cases in tests: a line for each, with ` | ` between its cells.

/// The cells of each line; `\n` in a cell is a new line.
pub(crate) fn table<const N: usize>(text: &str) -> Vec<[&'static str; N]> {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let cell = |cell: &str| -> &'static str { cell.replace("\\n", "\n").leak() };
    let cells = lines.map(|line| {
        let cells: Vec<&'static str> = line.split(" | ").map(cell).collect();
        let count = cells.len();
        cells
            .try_into()
            .unwrap_or_else(|_| panic!("{count} cells for {N}: {line}"))
    });
    cells.collect()
}
