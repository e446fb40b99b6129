//! The page, as it is built from `web/` and compiled in: these files and no others are served.

/// The content type and the bytes of the file that is served at exactly `path`.
pub(crate) fn at(path: &str) -> Option<(&'static str, &'static [u8])> {
    let file: (_, &[u8]) = match path {
        "/" => (
            "text/html; charset=utf-8",
            include_bytes!("../../page/index.html"),
        ),
        "/viewer.js" => (
            "text/javascript; charset=utf-8",
            include_bytes!("../../page/viewer.js"),
        ),
        "/viewer.css" => (
            "text/css; charset=utf-8",
            include_bytes!("../../page/viewer.css"),
        ),
        "/icon.svg" => ("image/svg+xml", include_bytes!("../../page/icon.svg")),
        _ => return None,
    };
    Some(file)
}
