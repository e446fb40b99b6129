//! A line font drawn for this crate: each glyph is a few strokes of even width with round ends.
//!
//! A point is two base-36 digits (x, then y down) in units of 1/14 of the height of capitals: 0 is
//! their top, 4 the top of small letters, e (14) the base line, i (18) the foot of descenders.
//! A stroke is straight from point to point; after `~` it is an open and after `@` a closed
//! quadratic B-spline of its points (the open one starts and ends in its first and last).
//! Digits are equally wide, so that running numbers stand still.

/// A glyph: its width in units without the space around it, and its strokes.
pub(crate) struct Glyph {
    pub(crate) width: u8,
    pub(crate) strokes: &'static str,
}

/// Height of capitals in units.
pub(crate) const CAPITAL_HEIGHT: f32 = 14.0;
/// Space between two glyphs in units.
pub(crate) const SPACING: f32 = 4.2;

/// The glyph of a character; a hollow box for one that the font lacks.
pub(crate) fn glyph(character: char) -> Glyph {
    let (width, strokes) = letter(character)
        .or_else(|| sign(character))
        .unwrap_or((8, "00808e0e00"));
    Glyph { width, strokes }
}

fn letter(character: char) -> Option<(u8, &'static str)> {
    Some(match character {
        'A' => (10, "0e50ae 1a9a"),
        'B' => (9, "000e ~004080874707 ~0747979e4e0e"),
        'C' => (10, "~a4a0000eaeaa"),
        'D' => (10, "000e ~0040a0ae4e0e"),
        'E' => (8, "80000e8e 0767"),
        'F' => (8, "80000e 0767"),
        'G' => (10, "~a4a0000eaea8 68a8"),
        'H' => (10, "000e a0ae 07a7"),
        'I' => (0, "000e"),
        'J' => (7, "~70797e0e0a"),
        'K' => (9, "000e 9009 369e"),
        'L' => (8, "000e8e"),
        'M' => (12, "0e006ac0ce"),
        'N' => (10, "0e00aea0"),
        'O' => (11, "@00b0be0e"),
        'P' => (9, "000e ~005090985808"),
        'Q' => (11, "@00b0be0e 7abf"),
        'R' => (9, "000e ~005090975707 579e"),
        'S' => (9, "~93900007979e0e0b"),
        'T' => (10, "00a0 505e"),
        'U' => (10, "~00090eaea9a0"),
        'V' => (10, "005ea0"),
        'W' => (14, "004e73aee0"),
        'X' => (9, "009e 900e"),
        'Y' => (10, "0057a0 575e"),
        'Z' => (9, "00900e9e"),
        'a' => (8, "848e @04848e0e"),
        'b' => (8, "000e @04848e0e"),
        'c' => (8, "~8784040e8e8b"),
        'd' => (8, "808e @04848e0e"),
        'e' => (8, "0989 ~8984040e8e8c"),
        'f' => (6, "~6020252e 0454"),
        'g' => (8, "@04848e0e ~848d8i0i0h"),
        'h' => (8, "000e ~090484898e"),
        'i' => (0, "040e 0001"),
        'j' => (3, "~343c3i0i 3031"),
        'k' => (7, "000e 740a 377e"),
        'l' => (3, "~000a0e3e"),
        'm' => (12, "040e ~090464696e ~6964c4c9ce"),
        'n' => (8, "040e ~090484898e"),
        'o' => (8, "@04848e0e"),
        'p' => (8, "040i @04848e0e"),
        'q' => (8, "848i @04848e0e"),
        'r' => (5, "040e ~090454"),
        's' => (7, "~76740409797e0e0c"),
        't' => (6, "~212a2e6e 0454"),
        'u' => (8, "848e ~04090e8e89"),
        'v' => (8, "044e84"),
        'w' => (12, "043e659ec4"),
        'x' => (7, "047e 740e"),
        'y' => (8, "044e 842i"),
        'z' => (7, "04740e7e"),
        _ => return None,
    })
}

fn sign(character: char) -> Option<(u8, &'static str)> {
    Some(match character {
        ' ' => (3, ""),
        '0' => (8, "@00808e0e"),
        '1' => (8, "23505e"),
        '2' => (8, "~040080860e 0e8e"),
        '3' => (8, "~0300808737 ~37878e0e0b"),
        '4' => (8, "6e600a8a"),
        '5' => (8, "700007 ~0705858e0e0b"),
        '6' => (8, "@05858e0e ~090070"),
        '7' => (8, "00803e"),
        '8' => (8, "@10707717 @07878e0e"),
        '9' => (8, "@00808909 ~858e1e"),
        '.' => (0, "0d0e"),
        ',' => (1, "1d0g"),
        ':' => (0, "0506 0d0e"),
        ';' => (1, "1516 1d0g"),
        '!' => (0, "0009 0d0e"),
        '?' => (7, "~03007076373a 3d3e"),
        '-' => (6, "0868"),
        '–' | '—' => (10, "08a8"),
        '_' => (8, "0g8g"),
        '+' => (8, "0989 454d"),
        '=' => (8, "0787 0b8b"),
        '/' => (6, "600f"),
        '\\' => (6, "006f"),
        '|' => (0, "000g"),
        '(' => (3, "~30050b3g"),
        ')' => (3, "~00353b0g"),
        '[' => (3, "30000g3g"),
        ']' => (3, "00303g0g"),
        '{' => (4, "40202608 2a2g4g 082a"),
        '}' => (4, "00202648 2a2g0g 482a"),
        '<' => (7, "74097e"),
        '>' => (7, "04790e"),
        '\'' => (0, "0003"),
        '"' => (3, "0003 3033"),
        '`' => (2, "0023"),
        '#' => (9, "301e 806e 1494 0a8a"),
        '%' => (11, "b00e @00404505 @79b9be7e"),
        '&' => (10, "~ae24207074080e8ea8"),
        '*' => (6, "3038 0266 6206"),
        '@' => (12, "@44949b4b ~949bcbc0000ece"),
        '$' => (9, "~93900007979e0e0b 404e"),
        '^' => (6, "033063"),
        '~' => (8, "~0a266c88"),
        '°' => (4, "@00404404"),
        'µ' => (8, "040i 848e ~04090e8e89"),
        '²' => (5, "~0200505407 0757"),
        '×' => (6, "066c 660c"),
        '→' => (10, "09a9 75a97d"),
        '·' => (0, "0809"),
        _ => return None,
    })
}
