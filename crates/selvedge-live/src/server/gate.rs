//! The gate: a request must be addressed to this program by a name that another site cannot forge,
//! and a socket must be opened by our own page.
//!
//! A browser tells in `Host` the name that it looked up, and in `Origin` the site of the page. A
//! foreign page that opens a socket has a foreign origin; one that has its own name point to this
//! machine has a foreign host. A program that is no browser sends no origin, and is let in as it
//! could be anyone.

use std::net::IpAddr;

use axum::http::{HeaderMap, HeaderName, header};

/// The names under which this program may be addressed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gate {
    /// Beside `localhost` and addresses in numbers.
    pub(crate) names: Vec<String>,
}

/// The reason why a request is turned away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// It is addressed to a name that is not ours.
    Host,
    /// Another site's page asks.
    Origin,
}

impl Refusal {
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Host => {
                "this name is not known here: use an address in numbers, or have the viewer started with it as an allowed host"
            }
            Self::Origin => "only the viewer's own page may open a socket",
        }
    }
}

impl Gate {
    /// Checks a request for a file.
    pub(crate) fn check(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let host = text(headers, &header::HOST).ok_or(Refusal::Host)?;
        let name = without_port(host);
        let bare = name.trim_start_matches('[').trim_end_matches(']');
        let known = bare.eq_ignore_ascii_case("localhost")
            || bare.parse::<IpAddr>().is_ok()
            || self
                .names
                .iter()
                .any(|ours| ours.eq_ignore_ascii_case(name));
        if known { Ok(()) } else { Err(Refusal::Host) }
    }

    /// Checks a request for a socket.
    pub(crate) fn check_socket(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        self.check(headers)?;
        if headers.get_all(header::ORIGIN).iter().count() == 0 {
            return Ok(());
        }
        let (origin, host) = (text(headers, &header::ORIGIN), text(headers, &header::HOST));
        let (Some(origin), Some(host)) = (origin, host) else {
            return Err(Refusal::Origin);
        };
        let of = origin
            .strip_prefix("http://")
            .or(origin.strip_prefix("https://"));
        match of {
            Some(of) if of.eq_ignore_ascii_case(host) => Ok(()),
            _ => Err(Refusal::Origin),
        }
    }
}

/// The one value of a header; nothing where there are several.
fn text<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let first = values.next()?.to_str().ok()?;
    values.next().is_none().then_some(first)
}

fn without_port(host: &str) -> &str {
    match host.rfind(':') {
        Some(at) if !host[at..].contains(']') => &host[..at],
        _ => host,
    }
}
