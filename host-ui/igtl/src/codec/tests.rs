//! Messages against the bytes of the C++ library, and the decoder against invalid bytes.

use super::*;
use stylet_random::Random;

mod library;

/// Returns the messages of `tests/goldens.cpp`.
pub fn examples() -> Vec<(&'static str, Message)> {
    let point = |name: &str, place_mm| Point {
        name: name.to_owned(),
        group: "Seeds".to_owned(),
        rgba: [255, 200, 0, 255],
        place_mm,
        diameter_mm: 0.8,
        owner: "Slice".to_owned(),
    };
    let bodies = [
        (
            "transform",
            Body::Transform([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.5, -2.25, 30.125]]),
        ),
        (
            "point",
            Body::Points(vec![
                point("Seed 1", [1.0, 2.0, 3.0]),
                point("Seed 2", [-4.0, 5.5, 6.25]),
            ]),
        ),
        (
            "polydata",
            Body::PolyData(PolyData {
                points: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                triangles: vec![[0, 2, 1], [0, 1, 3]],
            }),
        ),
        (
            "image",
            Body::Image(Image {
                size: [3, 2, 1],
                columns: [
                    [0.25, 0.0, 0.0],
                    [0.0, 0.0, -0.5],
                    [0.0, 2.0, 0.0],
                    [1.5, -2.25, 30.125],
                ],
                greys: vec![0, 1, 127, 128, 254, 255],
            }),
        ),
        (
            "status",
            Body::Status(Status {
                code: 1,
                subcode: -7,
                error: "OK!".to_owned(),
                text: "needle in tissue".to_owned(),
            }),
        ),
        ("string", Body::Text("Depth 31 mm, force 1.25 N".to_owned())),
    ];
    let time = Timestamp {
        seconds: 1_234_567_890,
        fraction: 1 << 31,
    };
    let device = "Stylet".to_owned();
    bodies
        .into_iter()
        .map(|(name, body)| {
            let device = device.clone();
            (name, Message { device, time, body })
        })
        .collect()
}

#[test]
fn messages_are_those_of_the_library_byte_for_byte() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens");
    for (name, message) in examples() {
        let golden = std::fs::read(format!("{folder}/{name}.bin")).unwrap();
        assert_eq!(message.encode().unwrap(), golden, "{name}");
        assert_eq!(Message::decode(&golden).unwrap(), message, "{name}");
    }
}

/// Tests protocol 3, which puts a second header before a body, and pairs of words behind it.
#[test]
fn an_extended_message_of_the_library_says_the_same() {
    let golden = include_bytes!("../../tests/goldens/transform2.bin");
    let (_, message) = &examples()[0];
    assert_eq!(Message::decode(golden).as_ref(), Ok(message));
    for at in HEADER_BYTES..HEADER_BYTES + 8 {
        let mut bad = golden.to_vec();
        bad[at] = 0xff;
        let sum = crc64(&bad[HEADER_BYTES..]);
        bad[50..58].copy_from_slice(&sum.to_be_bytes());
        assert!(matches!(Message::decode(&bad), Err(CodecError::Field(_))), "byte {at}");
    }
}

/// Compares with the check value in the catalogue of CRCs for CRC-64/ECMA-182.
#[test]
fn the_checksum_has_its_published_check_value() {
    assert_eq!(crc64(b"123456789"), 0x6c40_df5f_0b49_7347);
}

/// Tests mutations with a valid checksum, so that they reach the decoder of the body.
#[test]
fn mutated_messages_are_refused_or_decoded_and_never_panic() {
    let mut random = Random(19);
    let (mut accepted, mut refused) = (0, 0);
    let mut originals: Vec<Vec<u8>> = examples().iter().map(|(_, m)| m.encode().unwrap()).collect();
    originals.push(include_bytes!("../../tests/goldens/transform2.bin").to_vec());
    for round in 0..20_000 {
        for original in &originals {
            let mut bytes = original.clone();
            let from = if round % 4 == 0 { 0 } else { HEADER_BYTES };
            for _ in 0..=random.below(4) {
                let at = from + random.below(bytes.len() - from);
                bytes[at] = random.below(256) as u8;
            }
            bytes.truncate(bytes.len() - if round % 8 == 1 { random.below(20) } else { 0 });
            let body = (bytes.len() - HEADER_BYTES) as u64;
            if from > 0 {
                bytes[42..50].copy_from_slice(&body.to_be_bytes());
            }
            let sum = crc64(&bytes[HEADER_BYTES..]);
            bytes[50..58].copy_from_slice(&sum.to_be_bytes());
            match Message::decode(&bytes) {
                Ok(_) => accepted += 1,
                Err(_) => refused += 1,
            }
        }
    }
    assert!(
        accepted > 1000 && refused > 1000,
        "{accepted} accepted, {refused} refused"
    );
}

#[test]
fn a_length_beyond_the_limit_is_refused_by_the_header_alone() {
    let mut bytes = examples()[1].1.encode().unwrap();
    bytes[42..50].copy_from_slice(&u64::MAX.to_be_bytes());
    let refused = Header::decode(&bytes[..HEADER_BYTES]);
    assert!(
        matches!(refused, Err(CodecError::TooLong { kind: "POINT", .. })),
        "{refused:?}"
    );
}

#[test]
fn a_changed_body_fails_its_checksum() {
    let mut bytes = examples()[0].1.encode().unwrap();
    bytes[HEADER_BYTES] ^= 1;
    assert!(matches!(Message::decode(&bytes), Err(CodecError::Checksum { .. })));
}

#[test]
fn only_whole_greys_in_ras_are_images() {
    let image = examples().into_iter().find(|(name, _)| *name == "image").unwrap().1;
    let bytes = image.encode().unwrap();
    // Version, components, type, frame, size, start and size of the part.
    for at in [1, 2, 3, 5, 7, 9, 11, 61, 67] {
        let mut bad = bytes.clone();
        bad[HEADER_BYTES + at] += 1;
        let sum = crc64(&bad[HEADER_BYTES..]);
        bad[50..58].copy_from_slice(&sum.to_be_bytes());
        assert!(matches!(Message::decode(&bad), Err(CodecError::Field(_))), "byte {at}");
    }
}
