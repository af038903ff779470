//! Text of bounded length, valid for any bytes.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// UTF-8 in a fixed field, padded with zeros.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text<const N: usize> {
    bytes: [u8; N],
}

impl<const N: usize> Default for Text<N> {
    fn default() -> Self {
        Self { bytes: [0; N] }
    }
}

// SAFETY: an array of bytes has no padding and every bit pattern is a value.
unsafe impl<const N: usize> Zeroable for Text<N> {}
// SAFETY: as above, and the type is Copy and 'static.
unsafe impl<const N: usize> Pod for Text<N> {}

impl<const N: usize> Text<N> {
    /// Keeps as many whole characters of `text` as fit.
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(N);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; N];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self { bytes }
    }

    /// Returns the text if it is UTF-8 without control characters, padded with zeros alone; `None` for any other bytes.
    pub fn exact(&self) -> Option<&str> {
        let end = self.bytes.iter().position(|&b| b == 0).unwrap_or(N);
        let (words, rest) = self.bytes.split_at(end);
        let words = std::str::from_utf8(words).ok()?;
        (rest.iter().all(|&b| b == 0) && !words.chars().any(char::is_control)).then_some(words)
    }

    /// Returns the readable part: up to the first zero, with broken UTF-8 and control characters replaced.
    pub fn read(&self) -> String {
        let end = self.bytes.iter().position(|&b| b == 0).unwrap_or(N);
        String::from_utf8_lossy(&self.bytes[..end])
            .chars()
            .map(|c| if c.is_control() && c != '\n' { '\u{fffd}' } else { c })
            .collect()
    }
}

/// Serialises the readable text.
impl<const N: usize> Serialize for Text<N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.read())
    }
}

/// Keeps as much as fits.
impl<'de, const N: usize> Deserialize<'de> for Text<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer).map(|words| Self::new(&words))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_exact_or_none() {
        assert_eq!(Text::<8>::new("aé€").exact(), Some("aé€"));
        assert_eq!(Text::<2>::new("aé€").exact(), Some("a"));
        assert_eq!(Text::<4>::new("a\nb").exact(), None, "a control character");
        for bytes in [[0xff; 4], [b'a', 0, b'b', 0], [0xc3, 0, 0, 0]] {
            assert_eq!(Text::<4> { bytes }.exact(), None, "{bytes:?}");
        }
    }

    #[test]
    fn text_survives_the_field_and_invalid_bytes_are_readable() {
        assert_eq!(Text::<8>::new("gland").read(), "gland");
        assert_eq!(Text::<4>::new("aé€").read(), "aé");
        assert_eq!(Text::<3> { bytes: [0xff; 3] }.read(), "\u{fffd}\u{fffd}\u{fffd}");
    }
}
