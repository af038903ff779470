//! Certificates by `rcgen`: one authority, which signs machines and seats.

use crate::RelayError;
use crate::keys::seat_name;
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};
use time::{Duration, OffsetDateTime};

/// Time after expiry for which a seat's certificate still identifies its member, so that the refusal can be addressed
/// by name. The right to connect ends at expiry, by the lab's list.
const NAMED_AFTER: Duration = Duration::days(365);

/// Period of validity of a certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Validity {
    from: OffsetDateTime,
    until: OffsetDateTime,
}

impl Validity {
    /// Valid for `days` from now on. A clock that is an hour slow accepts it too.
    pub fn days(days: u32) -> Self {
        let now = OffsetDateTime::now_utc();
        Self {
            from: now - Duration::hours(1),
            until: now + Duration::days(i64::from(days)),
        }
    }

    /// Returns a period that ended an hour ago.
    pub fn ended() -> Self {
        let now = OffsetDateTime::now_utc();
        Self {
            from: now - Duration::days(2),
            until: now - Duration::hours(1),
        }
    }

    /// Its end, seconds since 1970.
    pub fn until_s(&self) -> i64 {
        self.until.unix_timestamp()
    }
}

/// Subject of a certificate.
pub enum Subject<'a> {
    /// The machine with the core, by its names and addresses.
    Machine(&'a [String]),
    /// A member.
    Seat(u16),
}

/// The lab's authority, PEM.
pub struct Authority {
    /// Its certificate, known to everyone.
    pub certificate: String,
    /// Its key, which stays in the lab.
    pub key: String,
}

fn named(hosts: &[String], name: &str) -> Result<CertificateParams, RelayError> {
    let mut params = CertificateParams::new(hosts.to_vec())?;
    params.distinguished_name = DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, name);
    Ok(params)
}

/// Returns the same parameters each time, so that the authority can be rebuilt from its key.
fn authority() -> Result<CertificateParams, RelayError> {
    let mut params = named(&[], "Stylet lab")?;
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    Ok(params)
}

impl Authority {
    /// Makes a new one, valid for twenty years.
    pub fn make() -> Result<Self, RelayError> {
        let key = KeyPair::generate()?;
        let mut params = authority()?;
        let now = OffsetDateTime::now_utc();
        (params.not_before, params.not_after) = (now - Duration::days(3), now + Duration::days(7300));
        let certificate = params.self_signed(&key)?;
        Ok(Self {
            certificate: certificate.pem(),
            key: key.serialize_pem(),
        })
    }

    /// Returns certificate and key of a subject, PEM.
    pub fn sign(&self, subject: &Subject<'_>, validity: Validity) -> Result<(String, String), RelayError> {
        let (mut params, usage, after) = match subject {
            Subject::Machine(hosts) => (
                named(hosts, "relay")?,
                ExtendedKeyUsagePurpose::ServerAuth,
                Duration::ZERO,
            ),
            Subject::Seat(seat) => (
                named(&[], &seat_name(*seat))?,
                ExtendedKeyUsagePurpose::ClientAuth,
                NAMED_AFTER,
            ),
        };
        params.is_ca = IsCa::ExplicitNoCa;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![usage];
        params.use_authority_key_identifier_extension = true;
        (params.not_before, params.not_after) = (validity.from, validity.until + after);
        let signer = Issuer::new(authority()?, KeyPair::from_pem(&self.key)?);
        let key = KeyPair::generate()?;
        let certificate = params.signed_by(&key, &signer)?;
        Ok((certificate.pem(), key.serialize_pem()))
    }
}
