//! Places of the book in the repository.

/// Folder of the book's pages.
pub(super) const PAGES: &str = "docs/src/";
/// List of the book's pages, in their order.
pub(super) const SUMMARY: &str = "docs/src/SUMMARY.md";
