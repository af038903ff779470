//! JPEG, JPEG-LS and JPEG 2000 by decoders of other projects, which get only streams of the size in the header.

use super::{Codec, Layout};
use crate::error::{ContentError, invalid};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// First bytes of a JPEG 2000 stream: its start, and the marker of its sizes.
const JPEG_2000: [u8; 4] = [0xff, 0x4f, 0xff, 0x51];
/// Bytes of the sizes up to the precision of the first component.
const SIZES: usize = 43;

/// Most tiles of a stream (ISO 15444-1 A.4.2).
const MOST_TILES: usize = 65_535;

/// Frame as its stream describes it.
struct Header {
    columns: usize,
    rows: usize,
    components: usize,
    precision: u32,
    is_signed: bool,
}

/// Adds the pixels of a frame, little endian.
pub fn decode(codec: Codec, frame: &[u8], layout: &Layout, all: &mut Vec<u8>) -> Result<(), ContentError> {
    let header = match codec {
        Codec::Jpeg2000 => of_jpeg_2000(frame),
        _ => of_jpeg(frame),
    };
    let header = header.ok_or("it is damaged: it does not begin as such; copy or export it again")?;
    header.check(layout)?;
    let decoder = || match codec {
        Codec::Jpeg2000 => jpeg_2000(frame, &header),
        Codec::JpegLs => jpeg_ls(frame, layout),
        Codec::Jpeg | Codec::Rle => jpeg(frame, layout),
    };
    // A decoder that does not foresee some damage panics; it holds nothing that outlives the call.
    let values = catch_unwind(AssertUnwindSafe(decoder)).unwrap_or_else(|_| Err("its decoder failed".to_owned()));
    let values = values.map_err(|why| invalid!("it is damaged or of a kind that is not read ({why})"))?;
    if values.len() != layout.pixels() {
        return Err(invalid!("it has {} pixels, not {}", values.len(), layout.pixels()));
    }
    match layout.bytes {
        1 => all.extend(values.iter().map(|value| *value as u8)),
        _ => all.extend(values.iter().flat_map(|value| value.to_le_bytes())),
    }
    Ok(())
}

impl Header {
    /// Refuses what contradicts the attributes: its values would mean something else.
    fn check(&self, layout: &Layout) -> Result<(), ContentError> {
        let (columns, rows) = (layout.columns, layout.rows);
        if [self.columns, self.rows, self.components] != [columns, rows, 1] {
            return Err(invalid!(
                "it is {} x {} pixels with {} values each, and Columns and Rows are {columns} x {rows}",
                self.columns,
                self.rows,
                self.components
            ));
        }
        let bits = 8 * layout.bytes as u32;
        let is_whole = self.precision == layout.stored || self.precision == bits;
        let fits = match (self.is_signed, layout.is_signed) {
            (true, false) => false,
            (true, true) | (false, false) => self.precision <= layout.stored || is_whole,
            // The bits of negative numbers, unchanged.
            (false, true) => is_whole,
        };
        if bits > 16 || self.precision > bits || !fits {
            return Err(invalid!(
                "it has {} bits {}, and the attributes {} of {bits} (BitsStored, BitsAllocated) {} (PixelRepresentation)",
                self.precision,
                sign(self.is_signed),
                layout.stored,
                sign(layout.is_signed)
            ));
        }
        Ok(())
    }
}

fn sign(is_signed: bool) -> &'static str {
    if is_signed { "with sign" } else { "without sign" }
}

/// Reads the sizes of a JPEG 2000 stream (ISO 15444-1 A.5.1).
fn of_jpeg_2000(frame: &[u8]) -> Option<Header> {
    let sizes = frame.get(..SIZES).filter(|start| start.starts_with(&JPEG_2000))?;
    let word = |at: usize| u32::from_be_bytes([sizes[at], sizes[at + 1], sizes[at + 2], sizes[at + 3]]) as usize;
    let side = |end: usize, begin: usize| word(end).checked_sub(word(begin));
    // A decoder makes every tile before it reads one.
    let tiles = side(8, 32)?.div_ceil(word(24).max(1)) * side(12, 36)?.div_ceil(word(28).max(1));
    if tiles > MOST_TILES {
        return None;
    }
    Some(Header {
        columns: side(8, 16)?,
        rows: side(12, 20)?,
        components: usize::from(u16::from_be_bytes([sizes[40], sizes[41]])),
        precision: u32::from(sizes[42] & 0x7f) + 1,
        is_signed: sizes[42] & 0x80 != 0,
    })
}

/// Reads the frame header of a JPEG or JPEG-LS stream (ISO 10918-1 B.2.2, ISO 14495-1 C.2.2).
fn of_jpeg(frame: &[u8]) -> Option<Header> {
    let mut at = 2;
    loop {
        let [0xff, marker, high, low] = *frame.get(at..at + 4)? else {
            return None;
        };
        let segment = frame.get(at + 4..)?;
        // Frames of any method; C4, C8 and CC are other segments.
        if matches!(marker, 0xc0..=0xcf | 0xf7) && !matches!(marker, 0xc4 | 0xc8 | 0xcc) {
            let [precision, a, b, c, d, components] = *segment.get(..6)? else {
                return None;
            };
            return Some(Header {
                columns: usize::from(u16::from_be_bytes([c, d])),
                rows: usize::from(u16::from_be_bytes([a, b])),
                components: components.into(),
                precision: precision.into(),
                is_signed: false,
            });
        }
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
    }
}

fn jpeg_2000(frame: &[u8], header: &Header) -> Result<Vec<u16>, String> {
    use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image};
    let settings = DecodeSettings {
        strict: true,
        ..DecodeSettings::default()
    };
    let image = Image::new(frame, &settings).map_err(|why| why.to_string())?;
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(|why| why.to_string())?;
    let [component] = decoded.components() else {
        return Err("several components".to_owned());
    };
    // The decoder puts the middle of all values where those without a sign have it.
    let bits = header.precision;
    let (least, middle) = (0.0, if header.is_signed { 1_i32 << (bits - 1) } else { 0 });
    let most = ((1_u32 << bits) - 1) as f32;
    let value = |sample: &f32| (sample.round().clamp(least, most) as i32 - middle) as u16;
    Ok(component.samples().iter().map(value).collect())
}

fn jpeg_ls(frame: &[u8], layout: &Layout) -> Result<Vec<u16>, String> {
    let (values, ..) =
        jpegls::decode(frame, layout.columns as u32, layout.rows as u32).map_err(|why| why.to_string())?;
    Ok(values)
}

fn jpeg(frame: &[u8], layout: &Layout) -> Result<Vec<u16>, String> {
    use jpeg_decoder::{Decoder, PixelFormat};
    let mut decoder = Decoder::new(frame);
    decoder.set_max_decoding_buffer_size(layout.pixels() * 2);
    let bytes = decoder.decode().map_err(|why| why.to_string())?;
    match decoder.info().map(|info| info.pixel_format) {
        Some(PixelFormat::L8) => Ok(bytes.into_iter().map(u16::from).collect()),
        Some(PixelFormat::L16) => {
            let values = bytes.chunks_exact(2).map(|b| u16::from_ne_bytes([b[0], b[1]]));
            Ok(values.collect())
        }
        _ => Err("colours".to_owned()),
    }
}
