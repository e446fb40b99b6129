//! The tree of paths of a crate.

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
pub(super) fn paths(
    lists: &[Vec<i64>; 3],
    count: usize,
    tokens: &[String],
) -> Result<Vec<Path>, String> {
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
