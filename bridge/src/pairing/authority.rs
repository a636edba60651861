//! A folder → the court's certificate authority → certificates (X.509 v3, ECDSA P-256).

use super::{Error, files};
use crate::session::Role;
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose, date_time_ymd,
};
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// A certificate lasts so long from the day of pairing.
pub const YEARS: u32 = 10;
/// The authority outlives all it signs.
const AUTHORITY_YEARS: u32 = 40;
const YEAR: Duration = Duration::from_secs(31_557_600); // Julian
/// 2026-01-01: this was written later, so a clock before it is wrong.
const EARLIEST: Duration = Duration::from_secs(1_767_225_600);

/// What signs a court's certificates.
#[derive(Debug)]
pub struct Authority {
    params: CertificateParams,
    key: KeyPair,
    /// Its own certificate, which every machine has.
    pub certificate_pem: String,
}

/// A machine's certificate and key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// The certificate.
    pub certificate_pem: String,
    /// Its private key.
    pub key_pem: String,
}

impl Authority {
    /// A new authority, in memory.
    ///
    /// # Errors
    /// When the system has no random numbers, or its clock is far off.
    pub fn new() -> Result<Self, Error> {
        let key = KeyPair::generate()?;
        let params = params(&key)?;
        let certificate_pem = params.self_signed(&key)?.pem();
        Ok(Self { params, key, certificate_pem })
    }

    /// The authority of a folder, made if it is not there; and whether it was made.
    ///
    /// # Errors
    /// When the folder cannot be used, or others may read its keys.
    pub fn of_folder(folder: &Path) -> Result<(Self, bool), Error> {
        files::make_private_folder(folder)?;
        let paths = (folder.join("authority.pem"), folder.join("authority.key"));
        if paths.1.exists() {
            files::check_private(&paths.1, 0o600)?;
            let key = KeyPair::from_pem(&files::read(&paths.1)?)?;
            let params = params(&key)?;
            return Ok((Self { params, key, certificate_pem: files::read(&paths.0)? }, false));
        }
        let made = Self::new()?;
        files::write_private(&paths.0, &made.certificate_pem)?;
        files::write_private(&paths.1, &made.key.serialize_pem())?;
        Ok((made, true))
    }

    /// A new certificate of a role, valid for [`YEARS`].
    ///
    /// # Errors
    /// When the system has no random numbers, or its clock is far off.
    pub fn identity(&self, common_name: &str, role: Role) -> Result<Identity, Error> {
        self.identity_until(common_name, role, since_1970()? + YEARS * YEAR)
    }

    /// A new certificate of a role that ends so long after 1970.
    ///
    /// # Errors
    /// When the system has no random numbers.
    pub fn identity_until(
        &self,
        common_name: &str,
        role: Role,
        end: Duration,
    ) -> Result<Identity, Error> {
        let key = KeyPair::generate()?;
        let mut params = CertificateParams::default();
        params.distinguished_name = name(common_name);
        params.not_before = date_time_ymd(1970, 1, 1);
        params.not_after = params.not_before + end;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
        if role.is_listener() {
            params.extended_key_usages.push(ExtendedKeyUsagePurpose::ServerAuth);
        }
        params.use_authority_key_identifier_extension = true;
        let certificate = params.signed_by(&key, &Issuer::from_params(&self.params, &self.key))?;
        Ok(Identity { certificate_pem: certificate.pem(), key_pem: key.serialize_pem() })
    }
}

/// The authority's own name follows from its key, so that two of them are told apart.
fn params(key: &KeyPair) -> Result<CertificateParams, Error> {
    let mut params = CertificateParams::default();
    let id = params.key_identifier(key);
    let id: String = id.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    params.distinguished_name = name(&format!("tennis authority {id}"));
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
    params.not_before = date_time_ymd(1970, 1, 1);
    params.not_after = params.not_before + since_1970()? + AUTHORITY_YEARS * YEAR;
    Ok(params)
}

fn name(common_name: &str) -> DistinguishedName {
    let mut name = DistinguishedName::new();
    name.push(DnType::CommonName, common_name);
    name
}

fn since_1970() -> Result<Duration, Error> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_err(|_| Error::Clock)?;
    if now < EARLIEST { Err(Error::Clock) } else { Ok(now) }
}
