//! Tests of the CUDA device that need no GPU: messages, grids, products as cuBLAS reads them, and,
//! by `cargo test -- --ignored` where NVRTC is installed, the compilation of all kernels. The other
//! tests of this crate compare a card with the processor under `SELVEDGE_TEST_DEVICE=cuda`.

use super::compile::{Target, target};
use super::loaded::grid;
use super::product::Gemm;
use super::*;
use crate::kernels::{Shape, Sizes};
use crate::schedule::plan::Region;
use crate::schedule::{Epilogue, Matrix, Onto, Product};
use crate::test_graphs::{full_specs, numbers};

#[test]
fn what_is_missing_is_said_with_what_to_do() {
    match Cuda::new(0) {
        Ok(cuda) => assert!(cuda.free_bytes().expect("an answer") > 0, "{}", cuda.name()),
        Err(error) => {
            let found = error.to_string();
            let words = [
                "was not found: install",
                "no GPU that it can use",
                "too old",
                "failed on the device",
            ];
            assert!(words.iter().any(|words| found.contains(words)), "{found}");
        }
    }
}

#[test]
fn an_old_driver_is_named_with_what_is_needed() {
    // From the oldest that is taken up, and not one below it.
    for (version, is_taken) in [
        (11_080, false),
        (11_999, false),
        (12_000, true),
        (13_020, true),
    ] {
        assert_eq!(check_version(version, 12).is_ok(), is_taken, "{version}");
    }
    let found = check_version(11_080, 12).expect_err("too old").to_string();
    assert!(
        found.contains("knows CUDA 11.8, and 12.0 is needed"),
        "{found}"
    );
}

#[test]
fn libraries_that_are_newer_than_the_driver_are_named() {
    for (version, major, is_taken) in [
        (12_080, 12, true),
        (12_090, 13, false),
        (13_000, 13, true),
        (13_020, 12, true),
    ] {
        let checked = check_version(version, major);
        assert_eq!(checked.is_ok(), is_taken, "{version}, {major}");
    }
    let found = check_version(12_080, 13).expect_err("too old").to_string();
    assert!(
        found.contains("knows CUDA 12.8, and 13.0 is needed: NVRTC and cuBLAS"),
        "{found}"
    );
}

#[test]
fn the_card_itself_is_compiled_for_or_the_newest_that_is_known() {
    let card = |major, minor| Architecture { major, minor };
    let known = [75, 80, 86, 89, 90];
    assert_eq!(target(card(9, 0), &known), Some(Target::Real(90)));
    assert_eq!(target(card(8, 6), &known), Some(Target::Real(86)));
    assert_eq!(target(card(12, 0), &known), Some(Target::Virtual(90)));
    assert_eq!(target(card(8, 7), &known), Some(Target::Virtual(86)));
    assert_eq!(target(card(6, 1), &known), None);
}

#[test]
fn grids_cover_what_they_are_for_and_not_a_block_more() {
    for count in [1, 7, 8, 9, 255, 256, 257, 600_000, 78_643_200] {
        let of = |shape| {
            let (blocks, threads) = grid(shape, count);
            (blocks as usize, threads as usize)
        };
        let (blocks, threads) = of(Shape::Element);
        assert!(blocks * threads >= count && (blocks - 1) * threads < count);
        let (blocks, threads) = of(Shape::Row);
        assert_eq!(threads % 32, 0, "whole warps");
        assert!(blocks * threads / 32 >= count && (blocks - 1) * threads / 32 < count);
        // What a kernel counts threads by does not overflow.
        assert!(blocks * threads < 1 << 32);
    }
}

/// The computation of cuBLAS: out = op(left) op(right) + beta out, all column by column.
fn column_by_column(gemm: &Gemm, arena: &mut [f32]) {
    let [m, n, k] = gemm.size.map(|size| size as usize);
    let at = |(transposed, first, leading): (bool, usize, i32), row: usize, column: usize| {
        let (row, column) = if transposed {
            (column, row)
        } else {
            (row, column)
        };
        first + row + column * leading as usize
    };
    let (first, leading) = gemm.out;
    for row in 0..m {
        for column in 0..n {
            let term = |l: usize| arena[at(gemm.left, row, l)] * arena[at(gemm.right, l, column)];
            let sum: f32 = (0..k).map(term).sum();
            let out = first + row + column * leading as usize;
            arena[out] = sum + gemm.beta * arena[out];
        }
    }
}

#[test]
fn a_product_is_the_same_column_by_column() {
    let (m, n, k) = (5, 3, 4);
    let mut plan = Plan::new();
    let [a, b, c] = [60, 60, 60].map(|count| plan.floats("matrix", count));
    let words = |region: Region| plan.place(region);
    for (a_transposed, b_transposed) in [(false, true), (false, false), (true, false), (true, true)]
    {
        for onto in [Onto::Set, Onto::Add] {
            let matrix = |region, leading, transposed| Matrix {
                region,
                leading,
                transposed,
            };
            let product = Product {
                size: [m, n, k],
                a: matrix(a, 7, a_transposed),
                b: matrix(b, 8, b_transposed).from_column(2),
                c: matrix(c, 6, false).from_column(1),
                onto,
                epilogue: Epilogue::Nothing,
            };
            let gemm = Gemm::of(&product, |m| plan.place(m.region).start).expect("sizes");
            let mut arena = numbers(plan.words(), 1.0, 5);
            let before = arena.clone();
            column_by_column(&gemm, &mut arena);
            let element = |matrix: Matrix, row: usize, column: usize| {
                let (row, column) = if matrix.transposed {
                    (column, row)
                } else {
                    (row, column)
                };
                words(matrix.region).start + row * matrix.leading + column
            };
            for row in 0..m {
                for column in 0..n {
                    let term = |l| {
                        before[element(product.a, row, l)] * before[element(product.b, l, column)]
                    };
                    let sum: f32 = (0..k).map(term).sum();
                    let at = element(product.c, row, column);
                    let old = if onto == Onto::Add { before[at] } else { 0.0 };
                    assert!((arena[at] - sum - old).abs() < 1e-6);
                }
            }
            let changed = arena.iter().zip(&before).filter(|(x, y)| x != y).count();
            assert_eq!(changed, m * n, "nothing else is written");
        }
    }
}

#[test]
#[ignore = "needs NVRTC"]
fn the_kernels_of_every_spec_compile_with_nvrtc() {
    for spec in full_specs() {
        let mut program = Program::new(Sizes::of(&spec));
        program.add(&crate::kernels::layers::PART);
        program.add(&crate::kernels::backward::PART);
        crate::kernels::features::define(&mut program, &spec);
        program.add(&crate::kernels::motion::PART);
        let programs = [program, crate::training::program(&spec)];
        let cards = [(8, 6), (9, 0)].map(|(major, minor)| Architecture { major, minor });
        for (program, card) in programs
            .iter()
            .flat_map(|program| cards.map(|card| (program, card)))
        {
            let image = compile(&program.text(Dialect::Cuda), card);
            let image = image.unwrap_or_else(|error| panic!("{error}"));
            assert!(image.starts_with(b"\x7fELF"), "machine code");
        }
    }
    let card = Architecture { major: 9, minor: 0 };
    let found = compile("extern \"C\" __global__ void broken( {", card);
    let found = found.expect_err("no kernel").to_string();
    assert!(
        found.contains("do not compile with NVRTC") && found.contains("error"),
        "{found}"
    );
}
