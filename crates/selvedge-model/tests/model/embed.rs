//! The example of the crate runs.

#[path = "../../examples/embed.rs"]
mod example;

#[test]
fn the_example_moves_a_cloth_by_its_handles() {
    example::main().expect("the example");
}
