//! References from prim to prim of the same file: what flattening leaves of instances.
//!
//! The prim gets what the other one has and it does not have itself, and a copy of all that is in
//! the other one. The transforms above the other one do not count.

use std::collections::{HashMap, VecDeque};

use super::operations::Attribute;
use super::prim::{Absence, Prim};

/// Prims at most that references make.
const MOST_PRIMS: usize = 100_000;
/// Numbers at most that they copy.
const MOST_NUMBERS: usize = 20_000_000;

/// Follows all references within the file; a prim that brings prims of its own beside one cannot be
/// told, and neither can a way that leads back to where it began.
pub(super) fn follow(prims: &mut Vec<Prim>) -> Result<(), String> {
    if prims.iter().all(|prim| prim.reference.is_none()) {
        return Ok(());
    }
    let mut paths: HashMap<String, usize> = HashMap::new();
    let mut named: Vec<String> = Vec::with_capacity(prims.len());
    let mut within: Vec<Vec<usize>> = vec![Vec::new(); prims.len()];
    for (number, prim) in prims.iter().enumerate() {
        let above = prim.parent.map_or("", |parent| named[parent].as_str());
        let path = format!("{above}/{}", prim.name);
        paths.entry(path.clone()).or_insert(number);
        named.push(path);
        if let Some(parent) = prim.parent {
            within[parent].push(number);
        }
    }
    let most = prims.len() + MOST_PRIMS;
    let mut left = MOST_NUMBERS;
    let mut at = 0;
    while at < prims.len() {
        let number = at;
        at += 1;
        let Some(path) = prims[number].reference.take() else {
            continue;
        };
        let mut chain = std::iter::successors(Some(number), |&k| prims[k].parent);
        let original = paths.get(&path).copied().filter(|&original| {
            let is_chained = prims[original].reference.is_some();
            within[number].is_empty() && !is_chained && chain.all(|above| above != original)
        });
        let Some(original) = original else {
            prims[number].lacks(format!(
                "its reference to <{path}> is not followed here: set instanceable = false and flatten the stage (usdcat --flatten), or export .glb"
            ));
            continue;
        };
        if prims[original].absence == Some(Absence::Undefined) {
            prims[original].absence = Some(Absence::Class);
        }
        let taken = prims[original].clone();
        spend(&taken.attributes, &mut left)?;
        prims[number].takes(taken);
        // What is to be copied, and where its copy goes.
        let inner = within[original].iter();
        let mut open: VecDeque<(usize, usize)> = inner.map(|&k| (k, number)).collect();
        while let Some((from, parent)) = open.pop_front() {
            let copy = Prim {
                parent: Some(parent),
                ..prims[from].clone()
            };
            spend(&copy.attributes, &mut left)?;
            if prims.len() == most {
                return Err(format!(
                    "has references within the file that make more than {MOST_PRIMS} prims"
                ));
            }
            let number = prims.len();
            prims.push(copy);
            within.push(Vec::new());
            within[parent].push(number);
            open.extend(within[from].iter().map(|&k| (k, number)));
        }
    }
    Ok(())
}

/// Counts the numbers of what is copied.
fn spend(attributes: &[Attribute], left: &mut usize) -> Result<(), String> {
    let samples = attributes.iter().flat_map(|attribute| &attribute.samples);
    let rest = left.checked_sub(samples.map(|(_, numbers)| 1 + numbers.len()).sum());
    *left = rest.ok_or_else(|| {
        format!("has references within the file that copy more than {MOST_NUMBERS} numbers")
    })?;
    Ok(())
}
