//! Reports of a recording on what it lost.

use super::*;
use crate::link::{Piece, SceneModel, Snapshot, played, played_of};
use bytemuck::Zeroable;
use std::sync::Arc;
use stylet_shm_schema::{
    Event, EventKind, HapticState, ParameterId, ParameterSet, ParametersInForce, PlanInForce, SceneHeader,
    SecondRecord, Session, SnapshotHeader, Text, TickRecord,
};

fn writer(path: &std::path::Path) -> Writer<BufWriter<File>> {
    Writer::of_file(BufWriter::new(File::create(path).unwrap())).unwrap()
}

/// A recording reported how many ticks it lacked, but not which; lost events and times without a snapshot went
/// unreported.
#[test]
fn what_a_recording_lacks_is_listed_for_each_kind() {
    let path = std::env::temp_dir().join(format!("stylet-lacks-{}.mcap", std::process::id()));
    let mut writer = writer(&path);
    for tick in (100..200).chain(1_200..1_300) {
        let record = TickRecord {
            session_id: 1,
            tick,
            ..TickRecord::zeroed()
        };
        writer.tick(&record).unwrap();
    }
    for sequence in [4, 8] {
        let mut event = Event::zeroed();
        (event.session_id, event.sequence, event.kind) = (1, sequence, 1);
        writer.event(&event).unwrap();
    }
    (writer.totals.snapshot_gaps, writer.totals.snapshot_gaps_s) = (1, 10.25);
    writer.totals.lost_in_core = 600;
    let totals = writer.finish().unwrap();
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

fn scene() -> SceneModel {
    let mut header = SceneHeader {
        session_id: 1,
        generation: 3,
        dims: [5, 1, 1],
        element_count: 5,
        vertex_count: 3,
        triangle_count: 1,
        body_triangle_count: 1,
        structure_count: 2,
        body_edge: 1,
        spacing_m: 1.07e-3,
        volume_m3: 1.0 / 3.0,
        target_upper_m: [0.1, 0.2, 0.3],
        name: Text::new("gland"),
        ..SceneHeader::default()
    };
    header.patient_from_scene[0] = 1.0;
    (header.labels.dims, header.labels.spacing_m) = ([5, 1, 1], 1.07e-3);
    (header.nodes.dims, header.nodes.spacing_m) = ([2, 1, 1], 8e-3);
    (header.structures[1].label, header.structures[1].name) = (7, Text::new("Urethra"));
    let rest_m = vec![[0.1, 0.2, 0.3], [1.0 / 3.0, 0.0, 0.0], [0.0, 0.7, 0.0]];
    SceneModel::new(header, rest_m, vec![[0, 1, 2]], vec![0, 1, 2, 1, 2])
}

fn marked() -> Event {
    let mut event = Event::zeroed();
    (event.session_id, event.sequence, event.time_ns, event.tick) = (1, 9, 1_000_000 * 15, 15);
    (event.kind, event.value, event.text) = (EventKind::Mark as u32, 1.0 / 3.0, Text::new("left lobe, é"));
    event
}

/// Writes messages of one run of a core, with numbers that have no exact decimal fraction.
fn recorded(name: &str) -> (PathBuf, TickRecord, HapticState, Snapshot) {
    let tick = |tick: u64| TickRecord {
        session_id: 1,
        tick,
        due_ns: 1_000_000 * tick,
        flags: 5,
        tip_in_scene_m: [0.1 * tick as f64, 1.0 / 3.0, -0.0],
        force_on_hand_n: [std::f64::consts::PI, 0.0, -1e-17],
        ..TickRecord::zeroed()
    };
    let mut state = HapticState::zeroed();
    (state.time_ns, state.puncture_depth_m, state.force_scale) = (1_000_000 * 20, 8e-3, 0.25);
    state.needle_direction = [0.0, 0.6, 0.8];
    (state.folded_from_m, state.lag_ns, state.worst_lag_m) = (7.93e-3, 5_000_001, 1e-3 / 3.0);
    let mut header = SnapshotHeader {
        session_id: 1,
        scene_generation: 3,
        time_ns: 1_000_000 * 20,
        residual: 6e-6,
        held_element: u32::MAX,
        seed_count: 1,
        ..SnapshotHeader::default()
    };
    header.seeds[0].position_m = [0.01, 0.02, 1.0 / 7.0];
    header.body_moved_m = [1e-3 / 3.0, 0.0, -2e-3];
    (header.bend_count, header.bend_spacing_m) = (2, 5e-3);
    header.bend_m[..2].copy_from_slice(&[[1.0 / 3.0 * 1e-3, 0.0, 0.0], [1e-4, -1e-5, 0.0]]);
    let surface_m = vec![[0.1, 0.2, 0.300_001], [0.333, 0.0, 0.0], [0.0, 0.7, 0.0]];
    let snapshot = Snapshot::of_parts(header, surface_m, vec![[1e-7, 0.0, 0.0]; 2]).unwrap();
    let mut plan = PlanInForce::zeroed();
    (plan.session_id, plan.generation, plan.seed_count) = (1, 2, 1);
    (plan.direction, plan.seeds[0].position_m) = ([0.0, 0.0, 1.0], [0.1, 1.0 / 3.0, 0.2]);
    let mut parameters = ParametersInForce::zeroed();
    parameters.set = ParameterSet::default();
    parameters.set.set(ParameterId::PunctureDepth, 7.5e-3);
    let mut session = Session::zeroed();
    (session.session_id, session.period_ns, session.device) = (1, 1_000_000, Text::new("hand"));
    let path = std::env::temp_dir().join(format!("stylet-{name}-{}.mcap", std::process::id()));
    let mut writer = writer(&path);
    writer.session(&session).unwrap();
    writer.scene(&scene()).unwrap();
    writer.plan(&plan).unwrap();
    writer.parameters(&parameters).unwrap();
    (10..30).for_each(|n| writer.tick(&tick(n)).unwrap());
    (10..30).for_each(|n| writer.second(&second_tick(n)).unwrap());
    writer.snapshot(Some(&state), &snapshot).unwrap();
    writer.event(&marked()).unwrap();
    writer.finish().unwrap();
    (path, tick(29), state, snapshot)
}

fn second_tick(tick: u64) -> SecondRecord {
    let mut record = SecondRecord::zeroed();
    (record.session_id, record.tick, record.due_ns) = (1, tick, tick * 1_000_000);
    record.tip_in_scene_m = [1.0 / 3.0, 1e-3 * tick as f64, -0.0];
    record.world_from_tool = [0.0, 0.0, 0.0, 1.0];
    record
}

#[test]
fn a_recording_holds_all_that_a_window_shows_in_the_same_bits() {
    let (path, last, state, snapshot) = recorded("holds");
    let played = played(&path, &Interrupt::default()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let _removed = std::fs::remove_file(&path);
    assert_eq!((played.session.session_id, played.cut_off.as_deref()), (1, None));
    assert_eq!(played.session.device.read(), "hand");
    let mut kinds = [0; 8];
    for (time_ns, piece) in &played.pieces {
        match piece {
            Piece::Tick(tick) => {
                kinds[0] += 1;
                assert_eq!(*time_ns, (tick.tick - 10) * 1_000_000);
                assert!(tick.tick != last.tick || **tick == last);
                assert!(tick.tip_in_scene_m[2].is_sign_negative());
            }
            Piece::Event(event) => {
                kinds[7] += 1;
                assert_eq!(*time_ns, 5_000_000, "at the moment that was marked");
                let (found, sent) = (**event, marked());
                assert_eq!(bytemuck::bytes_of(&found), bytemuck::bytes_of(&sent));
            }
            Piece::Second(record) => {
                kinds[6] += 1;
                assert_eq!(**record, second_tick(record.tick));
            }
            Piece::State(found) => {
                kinds[1] += 1;
                assert_eq!(found.puncture_depth_m, state.puncture_depth_m);
                assert_eq!(
                    (found.folded_from_m, found.lag_ns, found.worst_lag_m),
                    (7.93e-3, 5_000_001, state.worst_lag_m)
                );
                assert_eq!(
                    (found.force_scale, found.needle_direction),
                    (0.25, state.needle_direction)
                );
            }
            Piece::Scene(found) => {
                kinds[2] += 1;
                assert_eq!(found.words(), scene().words());
                assert_eq!(found.header.name.read(), "gland");
                assert_eq!(found.header.structures[1].name.read(), "Urethra");
                assert_eq!(found.header.volume_m3, 1.0 / 3.0);
                assert_eq!(found.labels, scene().labels);
            }
            Piece::Plan(plan) => {
                kinds[3] += 1;
                assert_eq!((plan.generation, plan.seed_count), (2, 1));
                assert_eq!(plan.seeds[0].position_m, [0.1, 1.0 / 3.0, 0.2]);
            }
            Piece::Parameters(parameters) => {
                kinds[4] += 1;
                assert_eq!(parameters.set.get(ParameterId::PunctureDepth), 7.5e-3);
            }
            Piece::Snapshot(found) => {
                kinds[5] += 1;
                assert_eq!(*time_ns, 10_000_000);
                assert_eq!(found.positions_m, snapshot.positions_m);
                assert_eq!(found.displacements_m, snapshot.displacements_m);
                assert_eq!(found.header, snapshot.header);
            }
        }
    }
    assert_eq!(kinds, [20, 1, 1, 1, 1, 1, 20, 1]);
    // Truncated or damaged anywhere, it ends with a reason or with the earlier data, and never with a panic.
    for end in (0..bytes.len()).step_by(97) {
        let _ended = played_of(&bytes[..end], &Interrupt::default());
        let mut damaged = bytes.clone();
        damaged[end] ^= 0x5a;
        let _ended = played_of(&damaged, &Interrupt::default());
    }
}

/// Like a core: it is live, its ticks and its state arrive, it can be paused and restarted, and it takes no request.
#[test]
fn a_recording_is_played_as_a_core_speaks() {
    let (path, last, ..) = recorded("played");
    let played = Arc::new(played(&path, &Interrupt::default()).unwrap());
    let _removed = std::fs::remove_file(&path);
    let mut link = Link::playing(Instance::new("played").unwrap(), Arc::clone(&played));
    let mut ticks = Vec::new();
    let mut all = |link: &mut Link| {
        let begun = Instant::now();
        ticks.clear();
        while ticks.last() != Some(&last.tick) {
            assert!(begun.elapsed() < Duration::from_secs(20), "it does not end: {ticks:?}");
            link.poll();
            ticks.extend(link.take_records().iter().map(|record| record.tick));
            std::thread::sleep(POLL_EVERY);
        }
        assert_eq!(ticks, (10..30).collect::<Vec<u64>>());
    };
    all(&mut link);
    assert_eq!(link.status(), LinkStatus::Live);
    let second = *link.second_state().expect("a second device");
    assert_eq!((second.tick, second.tip_in_scene_m[1]), (29, 0.029));
    assert_eq!(link.take_second_records().len(), 20);
    let state = *link.state().expect("a state");
    assert_eq!((state.tick, state.tip_in_scene_m), (29, last.tip_in_scene_m));
    assert_eq!((state.puncture_depth_m, state.flags), (8e-3, 5));
    assert_eq!(link.plan().map(|plan| plan.seed_count), Some(1));
    assert_eq!(link.snapshot().map(|s| s.header.seed_count), Some(1));
    let first = link.session().map(|session| session.session_id);
    let refused = link.send(&Request::Engage).expect_err("nobody to ask");
    assert_eq!(refused, LinkError::Playback);
    let playback = link.playback().expect("a recording").clone();
    assert!(playback.has_ended() && (playback.length_s() - 0.019).abs() < 1e-9);
    // Paused, it shows the tick of another time, and no later one.
    playback.hold(true);
    playback.jump(0.012);
    let begun = Instant::now();
    while link.state().is_none_or(|state| state.tick != 22) {
        assert!(
            begun.elapsed() < Duration::from_secs(10),
            "{:?}",
            link.state().map(|s| s.tick)
        );
        link.poll();
        std::thread::sleep(POLL_EVERY);
    }
    std::thread::sleep(20 * POLL_EVERY);
    link.poll();
    assert_eq!(link.state().map(|state| state.tick), Some(22));
    link.take_records();
    playback.jump(0.0);
    playback.play_at(0.5);
    playback.hold(false);
    all(&mut link);
    assert_ne!(
        link.session().map(|session| session.session_id),
        first,
        "ticks went back within a run"
    );
}

/// Files that exist are the standard: names and digits of every field stay. An earlier version, which recorded the
/// example, had fewer.
#[test]
fn messages_of_the_example_are_written_again_in_the_same_digits() {
    use stylet_recordings::channels::Kind;
    use stylet_recordings::{messages, stream};
    let bytes = std::fs::read("../example/insertion.mcap").unwrap();
    let mut counts = [0; 4];
    stream::each(&bytes, |topic, _, data| {
        let (which, again) = match Kind::of(topic) {
            Some(Kind::Event) => (0, messages::event(&messages::event_of(data).unwrap())),
            Some(Kind::Scene) => (1, messages::scene(&messages::scene_of(data, 1).unwrap())),
            Some(Kind::Plan) => (2, messages::plan(&messages::plan_of(data, 1).unwrap())),
            Some(Kind::Tissue) => {
                let snapshot = Snapshot::of_parts(messages::tissue_of(data).unwrap(), Vec::new(), Vec::new());
                (3, messages::tissue(&snapshot.unwrap()))
            }
            _ => return Ok(()),
        };
        counts[which] += 1;
        let before: serde_json::Map<String, serde_json::Value> = serde_json::from_slice(data).unwrap();
        for (name, value) in before {
            assert_eq!(again[&name].to_string(), value.to_string(), "{topic} {name}");
        }
        Ok(())
    })
    .unwrap();
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
}
