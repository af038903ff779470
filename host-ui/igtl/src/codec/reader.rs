//! Fields of a message in big endian, read and written.

use super::CodecError;

/// Rest of a message.
pub struct Reader<'a> {
    bytes: &'a [u8],
    what: &'static str,
}

impl<'a> Reader<'a> {
    pub fn new(what: &'static str, bytes: &'a [u8]) -> Self {
        Self { bytes, what }
    }

    pub fn rest(&self) -> usize {
        self.bytes.len()
    }

    pub fn take(&mut self, count: usize) -> Result<&'a [u8], CodecError> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or(CodecError::Short {
            what: self.what,
            needed: count,
            found: self.bytes.len(),
        })?;
        self.bytes = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], CodecError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    pub fn u8(&mut self) -> Result<u8, CodecError> {
        self.array::<1>().map(|[byte]| byte)
    }

    pub fn u16(&mut self) -> Result<u16, CodecError> {
        self.array().map(u16::from_be_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, CodecError> {
        self.array().map(u32::from_be_bytes)
    }

    pub fn u64(&mut self) -> Result<u64, CodecError> {
        self.array().map(u64::from_be_bytes)
    }

    pub fn f32(&mut self) -> Result<f32, CodecError> {
        self.array().map(f32::from_be_bytes)
    }

    pub fn f32s<const N: usize>(&mut self) -> Result<[f32; N], CodecError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f32()?;
        }
        Ok(values)
    }

    /// Reads a text in a field of fixed length, up to its first zero.
    pub fn text(&mut self, count: usize) -> Result<String, CodecError> {
        let field = self.take(count)?;
        let end = field.iter().position(|byte| *byte == 0).unwrap_or(count);
        Ok(String::from_utf8_lossy(&field[..end]).into_owned())
    }

    pub fn end(&self) -> Result<(), CodecError> {
        match self.bytes {
            [] => Ok(()),
            _ => Err(CodecError::Field("bytes are left after the end of the message")),
        }
    }
}

pub fn put_f32s(bytes: &mut Vec<u8>, values: &[f32]) {
    values.iter().for_each(|value| bytes.extend(value.to_be_bytes()));
}

pub fn put_u32s(bytes: &mut Vec<u8>, values: &[u32]) {
    values.iter().for_each(|value| bytes.extend(value.to_be_bytes()));
}

/// Writes a text into a field of fixed length, padded with zeros.
pub fn put_text(bytes: &mut Vec<u8>, text: &str, count: usize) -> Result<(), CodecError> {
    if text.len() > count || text.contains('\0') {
        return Err(CodecError::Field(
            "a name contains a zero or is longer than its field: 20 bytes for devices and owners, 64 for points, 32 for groups",
        ));
    }
    bytes.extend(text.as_bytes());
    bytes.resize(bytes.len() + count - text.len(), 0);
    Ok(())
}
