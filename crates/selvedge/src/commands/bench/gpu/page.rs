//! The answer of `selvedge bench gpu`: Markdown that may stand in a page as it is.

use selvedge_gpu::bench::limits::Limits;

use super::{Part, PeerTimes, Row};
use crate::cli::GpuArgs;

/// All of it.
pub(super) fn page(device: &str, limits: &Limits, args: &GpuArgs, rows: &[Row]) -> String {
    let mut text = heading(device, limits, args);
    text += &table(rows, args);
    let remarks = rows.iter().filter(|row| !row.remarks.is_empty());
    let remarks: String = remarks
        .map(|row| format!("- {}: {}\n", name(row), row.remarks.join("; ")))
        .collect();
    if !remarks.is_empty() {
        text += &format!("\nRemarks:\n\n{remarks}");
    }
    for row in rows {
        let Some(profile) = &row.profile else {
            continue;
        };
        for (what, whole, parts) in [
            ("a frame", row.frame_ms, &profile.frame),
            ("a step of learning", row.step_ms, &profile.step),
        ] {
            if !parts.is_empty() {
                text += &format!("\n{}, {what}, command by command:\n\n", name(row));
                text += &parts_table(parts, whole);
            }
        }
    }
    text
}

fn name(row: &Row) -> String {
    match row.cloths {
        1 => format!("{}, {} vertices", row.variant, row.vertices),
        cloths => format!("{}, {cloths} times {} vertices", row.variant, row.vertices),
    }
}

fn heading(device: &str, limits: &Limits, args: &GpuArgs) -> String {
    let [full, tensor, half] = limits.products.map(|flop| 1e-12 * flop);
    let mut text = format!(
        "**{device}**, precision {}, medians of {} runs. Measured limits: products {full:.3} TFLOP/s full, \
         {tensor:.3} tensor, {half:.3} half (factors that lie in bf16, where it has such products); copies {:.3} TB/s read and written.\n\n\
         pass: the forward pass on features that lie ready; of products, of bandwidth: its share of those limits; \
         frame: handles up, features, network, integration, positions down; paper: its frame on an RTX 3080; step: \
         forward, mean square error, backward, Adam on features that lie ready, of so many samples.\n",
        args.machine.precision().name(),
        args.runs,
        1e-12 * limits.bandwidth,
    );
    for (number, peer) in args.against.iter().enumerate() {
        let number = number + 1;
        text += &format!("\n({number}): `{peer}`; × is how many times as long as ours it takes.\n");
    }
    text + "\n"
}

/// Lines of a table; the first are its heads.
fn lines(rows: Vec<Vec<String>>) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let mut text = String::new();
    for (number, row) in rows.iter().enumerate() {
        text += &line(row);
        if number == 0 {
            text += &line(&vec!["---".to_owned(); row.len()]);
        }
    }
    text
}

fn table(rows: &[Row], args: &GpuArgs) -> String {
    let heads = [
        "variant",
        "cloths",
        "vertices",
        "arcs",
        "GFLOP",
        "commands",
        "pass, ms",
        "of products",
        "of bandwidth",
        "frame, ms",
        "paper, ms",
        "step, ms",
        "samples/s",
    ];
    let mut heads: Vec<String> = heads.map(str::to_owned).into();
    for peer in 1..=args.against.len() {
        let of_peer = ["pass, ms", "×", "step, ms", "samples/s", "×"];
        heads.extend(of_peer.map(|what| format!("({peer}) {what}")));
    }
    let mut all = vec![heads];
    all.extend(rows.iter().map(cells));
    lines(all)
}

fn cells(row: &Row) -> Vec<String> {
    let mut cells = vec![row.variant.to_owned()];
    cells.extend([row.cloths, row.vertices, row.arcs].map(|count| count.to_string()));
    cells.push(format!("{:.1}", row.gflop));
    cells.push(row.commands.to_string());
    cells.push(milliseconds(row.pass_ms));
    cells.extend([row.share_of_products, row.share_of_bandwidth].map(percent));
    cells.push(milliseconds(row.frame_ms));
    cells.push(or_dash(row.paper_ms, |ms| format!("{ms:.0}")));
    cells.extend(step_cells(row, row.step_ms));
    for PeerTimes { pass_ms, step_ms } in &row.peers {
        let times = |theirs: Option<f64>, ours: Option<f64>| {
            let ratio = theirs.zip(ours).map(|(theirs, ours)| theirs / ours);
            or_dash(ratio, |ratio| format!("{ratio:.2}"))
        };
        cells.extend([milliseconds(*pass_ms), times(*pass_ms, row.pass_ms)]);
        cells.extend(step_cells(row, *step_ms));
        cells.push(times(*step_ms, row.step_ms));
    }
    cells
}

