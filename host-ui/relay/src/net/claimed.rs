//! The name in a certificate whose signature is not the lab's: zenoh reports why a handshake failed, and not whose it was.

use rustls::crypto::CryptoProvider;
use rustls::pki_types::{AlgorithmIdentifier, InvalidSignature, SignatureVerificationAlgorithm};
use std::sync::{Mutex, Once, PoisonError};
use std::time::{Duration, Instant};

/// A handshake is over within this time of its last certificate.
const HANDSHAKE: Duration = Duration::from_secs(1);
/// Object identifier of a common name, 2.5.4.3, as DER has it.
const COMMON_NAME: [u8; 5] = [0x06, 0x03, 0x55, 0x04, 0x03];

static REFUSED: Mutex<Option<(String, Instant)>> = Mutex::new(None);

/// Lets the library that verifies certificates note whose was refused; before the first session.
pub fn note_refused() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let mut provider = rustls::crypto::ring::default_provider();
        let known = &mut provider.signature_verification_algorithms;
        let mapping = known.mapping.iter().map(|(scheme, all)| (*scheme, noted(all)));
        let mapping: Vec<_> = mapping.collect();
        // Once for the whole process, which uses them to its end.
        (known.all, known.mapping) = (noted(known.all), Vec::leak(mapping));
        // Whoever chose another before has no names, and the same answers.
        let _ = CryptoProvider::install_default(provider);
    });
}

/// The name that a certificate which was refused just now bears: what its maker wrote, and no proof of who it is.
pub fn take() -> Option<String> {
    let refused = REFUSED.lock().unwrap_or_else(PoisonError::into_inner).take();
    refused.filter(|(_, at)| at.elapsed() < HANDSHAKE).map(|(name, _)| name)
}

type Algorithm = &'static dyn SignatureVerificationAlgorithm;

fn noted(all: &[Algorithm]) -> &'static [Algorithm] {
    let noted: Vec<Algorithm> = all
        .iter()
        .map(|algorithm| -> Algorithm { Box::leak(Box::new(Noted(*algorithm))) })
        .collect();
    Vec::leak(noted)
}

/// Answers as the algorithm does.
#[derive(Debug)]
struct Noted(Algorithm);

impl SignatureVerificationAlgorithm for Noted {
    fn verify_signature(&self, key: &[u8], message: &[u8], signature: &[u8]) -> Result<(), InvalidSignature> {
        let verified = self.0.verify_signature(key, message, signature);
        if verified.is_err()
            && let Some(name) = common_name(message)
        {
            *REFUSED.lock().unwrap_or_else(PoisonError::into_inner) = Some((name, Instant::now()));
        }
        verified
    }

    fn public_key_alg_id(&self) -> AlgorithmIdentifier {
        self.0.public_key_alg_id()
    }

    fn signature_alg_id(&self) -> AlgorithmIdentifier {
        self.0.signature_alg_id()
    }
}

/// The subject's common name of a certificate, which is the last in it: the issuer's stands before.
fn common_name(certificate: &[u8]) -> Option<String> {
    let at = certificate.windows(COMMON_NAME.len()).rposition(|w| w == COMMON_NAME)?;
    let [_tag, length, rest @ ..] = certificate.get(at + COMMON_NAME.len()..)? else {
        return None;
    };
    let name = rest.get(..usize::from(*length)).filter(|_| *length < 0x80)?;
    let name = String::from_utf8_lossy(name);
    Some(name.chars().filter(|c| !c.is_control()).take(64).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_the_subject_is_found_and_bytes_of_others_are_none() {
        let key = rcgen::KeyPair::generate().expect("a key");
        let mut params = rcgen::CertificateParams::new(vec![]).expect("no hosts");
        params.distinguished_name.push(rcgen::DnType::CommonName, "seat-007");
        let certificate = params.self_signed(&key).expect("signed");
        assert_eq!(common_name(certificate.der()).as_deref(), Some("seat-007"));
        for bytes in [
            &[][..],
            &COMMON_NAME,
            &[6, 3, 0x55, 4, 3, 0x0c, 9, b'a'],
            &[6, 3, 0x55, 4, 3, 0x0c, 0xff],
        ] {
            assert_eq!(common_name(bytes), None, "{bytes:?}");
        }
    }
}
