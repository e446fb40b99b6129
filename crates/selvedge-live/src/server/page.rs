//! The page, as it is built from `web/` and compiled in: these files and no others are served.

pub(crate) struct PageFile {
    /// The path at which it is served.
    pub(crate) path: &'static str,
    pub(crate) content_type: &'static str,
    /// The contents.
    pub(crate) bytes: &'static [u8],
}

const FILES: [PageFile; 4] = [
    PageFile {
        path: "/",
        content_type: "text/html; charset=utf-8",
        bytes: include_bytes!("../../page/index.html"),
    },
    PageFile {
        path: "/viewer.js",
        content_type: "text/javascript; charset=utf-8",
        bytes: include_bytes!("../../page/viewer.js"),
    },
    PageFile {
        path: "/viewer.css",
        content_type: "text/css; charset=utf-8",
        bytes: include_bytes!("../../page/viewer.css"),
    },
    PageFile {
        path: "/icon.svg",
        content_type: "image/svg+xml",
        bytes: include_bytes!("../../page/icon.svg"),
    },
];

/// The file that is served at exactly `path`.
pub(crate) fn at(path: &str) -> Option<&'static PageFile> {
    FILES.iter().find(|file| file.path == path)
}
