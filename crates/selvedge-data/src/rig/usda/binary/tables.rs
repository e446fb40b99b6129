//! The tables of a crate, and the tree of its paths.

use super::values::Rep;
use crate::formats::packing::{little, unpack, unpack_numbers};

/// Specs by their kinds.
pub(super) const ATTRIBUTE: i64 = 1;
pub(super) const PRIM: i64 = 6;
pub(super) const PSEUDO_ROOT: i64 = 7;
pub(super) const VARIANT_SET: i64 = 11;

/// End of a set of fields.
const END: i64 = -1;
const MOST_FIELDS: usize = 1000;
/// Oldest version that is read, as of OpenUSD.
const OLDEST: u8 = 4;

pub(super) struct Tables {
    /// Number of the version after "0.".
    pub(super) version: u8,
    pub(super) tokens: Vec<String>,
    /// Tokens of the texts.
    texts: Vec<usize>,
    fields: Vec<(usize, Rep)>,
    sets: Vec<i64>,
    pub(super) paths: Vec<Path>,
    pub(super) specs: Vec<Spec>,
}

#[derive(Clone, Copy)]
pub(super) struct Spec {
    pub(super) path: usize,
    set: usize,
    pub(super) kind: i64,
}

impl Tables {
    /// The tables of a crate.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let version = match bytes.get(8..10) {
            Some(&[0, minor]) if minor >= OLDEST => minor,
            Some(&[major, minor]) => {
                return Err(format!(
                    "is binary USD of version {major}.{minor}, known are 0.{OLDEST} and later: save it anew, or as text (usdcat in.usdc --out out.usda)"
                ));
            }
            _ => return Err(cut()),
        };
        let contents = Part {
            bytes,
            at: Part { bytes, at: 16 }.number(8)?,
        };
        let most = bytes.len().saturating_mul(4) + 4096;
        let table = |name: &str| -> Result<(Part<'_>, usize), String> {
            let mut part = contents.section(name)?;
            let count = part.bounded(most)?;
            Ok((part, count))
        };
        let (part, count) = table("TOKENS")?;
        let tokens = tokens(part, count)?;
        let (mut part, count) = table("STRINGS")?;
        let texts = part.words(count)?;
        let (mut part, count) = table("FIELDS")?;
        let names = part.numbers(count, 4)?;
        let values = unpack(part.counted()?, 8 * count)?;
        let values = values.chunks_exact(8).map(Rep::of);
        let fields = names.into_iter().map(|name| name as usize).zip(values);
        let (mut part, count) = table("FIELDSETS")?;
        let sets = part.numbers(count, 4)?;
        let (mut part, all) = table("PATHS")?;
        let count = part.bounded(all)?;
        let lists = part.columns(count)?;
        let (mut part, count) = table("SPECS")?;
        let columns = part.columns(count)?;
        let spec = |k: usize| Spec {
            path: columns[0][k] as usize,
            set: columns[1][k] as usize,
            kind: columns[2][k],
        };
        Ok(Self {
            version,
            paths: paths(&lists, all, &tokens)?,
            texts,
            fields: fields.collect(),
            sets,
            specs: (0..count).map(spec).collect(),
            tokens,
        })
    }

    /// Returns true where the text of this number is there and empty.
    pub(super) fn is_empty_text(&self, number: usize) -> bool {
        let token = self.texts.get(number);
        let token = token.and_then(|&token| self.tokens.get(token));
        token.is_some_and(String::is_empty)
    }

    /// The path of this number, as `/a/b`; empty for none.
    pub(super) fn path(&self, number: usize) -> String {
        let own = self.paths.get(number).filter(|path| path.above.is_some());
        let above = |path: &&Path| self.paths.get(path.above?).filter(|p| p.above.is_some());
        let mut names: Vec<&str> = std::iter::successors(own, above)
            .take(self.paths.len())
            .map(|path| path.name.as_str())
            .collect();
        names.reverse();
        names.iter().map(|name| format!("/{name}")).collect()
    }

    /// The fields of a spec: names and values.
    pub(super) fn fields(&self, spec: Spec) -> Result<Vec<(&str, Rep)>, String> {
        let mut fields = Vec::new();
        for &number in self.sets.get(spec.set..).unwrap_or_default() {
            if number == END {
                return Ok(fields);
            }
            if fields.len() == MOST_FIELDS {
                break;
            }
            let field = self.fields.get(number as usize);
            let &(name, value) = field.ok_or_else(cut)?;
            let name = self.tokens.get(name).ok_or_else(cut)?;
            fields.push((name.as_str(), value));
        }
        Err("has a set of fields without an end: it was changed".to_owned())
    }
}

