//! Compressed pixels against the same ones uncompressed; broken streams.

use super::super::checked::read_with_pixels;
use super::super::write::{bytes as file_bytes, string};
use super::*;
use dicom_core::value::PrimitiveValue;
use dicom_core::{DataElement, Tag, VR};

const COLUMNS: usize = 40;
const ROWS: usize = 33;

fn short(tag: Tag, value: u16) -> DataElement<InMemDicomObject> {
    DataElement::new(tag, VR::US, PrimitiveValue::from(value))
}

/// Returns the values of a frame: runs, steps and every byte.
fn values(frame: usize) -> Vec<u16> {
    let value = |n: usize| match n / COLUMNS {
        0 => 7,
        1 => (n % 3) as u16,
        2 => 0xfff - n as u16,
        row => (n * n * (frame + 1) + row) as u16 & 0xfff,
    };
    (0..COLUMNS * ROWS).map(value).collect()
}

/// Returns a file of compressed pixels: fragments behind the attributes of `frames` frames.
fn file(syntax: &str, frames: usize, table: &[u8], fragments: &[Vec<u8>]) -> Vec<u8> {
    file_of((12, 0), syntax, frames, table, fragments)
}

/// Like [`file`], with BitsStored and PixelRepresentation.
fn file_of(
    (stored, representation): (u16, u16),
    syntax: &str,
    frames: usize,
    table: &[u8],
    fragments: &[Vec<u8>],
) -> Vec<u8> {
    let object = [
        string(tags::SOP_CLASS_UID, uids::CT_IMAGE_STORAGE),
        string(tags::SOP_INSTANCE_UID, "2.25.1"),
        short(tags::SAMPLES_PER_PIXEL, 1),
        string(tags::NUMBER_OF_FRAMES, &frames.to_string()),
        short(tags::ROWS, ROWS as u16),
        short(tags::COLUMNS, COLUMNS as u16),
        short(tags::BITS_ALLOCATED, 16),
        short(tags::BITS_STORED, stored),
        short(tags::HIGH_BIT, stored - 1),
        short(tags::PIXEL_REPRESENTATION, representation),
    ];
    let whole = file_bytes(InMemDicomObject::from_element_iter(object)).unwrap();
    // The same length, so that nothing else changes: the standard pads identifiers by zeros.
    let plain = uids::EXPLICIT_VR_LITTLE_ENDIAN.as_bytes();
    let at = whole.windows(plain.len()).position(|part| part == plain).unwrap();
    let (end, long) = (at + plain.len() + 1, syntax.len().next_multiple_of(2));
    let mut file = whole[..at - 2].to_vec();
    file.extend((long as u16).to_le_bytes());
    file.extend(syntax.bytes());
    file.resize(at + long, 0);
    file.extend(&whole[end..]);
    // Group 2 is longer by that.
    let length = u32::from_le_bytes([file[140], file[141], file[142], file[143]]) + (long - plain.len() - 1) as u32;
    file[140..144].copy_from_slice(&length.to_le_bytes());
    file.extend([0xe0, 0x7f, 0x10, 0x00, b'O', b'B', 0, 0, 0xff, 0xff, 0xff, 0xff]);
    for part in std::iter::once(table).chain(fragments.iter().map(Vec::as_slice)) {
        file.extend([0xfe, 0xff, 0x00, 0xe0]);
        file.extend((part.len() as u32).to_le_bytes());
        file.extend(part);
    }
    file.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    file
}

/// Packs a frame by RLE: runs of at least three, bytes as they are between them.
fn packed(values: &[u16]) -> Vec<u8> {
    let plane = |shift: u32| {
        let bytes: Vec<u8> = values.iter().map(|value| (value >> shift) as u8).collect();
        let mut out = Vec::new();
        for row in bytes.chunks(COLUMNS) {
            for run in row.chunk_by(|a, b| a == b) {
                match run.len() {
                    1 | 2 => out.extend([&[run.len() as u8 - 1], run].concat()),
                    long => out.extend([(1 - long as isize) as i8 as u8, run[0]]),
                }
            }
        }
        out.resize(out.len().next_multiple_of(2), 0);
        out
    };
    let [high, low] = [8, 0].map(plane);
    let mut frame = [2, 64, 64 + high.len() as u32].map(u32::to_le_bytes).concat();
    frame.resize(64, 0);
    [frame, high, low].concat()
}

