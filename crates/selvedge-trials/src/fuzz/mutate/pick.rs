//! A choice by chance.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// One of `all`.
pub(super) fn pick<'a, T>(all: &'a [T], rng: &mut ChaCha8Rng) -> &'a T {
    &all[rng.random_range(0..all.len())]
}
