//! A machine's keys ↔ one text file that is carried there.
//!
//! ```text
//! tennis-pair/1 rose left
//! -----BEGIN CERTIFICATE-----     the machine's
//! -----BEGIN CERTIFICATE-----     the authority's
//! -----BEGIN PRIVATE KEY-----     the machine's
//! ```

use super::authority::Identity;
use super::{Error, files};
use crate::session::Role;
use shm_layout::{Camera, services};
use std::path::Path;

const FIRST_WORD: &str = "tennis-pair/1";
const CERTIFICATE: &str = "-----BEGIN CERTIFICATE-----";
const PRIVATE_KEY: &str = "-----BEGIN PRIVATE KEY-----";

/// All a machine needs to take part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bundle {
    /// The court, or the club.
    pub court: String,
    /// Who the machine is there.
    pub role: Role,
    /// Its certificate and key.
    pub identity: Identity,
    /// The certificate of who signed it.
    pub authority_pem: String,
}

impl Bundle {
    /// As text.
    #[must_use]
    pub fn to_text(&self) -> String {
        let Identity { certificate_pem, key_pem } = &self.identity;
        let blocks = [certificate_pem, &self.authority_pem, key_pem];
        let blocks = blocks.map(|pem| pem.trim().replace('\r', "")).join("\n");
        format!("{FIRST_WORD} {} {}\n{blocks}\n", self.court, self.role.name())
    }

    /// From text; `path` is for words only.
    ///
    /// # Errors
    /// When it is no bundle.
    pub fn from_text(path: &Path, text: &str) -> Result<Self, Error> {
        let malformed = |what: &str| Error::Malformed(path.to_owned(), what.to_owned());
        let (first, rest) = text.split_once('\n').ok_or_else(|| malformed("no .pair file"))?;
        let [FIRST_WORD, court, role] = first.split_whitespace().collect::<Vec<_>>()[..] else {
            return Err(malformed("no .pair file of this version (tennis-pair/1)"));
        };
        services::check_court_name(court)?;
        let role = role_from_name(role).ok_or_else(|| malformed("an unknown role"))?;
        let [certificate_pem, authority_pem, key_pem] = &pem_blocks(rest)[..] else {
            return Err(malformed("expected two certificates and a key"));
        };
        let is_fit = certificate_pem.starts_with(CERTIFICATE)
            && authority_pem.starts_with(CERTIFICATE)
            && key_pem.starts_with(PRIVATE_KEY);
        if !is_fit {
            return Err(malformed("expected two certificates and a key, in this order"));
        }
        let identity =
            Identity { certificate_pem: certificate_pem.clone(), key_pem: key_pem.clone() };
        Ok(Self { court: court.to_owned(), role, identity, authority_pem: authority_pem.clone() })
    }

    /// Reads a bundle that nobody else may read.
    ///
    /// # Errors
    /// When it is not there or no bundle.
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::from_text(path, &files::read(path)?)
    }

    /// Writes it as one file for its owner alone.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        files::write_private(path, &self.to_text())
    }

    /// Puts the keys into a folder, in place of older ones.
    ///
    /// # Errors
    /// When the folder cannot be used.
    pub fn unpack(&self, folder: &Path) -> Result<(), Error> {
        files::make_private_folder(folder)?;
        let name = self.role.name();
        let put = |suffix: &str, text: &str| {
            files::write_private(&folder.join(format!("{name}.{suffix}")), text)
        };
        put("pem", &self.identity.certificate_pem)?;
        put("authority.pem", &self.authority_pem)?;
        put("key", &self.identity.key_pem)
    }
}

fn role_from_name(name: &str) -> Option<Role> {
    let roles = [Role::Fusion, Role::Controller, Role::Dashboard, Role::Router];
    let boards = Camera::BOTH.map(Role::Board);
    roles.into_iter().chain(boards).find(|role| role.name() == name)
}

/// The PEM blocks of a text, each with its last newline.
fn pem_blocks(text: &str) -> Vec<String> {
    let mut blocks = Vec::new();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        if line.starts_with("-----BEGIN ") || blocks.is_empty() {
            blocks.push(String::new());
        }
        if let Some(block) = blocks.last_mut() {
            block.push_str(line);
            block.push('\n');
        }
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pairing::authority::Authority;

    fn bundle() -> Bundle {
        let authority = Authority::new().unwrap();
        let role = Role::Board(Camera::Left);
        Bundle {
            court: "rose".to_owned(),
            role,
            identity: authority.identity("rose/left", role).unwrap(),
            authority_pem: authority.certificate_pem,
        }
    }

    #[test]
    fn a_bundle_comes_back_from_its_text() {
        let bundle = bundle();
        let back = Bundle::from_text(Path::new("x"), &bundle.to_text()).unwrap();
        let trimmed = |pem: &str| pem.trim().replace('\r', "");
        assert_eq!((&back.court, back.role), (&bundle.court, bundle.role));
        assert_eq!(trimmed(&back.authority_pem), trimmed(&bundle.authority_pem));
        assert_eq!(trimmed(&back.identity.key_pem), trimmed(&bundle.identity.key_pem));
        assert_eq!(back.to_text(), bundle.to_text());
    }

    #[test]
    fn what_is_cut_renamed_or_points_elsewhere_is_no_bundle() {
        let text = bundle().to_text();
        let cut = text.split("-----BEGIN PRIVATE").next().unwrap().to_owned();
        let elsewhere = text.replacen("rose", "../../etc", 1);
        for text in [cut, elsewhere, text.replacen("left", "king", 1), String::new()] {
            assert!(Bundle::from_text(Path::new("x"), &text).is_err(), "{text}");
        }
    }
}
