//! Recorded handle motion as CSV: the header `frame,handle,x,y,z`, then one row per handle and
//! frame in any order, positions in metres. Frames and handles count from 0; frame 0 is where the
//! handles start, and handle 0 is the first in the scene's list.

use std::collections::HashMap;

use glam::DVec3;
use selvedge_cloth::RecordedMotion;

use crate::formats::file_error::Problem;

const HEADER: [&str; 5] = ["frame", "handle", "x", "y", "z"];

/// Reads a recorded motion.
///
/// # Errors
/// [`Problem`] names the line, from 1, or the frame and handle that are missing.
pub fn parse_recorded_csv(text: &str) -> Result<RecordedMotion, Problem> {
    parse(text).map_err(Problem)
}

fn parse(text: &str) -> Result<RecordedMotion, String> {
    let mut lines = text.lines().enumerate();
    let header = lines.next().map_or("", |(_, header)| header);
    // Spreadsheets put a byte-order mark before the header.
    let header = header.trim_start_matches('\u{feff}');
    if !header.split(',').map(str::trim).eq(HEADER) {
        return Err(format!(
            "line 1: expected the header frame,handle,x,y,z, found {header:?}"
        ));
    }
    // Each with its line.
    let mut rows: HashMap<(usize, usize), (usize, DVec3)> = HashMap::new();
    for (number, content) in lines {
        if content.trim().is_empty() {
            continue;
        }
        let line = number + 1;
        let (frame, handle, position) = parse_row(line, content)?;
        if let Some((earlier, _)) = rows.insert((frame, handle), (line, position)) {
            return Err(format!(
                "line {line}: frame {frame}, handle {handle} was already given in line {earlier}"
            ));
        }
    }
    collect(&rows)
}

fn parse_row(line: usize, content: &str) -> Result<(usize, usize, DVec3), String> {
    let cells: Vec<&str> = content.split(',').map(str::trim).collect();
    let &[frame, handle, x, y, z] = cells.as_slice() else {
        let found = cells.len();
        return Err(format!("line {line}: expected 5 columns, found {found}"));
    };
    let error = |column: &str, expected: &str, found: &str| {
        format!("line {line}: {column} must be {expected}, found {found:?}")
    };
    let count = |column, text: &str| {
        text.parse::<usize>()
            .map_err(|_| error(column, "a number from 0", text))
    };
    let metres = |column, text: &str| match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(error(column, "a finite number", text)),
    };
    let position = DVec3::new(metres("x", x)?, metres("y", y)?, metres("z", z)?);
    Ok((count("frame", frame)?, count("handle", handle)?, position))
}

fn collect(rows: &HashMap<(usize, usize), (usize, DVec3)>) -> Result<RecordedMotion, String> {
    let last = |of: fn(&(usize, usize)) -> usize| rows.keys().map(of).max();
    let (Some(last_frame), Some(last_handle)) = (last(|key| key.0), last(|key| key.1)) else {
        return Err("there are no rows".to_owned());
    };
    let position = |frame, handle| {
        let row = rows.get(&(frame, handle));
        let missing = || format!("there is no row for frame {frame}, handle {handle}");
        row.map(|row| row.1).ok_or_else(missing)
    };
    let frames = (0..=last_frame).map(|frame| {
        let handles = (0..=last_handle).map(|handle| position(frame, handle));
        handles.collect::<Result<_, _>>()
    });
    let positions = frames.collect::<Result<_, _>>()?;
    Ok(RecordedMotion { positions })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_help::{says, table};

    #[test]
    fn rows_may_come_in_any_order() {
        let text = "frame, handle, x, y, z\r\n1,0,4,5,6\r\n\r\n0,0,1,2,3\r\n";
        let motion = parse_recorded_csv(text).unwrap();
        let expected = [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)].map(|p| vec![DVec3::from(p)]);
        assert_eq!(motion.positions, expected);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let refused = |text: &str| parse_recorded_csv(text).unwrap_err();
        says(refused(""), &["line 1: expected the header"]);
        let words = ["found \"time,handle,x,y,z\""];
        says(refused("time,handle,x,y,z\n"), &words);
        says(refused("frame,handle,x,y,z\n"), &["there are no rows"]);
        let cases = r#"
            0,0,1,2\n | line 2: expected 5 columns, found 4
            0,0,1,2,NaN\n | line 2: z must be a finite number, found "NaN"
            \n0,-1,1,2,3\n | line 3: handle must be a number from 0
            0,0,1,2,3\n2,0,1,2,3\n | no row for frame 1, handle 0
            0,0,1,2,3\n0,0,1,2,3\n | line 3: frame 0, handle 0 was already given in line 2
            18446744073709551615,0,1,2,3\n | no row for frame 0, handle 0
        "#;
        for [rows, expected] in table(cases) {
            says(refused(&format!("frame,handle,x,y,z\n{rows}")), &[expected]);
        }
    }
}
