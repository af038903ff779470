//! Damaged network data: the decoders refuse it or take the valid part, and never panic.

mod decoders;

use bytemuck::Zeroable;
use std::path::Path;
use stylet_relay::control::Order;
use stylet_relay::wire::{self, Hello, Kind, MAX_THIN_BYTES, Rest, Stamp, Thin, Ticks, encode};
use stylet_shm_schema::{Class, HandMove, HapticState, Request, SceneHeader, SnapshotHeader, Text, TickRecord, Vertex};

/// One accepted message of each kind, except the large plain ones.
fn examples() -> Vec<(&'static str, Vec<u8>)> {
    let message = |kind, parts: &[&[u8]]| encode(kind, Stamp::default(), parts);
    let mut state = HapticState::zeroed();
    state.needle_direction = [0.0, 0.0, 1.0];
    let records = [TickRecord::zeroed(); 3];
    let (mut scene, mut header) = (SceneHeader::zeroed(), SnapshotHeader::zeroed());
    (scene.vertex_count, header.vertex_count, header.seed_count) = (20, 20, 1);
    let rest = Rest::of_scene(&scene, &[0; 60]);
    let snapshot = Thin::of(&rest, &header, &[Vertex::zeroed(); 20])
        .expect("fits")
        .with_places(0, MAX_THIN_BYTES);
    let hand = Request::MoveHand(HandMove {
        tip_m: [0.01, 0.0, 0.0],
        direction: [0.0, 0.0, 1.0],
        speed_m_per_s: 0.1,
        acceleration_m_per_s2: 1.0,
    });
    let command = hand.encode(1, 2).expect("fits");
    let class = Class {
        count: 1,
        operator: Text::new("Otto"),
        ..Class::zeroed()
    };
    vec![
        ("state", message(Kind::State, &[bytemuck::bytes_of(&state)])),
        ("records", message(Kind::Records, &[&wire::pack(&records)])),
        (
            "newest",
            message(Kind::Newest, &[bytemuck::bytes_of(&state), &wire::pack(&records)]),
        ),
        ("snapshot", message(Kind::Snapshot, &[&snapshot])),
        ("class", message(Kind::Class, &[wire::class_bytes(&class)])),
        ("hello", message(Kind::Hello, &[bytemuck::bytes_of(&Hello::default())])),
        ("command", message(Kind::Command, &[bytemuck::bytes_of(&command)])),
        (
            "again",
            message(
                Kind::Again,
                &[bytemuck::bytes_of(&Ticks {
                    session_id: 3,
                    from: 1,
                    to: 9,
                })],
            ),
        ),
        (
            "lease",
            message(Kind::Lease, &[Order::Give("Otto".to_owned()).line().as_bytes()]),
        ),
        ("seen", message(Kind::Seen, &[])),
    ]
}

#[test]
fn damaged_messages_are_refused_or_valid_and_never_panic() {
    let mut random = stylet_random::Random(19);
    let mut below = |limit: usize| random.below(limit);
    let (mut accepted, mut refused) = (0, 0);
    for (name, bytes) in examples() {
        assert!(decoders::take(&bytes), "{name}");
        for _ in 0..5_000 {
            let mut bad = bytes.clone();
            for _ in 0..=below(4) {
                let at = below(bad.len());
                bad[at] = [0, 0x7f, 0x80, 0xff, below(256) as u8][below(5)];
            }
            bad.truncate(bad.len() - below(2) * below(bad.len()));
            match decoders::take(&bad) {
                true => accepted += 1,
                false => refused += 1,
            }
        }
    }
    assert!(
        accepted > 1000 && refused > 1000,
        "{accepted} accepted, {refused} refused"
    );
}

/// `make relay-fuzz` begins with these, and its findings are kept among them.
#[test]
fn the_corpus_is_taken_without_a_panic() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/wire");
    if std::env::var_os("UPDATE_CORPUS").is_some() {
        std::fs::create_dir_all(&folder).expect("a folder");
        for (name, bytes) in examples() {
            std::fs::write(folder.join(name), bytes).expect("written");
        }
    }
    let files: Vec<_> = std::fs::read_dir(&folder)
        .expect("kept")
        .map(|f| f.expect("readable").path())
        .collect();
    assert!(files.len() >= examples().len());
    // Messages of another version would be refused at their first word, and a fuzzer that begins with them learns
    // nothing.
    for (name, bytes) in examples() {
        let kept = std::fs::read(folder.join(name)).expect("kept");
        assert_eq!(kept.get(..4), bytes.get(..4), "{name}: UPDATE_CORPUS=1 makes it anew");
    }
    for file in files {
        decoders::take(&std::fs::read(&file).expect("readable"));
    }
}
