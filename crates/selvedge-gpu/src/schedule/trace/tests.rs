//! Faults that a trace finds.

use super::*;
use crate::kernels::adam::GRADIENT_SQUARES;
use crate::kernels::layers::{ADD_BIAS, NORM};
use crate::schedule::{NamedArgument, args};

const SIZES: Sizes = Sizes {
    latent: 8,
    node_width: 5,
    edge_width: 4,
};

/// The message for a schedule with these commands, in an arena where `given` is written.
fn message(plan: &Plan, given: &[Region], build: impl FnOnce(&mut Schedule)) -> String {
    let mut schedule = Schedule::new("test");
    build(&mut schedule);
    let mut trace = Trace::new(plan, SIZES);
    given.iter().for_each(|&region| trace.give(region));
    match trace.follow(&schedule) {
        Ok(()) => String::new(),
        Err(error) => error.to_string(),
    }
}

fn product(a: Region, b: Region, c: Region, onto: Onto) -> Product {
    Product {
        size: [3, 2, 4],
        a: Matrix::new(a, 4),
        b: Matrix::new(b, 4).transpose(),
        c: Matrix::new(c, 2),
        onto,
        epilogue: Epilogue::Nothing,
    }
}

#[test]
fn a_product_reads_and_writes_its_matrices() {
    let mut plan = Plan::new();
    let [a, b, c] = [("a", 12), ("b", 8), ("c", 6)].map(|(name, count)| plan.floats(name, count));
    let of = |given: &[Region], onto| {
        message(&plan, given, |schedule| {
            schedule.product(product(a, b, c, onto))
        })
    };
    assert_eq!(of(&[a, b], Onto::Set), "");
    assert!(of(&[a], Onto::Set).contains("reads b"));
    assert!(of(&[a, b], Onto::Add).contains("reads c"));
    assert_eq!(of(&[a, b, c], Onto::Add), "");
    let short = product(a.part(0..11), b, c, Onto::Set);
    let found = message(&plan, &[a, b], |schedule| schedule.product(short));
    assert!(
        found.contains("a matrix of 3 by 4, 4 apart, in 11 elements"),
        "{found}"
    );
}

#[test]
fn only_the_columns_that_a_product_writes_are_written() {
    let mut plan = Plan::new();
    let [a, b, c] = [("a", 12), ("b", 8), ("c", 9)].map(|(name, count)| plan.floats(name, count));
    let wide = Product {
        c: Matrix::new(c, 3),
        ..product(a, b, c, Onto::Set)
    };
    let mut schedule = Schedule::new("test");
    schedule.product(wide);
    let mut trace = Trace::new(&plan, SIZES);
    [a, b].into_iter().for_each(|region| trace.give(region));
    trace.follow(&schedule).expect("a product");
    assert!(trace.holds(c.part(0..2)) && trace.holds(c.part(6..8)));
    assert!(!trace.holds(c.part(0..3)) && !trace.holds(c));
    schedule.product(Product {
        c: Matrix::new(c, 3).from_column(1),
        ..wide
    });
    trace.follow(&schedule).expect("two products");
    assert!(trace.holds(c), "both together fill it");
}

#[test]
fn what_another_array_was_written_over_is_not_read() {
    let mut plan = Plan::new();
    let mark = plan.mark();
    let first = plan.floats("first", 10);
    plan.release(mark);
    let (second, to) = (plan.floats("second", 4), plan.floats("to", 10));
    let found = message(&plan, &[first], |schedule| {
        schedule.copy(first, to);
        schedule.clear(second);
        schedule.copy(first, to);
    });
    assert_eq!(
        found,
        "schedule test, command 2 (copy): reads first, which was not written, or was overwritten"
    );
    let found = message(&plan, &[first], |schedule| {
        schedule.clear(second);
        schedule.copy(first.part(4..10), to.part(0..6));
    });
    assert_eq!(found, "", "what lies behind it is still there");
}

#[test]
fn a_launch_has_the_arguments_of_its_kernel() {
    let mut plan = Plan::new();
    let [x, y, inverse] = [16, 16, 2].map(|count| plan.floats("rows", count));
    let [bias, weight, shift] = [8; 3].map(|count| plan.floats("latent", count));
    let given = [x, bias, weight, shift];
    let nothing = Argument::Nothing;
    let arguments = |after: Region, inverse: Argument| {
        // In another order than the kernel's.
        args! { after, inverse, x, bias, weight, shift, before: nothing, normal: nothing }
    };
    let of = |count, arguments: &[NamedArgument]| {
        message(&plan, &given, |schedule| {
            schedule.launch(&NORM, count, arguments.to_vec())
        })
    };
    let good = arguments(y, inverse.into());
    assert_eq!(of(2, &good), "");
    assert_eq!(of(2, &arguments(x, nothing)), "", "in place");
    assert!(of(3, &good).contains("x: 16 elements, expected 24"));
    assert!(of(2, &good[..7]).contains("there is no argument normal"));
    let twice = [&good[..], &good[..1]].concat();
    assert!(of(2, &twice).contains("there are 2 arguments after"));
    let extra = [good.clone(), args! { scale: 1.0_f32 }].concat();
    assert!(of(2, &extra).contains("it has no parameter scale"));
    let found = of(2, &arguments(y, Argument::Count(1)));
    assert!(found.contains("inverse: Count(1) for Array"), "{found}");
    let without = args! { ..good[..2].to_vec(), ..good[3..].to_vec(), x: nothing };
    let found = of(2, &without);
    assert!(found.contains("x: Nothing for Array"), "{found}");
    let mut overlapping = plan.clone();
    let both = overlapping.floats("both", 24);
    let found = message(&overlapping, &[both, bias, weight, shift], |schedule| {
        let mut arguments = arguments(both.part(8..24), nothing);
        arguments[2].1 = both.part(0..16).into();
        schedule.launch(&NORM, 2, arguments);
    });
    assert!(found.contains("both overlaps another argument"), "{found}");
}

#[test]
fn an_array_has_the_size_that_the_counts_of_its_launch_say() {
    let mut plan = Plan::new();
    let gradient = plan.floats("gradient", 20);
    let squares = plan.doubles("squares", 1);
    let of = |parameters: usize| {
        message(&plan, &[gradient], |schedule| {
            let arguments = args! { gradient, parameters, squares };
            schedule.launch(&GRADIENT_SQUARES, 1, arguments);
        })
    };
    assert_eq!(of(20), "");
    assert!(of(21).contains("gradient: 20 elements, expected 21"));
}

#[test]
fn indices_are_not_taken_for_numbers() {
    let mut plan = Plan::new();
    let rows = plan.floats("rows", 8);
    let indices = plan.indices("indices", 8);
    let found = message(&plan, &[rows, indices], |schedule| {
        let arguments = args! { rows, leading: 8_usize, bias: indices, width: 8_usize };
        schedule.launch(&ADD_BIAS, 1, arguments);
    });
    assert!(found.contains("bias: Region"), "{found}");
    let found = message(&plan, &[rows, indices], |schedule| schedule.clear(indices));
    assert!(found.contains("indices is not of Float"), "{found}");
}