/// A path: what is above it, and its last part.
#[derive(Clone, Debug, Default)]
pub(super) struct Path {
    pub(super) above: Option<usize>,
    pub(super) name: String,
    pub(super) is_property: bool,
    /// Place in the order of the tree: what is above comes first.
    pub(super) order: usize,
}

/// The paths of three lists: their numbers, the tokens of their last parts, negative for
/// properties, and the jumps to their siblings: -2 where neither child nor sibling follows, -1 for
/// a child, 0 for a sibling, else a child follows, and a sibling so many entries on.
fn paths(lists: &[Vec<i64>; 3], count: usize, tokens: &[String]) -> Result<Vec<Path>, String> {
    let wrong = || "has a tree of paths that cannot be: it was changed".to_owned();
    let [numbers, names, jumps] = lists;
    let mut all = vec![Path::default(); count];
    // Where siblings go on later, and what is above them.
    let mut later: Vec<(usize, Option<usize>)> = Vec::new();
    let (mut at, mut above) = (0, None);
    for order in 0..numbers.len() {
        let (Some(&number), Some(&name), Some(&jump)) =
            (numbers.get(at), names.get(at), jumps.get(at))
        else {
            return Err(wrong());
        };
        let number = usize::try_from(number).ok().filter(|&n| n < count);
        let number = number.ok_or_else(wrong)?;
        if order > 0 {
            let token = tokens.get(name.unsigned_abs() as usize).ok_or_else(wrong)?;
            all[number] = Path {
                above,
                name: token.clone(),
                is_property: name < 0,
                order,
            };
        }
        if jump > 0 {
            later.push((at + jump as usize, above));
        }
        let has_child = jump > 0 || jump == -1;
        if has_child || order == 0 {
            above = Some(number);
        }
        if has_child || jump >= 0 {
            at += 1;
        } else if let Some((next, its)) = later.pop() {
            (at, above) = (next, its);
        } else {
            break;
        }
    }
    Ok(all)
}

pub(super) fn cut() -> String {
    "is no whole binary USD file: it was cut short or changed".to_owned()
}

/// So many texts, each ended by a zero.
fn tokens(mut part: Part<'_>, count: usize) -> Result<Vec<String>, String> {
    let length = part.number(8)?;
    let packed = part.counted()?;
    if length > packed.len().saturating_mul(256) {
        return Err(cut());
    }
    let text = unpack(packed, length)?;
    let tokens = text.split(|&byte| byte == 0).take(count);
    Ok(tokens
        .map(|token| String::from_utf8_lossy(token).into_owned())
        .collect())
}

/// Bytes that are read from a place on.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<'a> Part<'a> {
    pub(super) fn take(&mut self, length: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(length).ok_or_else(cut)?;
        let taken = self.bytes.get(self.at..end).ok_or_else(cut)?;
        self.at = end;
        Ok(taken)
    }

    /// A number of so many bytes.
    pub(super) fn number(&mut self, width: usize) -> Result<usize, String> {
        usize::try_from(little(self.take(width)?)).map_err(|_| cut())
    }

    /// A number of entries, at most `most`.
    fn bounded(&mut self, most: usize) -> Result<usize, String> {
        match self.number(8)? {
            count if count <= most => Ok(count),
            count => Err(format!("has a table of {count} entries, more than {most}")),
        }
    }

    /// Bytes after their length.
    fn counted(&mut self) -> Result<&'a [u8], String> {
        let length = self.number(8)?;
        self.take(length)
    }

    /// Whole numbers of 32 bits.
    pub(super) fn words(&mut self, count: usize) -> Result<Vec<usize>, String> {
        let bytes = self.take(count.checked_mul(4).ok_or_else(cut)?)?;
        Ok(bytes.chunks_exact(4).map(|b| little(b) as usize).collect())
    }

    /// Packed whole numbers after their length, whose differences have at most `width` bytes.
    pub(super) fn numbers(&mut self, count: usize, width: usize) -> Result<Vec<i64>, String> {
        unpack_numbers(self.counted()?, count, width)
    }

    /// Three lists of packed whole numbers of 32 bits.
    fn columns(&mut self, count: usize) -> Result<[Vec<i64>; 3], String> {
        let mut column = || self.numbers(count, 4);
        Ok([column()?, column()?, column()?])
    }

    /// The table of this name, of the contents here.
    fn section(mut self, name: &str) -> Result<Self, String> {
        let count = self.bounded(64)?;
        for _ in 0..count {
            let entry = self.take(16)?;
            let (bytes, at) = (self.bytes, self.number(8)?);
            self.number(8)?;
            if entry.split(|&byte| byte == 0).next() == Some(name.as_bytes()) {
                return Ok(Self { bytes, at });
            }
        }
        Err(format!("has no table {name}"))
    }
}
