//! A court with its own authority, and sessions with the keys of their roles over TLS on loopback.

use bridge::pairing::authority::Authority;
use bridge::pairing::bundle::Bundle;
use bridge::session::{self, Options, Role};
use std::net::TcpListener;
use zenoh::Session;

pub struct Court {
    pub name: String,
    pub folder: tempfile::TempDir,
    authority: Authority,
    endpoint: String,
}

impl Court {
    pub fn new(what: &str) -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        Self {
            name: format!("{what}-{}", std::process::id()),
            folder: tempfile::tempdir().unwrap(),
            authority: Authority::new().unwrap(),
            endpoint: format!("tls/127.0.0.1:{port}"),
        }
    }

    /// A session with the keys of its role.
    pub fn session(&self, role: Role) -> Session {
        let identity = self.authority.identity(&format!("{}/{}", self.name, role.name()), role);
        let folder = self.folder.path().join(format!("{role:?}"));
        let authority_pem = self.authority.certificate_pem.clone();
        let court = self.name.clone();
        let bundle = Bundle { court, role, identity: identity.unwrap(), authority_pem };
        bundle.unpack(&folder).unwrap();
        let mut options = Options { keys: Some(folder), ..Options::new(&self.name, role) };
        match role {
            Role::Fusion => options.listen.push(self.endpoint.clone()),
            _ => options.connect.push(self.endpoint.clone()),
        }
        session::open(&options).unwrap()
    }
}