/// The time of a step, and how many samples that is in a second: one for each cloth.
fn step_cells(row: &Row, step_ms: Option<f64>) -> [String; 2] {
    let samples = step_ms.map(|ms| 1e3 * row.cloths as f64 / ms);
    [
        milliseconds(step_ms),
        or_dash(samples, |samples| format!("{samples:.1}")),
    ]
}

fn or_dash(value: Option<f64>, text: impl Fn(f64) -> String) -> String {
    value.map_or("-".to_owned(), text)
}

fn milliseconds(value: Option<f64>) -> String {
    or_dash(value, |ms| format!("{ms:.3}"))
}

fn percent(value: Option<f64>) -> String {
    or_dash(value, |share| format!("{:.0} %", 100.0 * share))
}

/// Of the sum of all commands: what takes less has no line of its own.
const SMALL_SHARE: f64 = 0.01;

/// Commands by themselves, and what they are together beside the whole, which is run as one.
fn parts_table(parts: &[Part], whole_ms: Option<f64>) -> String {
    let sum: f64 = parts.iter().map(|part| part.elapsed_ms).sum();
    let heads = [
        "command",
        "how many",
        "ms",
        "share",
        "of products",
        "of bandwidth",
    ];
    let line = |name: String, commands: usize, elapsed_ms: f64, shares: [Option<f64>; 2]| {
        let mut cells = vec![name, commands.to_string(), milliseconds(Some(elapsed_ms))];
        cells.push(percent(Some(elapsed_ms / sum)));
        cells.extend(shares.map(percent));
        cells
    };
    let count = |parts: &[&Part]| parts.iter().map(|part| part.commands).sum::<usize>();
    let (large, small): (Vec<&Part>, Vec<&Part>) = parts
        .iter()
        .partition(|part| part.elapsed_ms >= SMALL_SHARE * sum);
    let mut rows = vec![heads.map(str::to_owned).into()];
    for part in &large {
        let shares = [part.share_of_products, Some(part.share_of_bandwidth)];
        rows.push(line(
            part.name.clone(),
            part.commands,
            part.elapsed_ms,
            shares,
        ));
    }
    if !small.is_empty() {
        let elapsed_ms = small.iter().map(|part| part.elapsed_ms).sum();
        rows.push(line(
            "others".to_owned(),
            count(&small),
            elapsed_ms,
            [None; 2],
        ));
    }
    let commands = count(&large) + count(&small);
    format!(
        "{}\nAll {commands} commands by themselves: {sum:.3} ms; run as one, with what goes up and down: {} ms.\n",
        lines(rows),
        milliseconds(whole_ms)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_has_a_cell_for_every_head_and_says_how_many_times_as_long_others_take() {
        let row = Row {
            variant: "gru-10",
            cloths: 4,
            pass_ms: Some(2.0),
            step_ms: Some(8.0),
            peers: vec![
                PeerTimes {
                    pass_ms: Some(3.0),
                    step_ms: Some(16.0),
                },
                PeerTimes::default(),
            ],
            ..Row::default()
        };
        let found = cells(&row);
        assert_eq!(found.len(), 13 + 5 * 2);
        assert_eq!(found[11..13], ["8.000", "500.0"]);
        assert_eq!(found[13..18], ["3.000", "1.50", "16.000", "250.0", "2.00"]);
        assert_eq!(found[18..], ["-"; 5]);
    }

    #[test]
    fn parts_are_shares_of_their_sum() {
        let part = |name: &str, elapsed_ms: f64| Part {
            name: name.to_owned(),
            commands: 2,
            elapsed_ms,
            share_of_products: None,
            share_of_bandwidth: 0.25,
        };
        let mut all = vec![part("norm", 3.0), part("clear", 0.992)];
        all.extend([part("add", 0.004), part("copy", 0.004)]);
        let found = parts_table(&all, Some(2.0));
        for line in [
            "| norm | 2 | 3.000 | 75 % | - | 25 % |\n| clear | 2 | 0.992 | 25 % | - | 25 % |",
            "| others | 4 | 0.008 | 0 % | - | - |",
        ] {
            assert!(found.contains(line), "{found}");
        }
        let expected = "All 8 commands by themselves: 4.000 ms; run as one, with what goes up and down: 2.000 ms.";
        assert!(found.contains(expected), "{found}");
    }
}
