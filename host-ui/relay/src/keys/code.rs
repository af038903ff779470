//! The code that opens an invitation: the file is useless without it.

use crate::RelayError;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ring::aead::{Aad, CHACHA20_POLY1305, LessSafeKey, NONCE_LEN, Nonce, UnboundKey};
use ring::pbkdf2::{self, PBKDF2_HMAC_SHA256};
use ring::rand::{SecureRandom, SystemRandom};
use std::num::NonZeroU32;

/// Alphabet without letters and digits that look alike.
const LETTERS: &[u8; 32] = b"abcdefghjkmnpqrstuvwxyz023456789";
/// Length of a code. Each letter holds five bits: 80 bits, which cannot be guessed.
const LENGTH: usize = 16;
const SALT_BYTES: usize = 16;
const ROUNDS: NonZeroU32 = NonZeroU32::new(100_000).expect("not zero");

fn random<const N: usize>() -> Result<[u8; N], RelayError> {
    let mut bytes = [0; N];
    let filled = SystemRandom::new().fill(&mut bytes);
    filled.map_err(|_| RelayError::NoRandom)?;
    Ok(bytes)
}

/// Makes a new code, in groups of four.
pub fn make() -> Result<String, RelayError> {
    let letters = random::<LENGTH>()?.map(|byte| char::from(LETTERS[usize::from(byte) % LETTERS.len()]));
    let groups = letters.chunks(4).map(|group| group.iter().collect::<String>());
    Ok(groups.collect::<Vec<_>>().join("-"))
}

/// Derives a separate key for each salt, so that its single nonce is used once.
fn key(code: &str, salt: &[u8]) -> Result<LessSafeKey, RelayError> {
    let plain: String = code.chars().filter(|c| c.is_alphanumeric()).collect();
    let mut bytes = [0; 32];
    pbkdf2::derive(
        PBKDF2_HMAC_SHA256,
        ROUNDS,
        salt,
        plain.to_lowercase().as_bytes(),
        &mut bytes,
    );
    let key = UnboundKey::new(&CHACHA20_POLY1305, &bytes);
    key.map(LessSafeKey::new).map_err(|_| RelayError::WrongCode)
}

/// Encrypts text with the code, for a file.
pub fn seal(words: &str, code: &str) -> Result<String, RelayError> {
    let salt = random::<SALT_BYTES>()?;
    let mut sealed = words.as_bytes().to_vec();
    let nonce = Nonce::assume_unique_for_key([0; NONCE_LEN]);
    let closed = key(code, &salt)?.seal_in_place_append_tag(nonce, Aad::empty(), &mut sealed);
    closed.map_err(|_| RelayError::WrongCode)?;
    Ok(STANDARD.encode([&salt[..], &sealed].concat()))
}

/// Decrypts text that was sealed with the code.
pub fn open(sealed: &str, code: &str) -> Result<String, RelayError> {
    let bytes = STANDARD.decode(sealed).map_err(|_| RelayError::WrongCode)?;
    let (salt, sealed) = bytes.split_at_checked(SALT_BYTES).ok_or(RelayError::WrongCode)?;
    let mut sealed = sealed.to_vec();
    let nonce = Nonce::assume_unique_for_key([0; NONCE_LEN]);
    let key = key(code, salt)?;
    let words = key
        .open_in_place(nonce, Aad::empty(), &mut sealed)
        .map_err(|_| RelayError::WrongCode)?;
    String::from_utf8(words.to_vec()).map_err(|_| RelayError::WrongCode)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_code_alone_opens_what_was_sealed() {
        let code = make().expect("random numbers");
        assert_eq!((code.len(), code.split('-').count()), (19, 4));
        let sealed = seal("a key", &code).expect("sealed");
        assert!(!sealed.contains("a key"));
        assert_eq!(open(&sealed, &code).expect("opened"), "a key");
        let typed = format!(" {} ", code.to_uppercase().replace('-', " "));
        assert_eq!(open(&sealed, &typed).expect("as a person types it"), "a key");
        let other = make().expect("random numbers");
        for (sealed, code) in [
            (&sealed, &other),
            (&sealed[..20].to_owned(), &code),
            (&"?".to_owned(), &code),
        ] {
            assert!(open(sealed, code).is_err());
        }
        assert_ne!(seal("a key", &code).expect("sealed"), sealed, "another salt each time");
    }
}
