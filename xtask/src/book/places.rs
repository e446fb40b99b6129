//! Places of the book in the repository.

/// Folder of the book's pages.
pub(super) const PAGES: &str = "docs/src/";
/// Experiments of the past, with the commands of their day.
pub(super) const NOTEBOOK: &str = "docs/src/notebook/";
/// Page that the program itself writes.
pub(super) const REFERENCE: &str = "docs/src/reference/commands.md";
/// List of the book's pages, in their order.
pub(super) const SUMMARY: &str = "docs/src/SUMMARY.md";