fn plain(frames: usize) -> Vec<u8> {
    (0..frames).flat_map(values).flat_map(u16::to_le_bytes).collect()
}

fn read(file: &[u8]) -> Result<Vec<u8>, String> {
    let read = read_with_pixels(file).map(|(_, pixels, _)| pixels.into_owned());
    read.map_err(|why| why.to_string())
}

#[test]
fn rle_equals_the_uncompressed_pixels() {
    let frames: Vec<Vec<u8>> = (0..3).map(|n| packed(&values(n))).collect();
    assert_eq!(read(&file(uids::RLE_LOSSLESS, 3, &[], &frames)), Ok(plain(3)));
    // In pieces: the table says where frames begin, each piece has a head of 8 bytes.
    let pieces: Vec<Vec<u8>> = frames
        .iter()
        .flat_map(|f| [f[..70].to_vec(), f[70..].to_vec()])
        .collect();
    let lengths = frames.iter().map(|f| f.len() as u32 + 16);
    let starts = lengths.scan(0, |at, long| Some(std::mem::replace(at, *at + long)));
    let table: Vec<u8> = starts.flat_map(u32::to_le_bytes).collect();
    assert_eq!(read(&file(uids::RLE_LOSSLESS, 3, &table, &pieces)), Ok(plain(3)));
    let why = read(&file(uids::RLE_LOSSLESS, 3, &[], &pieces)).unwrap_err();
    assert!(why.contains("which belong together"), "{why}");
    assert_eq!(read(&file(uids::RLE_LOSSLESS, 1, &[], &pieces[..2])), Ok(plain(1)));
}

/// Refuses each cut and most altered streams; none may panic or give pixels of another number.
fn assert_harmless(syntax: &str, stream: &[u8]) {
    for cut in (0..stream.len().saturating_sub(2)).step_by(1 + stream.len() / 200) {
        let answer = read(&file(syntax, 1, &[], &[stream[..cut].to_vec()]));
        assert!(answer.is_err(), "{syntax}: {cut} of {} bytes are read", stream.len());
    }
    for at in (0..stream.len()).step_by(1 + stream.len() / 400) {
        for change in [0x01, 0x80, 0xff] {
            let mut bent = stream.to_vec();
            bent[at] ^= change;
            if let Ok(pixels) = read(&file(syntax, 1, &[], &[bent])) {
                assert_eq!(pixels.len(), plain(1).len());
            }
        }
    }
}

#[test]
fn broken_streams_are_refused() {
    assert_harmless(uids::RLE_LOSSLESS, &packed(&values(0)));
    let longer = packed(&[values(0), values(1)].concat());
    let why = read(&file(uids::RLE_LOSSLESS, 1, &[], &[longer])).unwrap_err();
    assert!(why.contains("Rows or Columns"), "{why}");
    let mut none = file(uids::RLE_LOSSLESS, 1, &[], &[packed(&values(0))]);
    none.truncate(none.len() - 8);
    assert!(read(&none).unwrap_err().contains("truncated"));
}

#[test]
fn other_methods_are_refused_by_name() {
    for (syntax, part) in [
        ("1.2.840.10008.1.2.4.201", "1.2.840.10008.1.2.4.201"),
        (uids::JPEGXL_LOSSLESS, uids::JPEGXL_LOSSLESS),
        #[cfg(not(feature = "compressed"))]
        (
            uids::JPEG2000_LOSSLESS,
            "JPEG 2000 lossless, transfer syntax 1.2.840.10008.1.2.4.90",
        ),
        #[cfg(not(feature = "compressed"))]
        (uids::JPEGLS_NEAR_LOSSLESS, "--features stylet-files/compressed"),
    ] {
        let why = read(&file(syntax, 1, &[], &[vec![1, 2]])).unwrap_err();
        assert!(why.contains(part), "{why}");
    }
    // Pixels with a length, in a syntax of fragments.
    let mut file = file(uids::RLE_LOSSLESS, 1, &[], &[]);
    let at = file.len() - 16 - 4;
    file[at..at + 4].copy_from_slice(&8_u32.to_le_bytes());
    assert!(read(&file).unwrap_err().contains("not stored as its transfer syntax"));
}

