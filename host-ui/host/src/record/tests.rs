//! What a recording says of what it lost.

use super::*;
use bytemuck::Zeroable;
use stylet_shm_schema::{Event, TickRecord};

fn ticks(range: std::ops::Range<u64>) -> Item {
    let record = |tick| TickRecord {
        session_id: 1,
        tick,
        ..TickRecord::zeroed()
    };
    Item::Records(range.map(record).collect())
}

fn event(sequence: u64) -> Item {
    let mut event = Event::zeroed();
    (event.session_id, event.sequence, event.kind) = (1, sequence, 1);
    Item::Event(Box::new(event))
}

/// A recording said how many ticks it lacked and not which; lost events and times without a snapshot went unsaid.
#[test]
fn what_a_recording_lacks_is_listed_for_each_kind() {
    let path = std::env::temp_dir().join(format!("stylet-lacks-{}.mcap", std::process::id()));
    let (send, receive) = mpsc::sync_channel(ITEMS_AHEAD);
    for item in [
        ticks(100..200),
        ticks(1_200..1_300),
        event(4),
        event(8),
        Item::SnapshotsMissing(10.25),
        Item::LostInCore(600),
    ] {
        send.send(item).unwrap();
    }
    drop(send);
    let totals = writer::write_all(&path, &receive).unwrap();
    let _removed = std::fs::remove_file(&path);
    assert_eq!(
        totals.missing_words(),
        ["missing ticks: 200 to 1199 (1000)", "missing events: 5 to 7 (3)"]
    );
    let words = totals.words();
    for part in [
        "200 ticks of 1 session(s), 1000 missing in 1 gaps, 600 of them lost in the core",
        "2 events, 3 missing",
        "none for 10.2 s in 1 gaps",
    ] {
        assert!(words.contains(part), "{words}");
    }
    let error = totals.verdict().unwrap_err().to_string();
    assert!(
        error.starts_with("1000 ticks are missing in 1 gaps, 600 of them lost in the core; 3 events"),
        "{error}"
    );
}
