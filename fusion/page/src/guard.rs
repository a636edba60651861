//! The headers of a request -> whether it is heard, and what it may ask for.
//!
//! Three walls. A request must name this server as we do (`Host`: a foreign name that was made to
//! lead here is refused); what a browser sends for a page must be for ours (`Origin`, which a page
//! cannot change); and what changes the machine or tells secrets needs the token, which stands in
//! a file that only its owner reads.

use anyhow::{Context as _, ensure};
use axum::http::{HeaderMap, HeaderValue, header};
use std::fs::{File, OpenOptions};
use std::io::{Read as _, Write as _};
use std::net::{IpAddr, SocketAddr};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use subtle::ConstantTimeEq as _;

/// Bytes of a token.
const TOKEN_BYTES: usize = 32;

/// Who is heard.
#[derive(Debug, Clone)]
pub struct Guard {
    port: u16,
    hosts: Vec<String>,
    is_any_address: bool,
    token: String,
}

/// Why a request is not heard.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// It does not name this server.
    #[error("this server is not called so; expected Host: its address, or a name of --allow-host")]
    Host,
    /// It is sent for another page.
    #[error("a page from elsewhere may not use this server")]
    Origin,
    /// It has no token, or a wrong one.
    #[error("this needs the token that the page printed when it started: Authorization: Bearer …")]
    Token,
}

impl Guard {
    /// Of a server at this address, by these further names.
    #[must_use]
    pub fn new(address: SocketAddr, names: &[String], token: String) -> Self {
        let mut hosts = vec!["localhost".to_owned(), address.ip().to_string()];
        if address.ip().is_loopback() || address.ip().is_unspecified() {
            hosts.push("127.0.0.1".to_owned());
            hosts.push("[::1]".to_owned());
        }
        hosts.extend(names.iter().map(|name| name.to_ascii_lowercase()));
        Self { port: address.port(), hosts, is_any_address: address.ip().is_unspecified(), token }
    }

    /// Whether a request is for us, and not for another page.
    ///
    /// # Errors
    /// When it is not.
    pub fn check_sender(&self, headers: &HeaderMap) -> Result<(), Error> {
        let mut hosts = headers.get_all(header::HOST).iter().peekable();
        if hosts.peek().is_none() || !hosts.all(|host| self.is_ours(host, "")) {
            return Err(Error::Host);
        }
        let mut origins = headers.get_all(header::ORIGIN).iter();
        if origins.all(|origin| self.is_ours(origin, "http://")) {
            Ok(())
        } else {
            Err(Error::Origin)
        }
    }

    /// Whether it carries the token.
    ///
    /// # Errors
    /// When it does not.
    pub fn check_token(&self, headers: &HeaderMap) -> Result<(), Error> {
        let given = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
        let given = given.and_then(|text| text.strip_prefix("Bearer ")).unwrap_or_default();
        let is_it: bool = given.as_bytes().ct_eq(self.token.as_bytes()).into();
        if is_it { Ok(()) } else { Err(Error::Token) }
    }

    /// What opens the page with all rights.
    #[must_use]
    pub fn token(&self) -> &str {
        &self.token
    }

    fn is_ours(&self, value: &HeaderValue, prefix: &str) -> bool {
        let text = value.to_str().ok().and_then(|text| text.strip_prefix(prefix));
        let Some(text) = text.map(str::to_ascii_lowercase) else { return false };
        let (host, port) = match text.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => (host.to_owned(), port.parse().ok()),
            _ => (text.clone(), Some(80)),
        };
        // An address cannot be made to lead elsewhere, a name can.
        let bare = host.trim_matches(['[', ']']);
        let is_address = self.is_any_address && bare.parse::<IpAddr>().is_ok();
        port == Some(self.port) && (is_address || self.hosts.contains(&host))
    }
}

/// A token that nobody can guess.
///
/// # Errors
/// When the system has no random bytes.
pub fn new_token() -> anyhow::Result<String> {
    let mut bytes = [0; TOKEN_BYTES];
    let mut random = File::open("/dev/urandom").context("/dev/urandom")?;
    random.read_exact(&mut bytes).context("/dev/urandom")?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// The token of a file, which is made if it is not there; only its owner may read it.
///
/// # Errors
/// When the file cannot be read or made, or holds none.
pub fn token_of(path: &Path) -> anyhow::Result<String> {
    let label = || path.display().to_string();
    let mut options = OpenOptions::new();
    match options.write(true).create_new(true).mode(0o600).open(path) {
        Ok(mut file) => {
            let token = new_token()?;
            file.write_all(token.as_bytes()).with_context(label)?;
            Ok(token)
        }
        Err(why) if why.kind() == std::io::ErrorKind::AlreadyExists => {
            let mut token = String::new();
            File::open(path)
                .and_then(|mut file| file.read_to_string(&mut token))
                .with_context(label)?;
            let token = token.trim().to_owned();
            let is_token =
                token.len() == 2 * TOKEN_BYTES && token.bytes().all(|b| b.is_ascii_hexdigit());
            ensure!(is_token, "{}: holds no token; remove it and start again", label());
            Ok(token)
        }
        Err(why) => Err(why).with_context(label),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(list: &[(&'static str, &str)]) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for (name, value) in list {
            headers.append(*name, HeaderValue::from_str(value).unwrap());
        }
        headers
    }

    fn check(address: &str, list: &[(&'static str, &str)], expected: Result<(), Error>) {
        let guard = Guard::new(address.parse().unwrap(), &["court.lan".to_owned()], "t".to_owned());
        assert_eq!(guard.check_sender(&headers(list)), expected, "{address} {list:?}");
    }

    #[test]
    fn only_who_names_this_server_is_heard() {
        let here = "127.0.0.1:8080";
        for host in ["127.0.0.1:8080", "localhost:8080", "LOCALHOST:8080", "court.lan:8080"] {
            check(here, &[("host", host)], Ok(()));
        }
        for host in ["evil.example:8080", "127.0.0.1:8081", "127.0.0.1", "10.0.0.7:8080", ""] {
            check(here, &[("host", host)], Err(Error::Host));
        }
        check(here, &[], Err(Error::Host));
        check("0.0.0.0:80", &[("host", "10.0.0.7")], Ok(()));
        check("[::]:8080", &[("host", "[fe80::1]:8080")], Ok(()));
        check("0.0.0.0:80", &[("host", "evil.example")], Err(Error::Host));
    }

    #[test]
    fn another_page_is_not_heard() {
        let ours = ("host", "localhost:8080");
        check("127.0.0.1:8080", &[ours, ("origin", "http://localhost:8080")], Ok(()));
        for origin in ["http://evil.example", "null", "https://localhost:8080"] {
            check("127.0.0.1:8080", &[ours, ("origin", origin)], Err(Error::Origin));
        }
    }

    #[test]
    fn a_token_is_made_once_and_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        let token = token_of(&path).unwrap();
        assert_eq!((token.len(), token_of(&path).unwrap()), (64, token.clone()));
        use std::os::unix::fs::PermissionsExt as _;
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        let guard = Guard::new("127.0.0.1:1".parse().unwrap(), &[], token.clone());
        let with = |value: &str| guard.check_token(&headers(&[("authorization", value)]));
        assert_eq!(with(&format!("Bearer {token}")), Ok(()));
        for wrong in ["", "Bearer ", "Bearer x", &token, &format!("Bearer {token}0")] {
            assert_eq!(with(wrong), Err(Error::Token), "{wrong:?}");
        }
        std::fs::write(&path, "short").unwrap();
        assert!(token_of(&path).unwrap_err().to_string().contains("holds no token"));
    }
}
