//! The headers of a request → whether it may come from our own page.
//!
//! Any web page that is open on this computer can send requests to a server on loopback. So a
//! request must name this server as ours does (`Host`: a foreign name that was made to lead here is
//! refused), and what a browser sends on behalf of a page must be on behalf of ours (`Origin`,
//! which a page cannot change). Requests without `Origin` are those of other programs of this
//! computer, which are trusted, and reads that a foreign page may cause but not look into.

use axum::http::{HeaderMap, HeaderValue, header};

/// Who may send.
#[derive(Debug, Clone)]
pub struct Sender {
    hosts: Vec<String>,
}

/// Why a request is not heard.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// It does not name this server, or not only.
    #[error("expected Host: {expected}")]
    Host {
        /// Names of this server.
        expected: String,
    },
    /// It is sent on behalf of another page.
    #[error("a page from elsewhere may not use this server")]
    Origin,
}

impl Sender {
    /// The page of a server at this port of loopback.
    #[must_use]
    pub fn ours(port: u16) -> Self {
        let mut hosts = vec![format!("127.0.0.1:{port}"), format!("localhost:{port}")];
        if port == 80 {
            // as browsers shorten it
            hosts.extend(["127.0.0.1".to_owned(), "localhost".to_owned()]);
        }
        Self { hosts }
    }

    /// Whether a request may be heard.
    ///
    /// # Errors
    /// When it may not.
    pub fn check(&self, headers: &HeaderMap) -> Result<(), Error> {
        let mut hosts = headers.get_all(header::HOST).iter().peekable();
        if hosts.peek().is_none() || !hosts.all(|host| self.is_named_by(host, "")) {
            return Err(Error::Host { expected: self.hosts.join(" or ") });
        }
        let mut origins = headers.get_all(header::ORIGIN).iter();
        if origins.all(|origin| self.is_named_by(origin, "http://")) {
            Ok(())
        } else {
            Err(Error::Origin)
        }
    }

    fn is_named_by(&self, value: &HeaderValue, prefix: &str) -> bool {
        let host = value.to_str().ok().and_then(|text| text.strip_prefix(prefix));
        host.is_some_and(|host| self.hosts.iter().any(|ours| ours.eq_ignore_ascii_case(host)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(port: u16, headers: &[(&'static str, &'static str)], is_heard: bool) {
        let pair = |&(name, value): &(&'static str, &'static str)| {
            (header::HeaderName::from_static(name), HeaderValue::from_static(value))
        };
        let mut map = HeaderMap::new();
        for (name, value) in headers.iter().map(pair) {
            map.append(name, value);
        }
        assert_eq!(Sender::ours(port).check(&map).is_ok(), is_heard, "{headers:?}");
    }

    #[test]
    fn only_our_own_page_is_heard() {
        let host = ("host", "127.0.0.1:4000");
        check(4000, &[host], true);
        check(4000, &[host, ("origin", "http://127.0.0.1:4000")], true);
        check(4000, &[("host", "LocalHost:4000"), ("origin", "http://localhost:4000")], true);
        check(80, &[("host", "localhost"), ("origin", "http://localhost")], true);
        check(4000, &[], false);
        for other in ["evil.example:4000", "127.0.0.1:5000", "127.0.0.1", "127.0.0.1:4000.evil", ""]
        {
            check(4000, &[("host", other)], false);
            check(4000, &[host, ("host", other)], false);
        }
        for other in ["http://evil.example", "http://127.0.0.1:5000", "https://127.0.0.1:4000"] {
            check(4000, &[host, ("origin", other)], false);
        }
        check(4000, &[host, ("origin", "null")], false);
    }
}
