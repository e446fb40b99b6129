//! Many short lists of numbers in two arrays: the entries of each key.

use std::ops::Range;

/// The lists of keys 0, 1, ….
#[derive(Clone, Debug)]
pub(crate) struct Lists {
    starts: Vec<u32>,
    entries: Vec<u32>,
}

impl Lists {
    /// The lists of `count` keys, from pairs (key, entry). A list keeps the order of its entries.
    pub(crate) fn group(count: usize, pairs: &[(u32, u32)]) -> Self {
        let mut starts = vec![0_u32; count + 1];
        for (key, _) in pairs {
            starts[*key as usize + 1] += 1;
        }
        for key in 0..count {
            starts[key + 1] += starts[key];
        }
        let mut next = starts.clone();
        let mut entries = vec![0; pairs.len()];
        for (key, entry) in pairs {
            let place = &mut next[*key as usize];
            entries[*place as usize] = *entry;
            *place += 1;
        }
        Self { starts, entries }
    }

    /// Places of the entries of `key` among all.
    #[inline]
    pub(crate) fn range(&self, key: usize) -> Range<usize> {
        self.starts[key] as usize..self.starts[key + 1] as usize
    }

    /// The entries of `key`, in order.
    #[inline]
    pub(crate) fn of(&self, key: usize) -> &[u32] {
        &self.entries[self.range(key)]
    }

    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }
}