#[test]
fn loss_is_noted() {
    let declared = |value: &str| InMemDicomObject::from_element_iter([string(tags::LOSSY_IMAGE_COMPRESSION, value)]);
    for (value, syntax, is_noted) in [
        ("", uids::EXPLICIT_VR_LITTLE_ENDIAN, false),
        ("01", uids::EXPLICIT_VR_LITTLE_ENDIAN, true),
        ("01", uids::RLE_LOSSLESS, true),
        ("00", uids::JPEG2000, false),
        ("", uids::JPEG2000, true),
        ("00", uids::JPEG_BASELINE8_BIT, true),
        ("", uids::JPEGLS_LOSSLESS, false),
    ] {
        let note = loss(&declared(value), syntax);
        assert_eq!(note.is_some(), is_noted, "{value} {syntax}: {note:?}");
        assert!(note.is_none_or(|note| note.contains("LossyImageCompression")));
    }
}

#[cfg(feature = "compressed")]
mod of_other_encoders {
    use super::super::super::pixels::Pixel;
    use super::*;

    /// Reads one of the streams that `tests/files/data/make_streams.py` writes.
    fn stream(name: &str) -> Vec<u8> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/files/data/streams/");
        std::fs::read(format!("{folder}{name}")).unwrap()
    }

    const METHODS: [(&str, &str); 3] = [
        ("j2k", uids::JPEG2000_LOSSLESS),
        ("jls", uids::JPEGLS_LOSSLESS),
        ("jpg", uids::JPEG_LOSSLESS_SV1),
    ];

    #[test]
    fn every_value_is_that_of_the_uncompressed_frame() {
        for (ending, syntax) in METHODS {
            for (kind, storage) in [("u12", (12, 0)), ("i12", (12, 1)), ("i16", (16, 1))] {
                let name = format!("{kind}.{ending}");
                let content = file_of(storage, syntax, 1, &[], &[stream(&name)]);
                let (object, pixels, endian) = read_with_pixels(&content).unwrap_or_else(|why| panic!("{name}: {why}"));
                let read = Pixel::of(&object.data).unwrap().values(&pixels, endian, COLUMNS * ROWS);
                let middle = if storage.1 == 1 { 2048.0 } else { 0.0 };
                let expected: Vec<f64> = values(0).iter().map(|value| f64::from(*value) - middle).collect();
                assert_eq!(read, Ok(expected), "{name}");
            }
        }
    }

    #[test]
    fn attributes_that_contradict_the_stream_are_refused() {
        // GDCM's JPEG has 16 bits, whatever counts of them.
        for (ending, syntax) in &METHODS[..2] {
            for (name, storage) in [("u12", (8, 0)), ("u12", (11, 0)), ("i12", (11, 1)), ("u12", (14, 1))] {
                let content = file_of(storage, syntax, 1, &[], &[stream(&format!("{name}.{ending}"))]);
                let why = read(&content).expect_err(name);
                assert!(why.contains("BitsStored"), "{name}.{ending}: {why}");
            }
        }
        // The frame of another size, by its own header.
        for ending in ["j2k", "jls", "jpg"] {
            let mut other = stream(&format!("u12.{ending}"));
            let sizes = other.windows(2).position(|pair| pair == [0, ROWS as u8]).unwrap();
            other[sizes + 1] += 1;
            let syntax = METHODS.iter().find(|(of, _)| *of == ending).unwrap().1;
            assert!(
                read(&file(syntax, 1, &[], &[other]))
                    .unwrap_err()
                    .contains("Columns and Rows")
            );
        }
    }

    #[test]
    fn broken_streams_are_harmless() {
        for (ending, syntax) in METHODS {
            assert_harmless(syntax, &stream(&format!("u12.{ending}")));
        }
    }
}
