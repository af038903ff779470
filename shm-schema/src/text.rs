//! Text of bounded length that any bytes may claim to be.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// UTF-8 in a fixed field, padded with zeros.
#[repr(C)]
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("stylet.Text")]
pub struct Text<const N: usize> {
    bytes: [u8; N],
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

    /// What can be read of it: up to the first zero, with broken UTF-8 and control characters replaced.
    pub fn read(&self) -> String {
        let end = self.bytes.iter().position(|&b| b == 0).unwrap_or(N);
        String::from_utf8_lossy(&self.bytes[..end])
            .chars()
            .map(|c| if c.is_control() && c != '\n' { '\u{fffd}' } else { c })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_survives_the_field_and_invalid_bytes_are_readable() {
        assert_eq!(Text::<8>::new("gland").read(), "gland");
        assert_eq!(Text::<4>::new("aé€").read(), "aé");
        assert_eq!(Text::<3> { bytes: [0xff; 3] }.read(), "\u{fffd}\u{fffd}\u{fffd}");
    }
}
