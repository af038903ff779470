//! Invalid records in shared memory neither crash nor stop either side, and are refused with a reason.

use bytemuck::{Pod, Zeroable, pod_read_unaligned};
use std::time::{Duration, Instant};
use stylet_host::link::{Link, LinkStatus};
use stylet_ports::{self as service, Meeting, Node, StateWriter};
use stylet_shm_schema::*;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Alone, Core, ask, fresh_instance, until};

/// All ones, zeros, random bytes and huge counts, of any type.
fn invalid<T: Pod>() -> Vec<T> {
    let mut random = stylet_random::Random(1);
    let mut all = vec![pod_read_unaligned(&vec![0xff; size_of::<T>()]), T::zeroed()];
    for _ in 0..200 {
        let bytes: Vec<u8> = (0..size_of::<T>()).map(|_| random.draw() as u8).collect();
        all.push(pod_read_unaligned(&bytes));
    }
    // Doubles that are not numbers, in every field.
    let nan = f64::NAN.to_ne_bytes();
    all.push(pod_read_unaligned(
        &nan.iter().copied().cycle().take(size_of::<T>()).collect::<Vec<u8>>(),
    ));
    all
}

#[test]
fn core_refuses_invalid_records_of_hosts_and_runs_on() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut link = core.host();
        let before = *link.state().expect("live");
        let node = Node::join(&core.instance).expect("same user");
        let commands = service::commands::publisher(&node).expect("a free place");
        let mut sent = 0;
        for mut command in invalid::<Command>() {
            // A record that happens to be a valid request to end is rightly obeyed.
            if command.kind == CommandKind::Shutdown as u32 {
                command.kind = u32::MAX;
            }
            commands.send(command).expect("sent");
            sent += 1;
            if sent % 16 == 0 {
                std::thread::sleep(Duration::from_millis(10));
            }
        }
        for kind in 1..=9_u32 {
            for bad in [f64::NAN, f64::INFINITY, 1e300, -1e300] {
                let mut command = Command::zeroed();
                (command.kind, command.length) = (kind, 64);
                bytemuck::cast_slice_mut(&mut command.payload[..64]).fill(bad);
                commands.send(command).expect("sent");
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        let uploads = service::uploads::publisher(&node, 64).expect("a free place");
        for header in invalid::<UploadHeader>() {
            let cells = std::array::from_fn::<u8, 64, _>(|i| i as u8);
            // At most two of a host wait: a core kept from its processor takes none of them for a while.
            let sent = until(Duration::from_secs(20), || uploads.send(&header, &cells).is_ok());
            assert!(sent, "no room for a volume in 20 s");
            std::thread::sleep(Duration::from_millis(1));
        }
        let went_on = until(Duration::from_secs(5), || {
            link.poll();
            link.state().is_some_and(|s| s.tick > before.tick + 1000)
        });
        assert!(went_on && core.is_running(), "the core stopped");
        let state = *link.state().expect("live");
        assert_eq!(state.fault, Fault::None as u32);
        assert_eq!(
            link.parameters().expect("live").set,
            ParameterSet::default(),
            "an invalid record changed a parameter"
        );
        let refused = link
            .events()
            .iter()
            .filter(|e| e.kind == EventKind::InvalidRefused as u32)
            .count();
        assert!(refused > 50, "{refused} refusals were reported");
        let why = ask(
            &mut link,
            &Request::SetParameters(vec![ParameterChange {
                id: ParameterId::ShearVertical,
                value: 0.7,
            }]),
        );
        assert!(
            why.as_ref().is_err_and(|w| w.contains("eq. 1 in three dimensions")),
            "eq. 1 is not enforced: {why:?}"
        );
        ask(&mut link, &Request::Engage).expect("a good command is still carried out");
    });
}

/// More than 10,000 values of each kind of message.
const ROUNDS: usize = 50;
/// Values that the host has dropped by then.
const DROPPED: u64 = 10_000;

#[test]
fn host_drops_invalid_records_of_a_core_and_goes_on() {
    let alone = Alone(fresh_instance());
    let meeting = Meeting::new(&alone.0).expect("shared memory");
    let node = &meeting.node;
    let session_id = 7;
    let board = StateWriter::create(node, session_id).expect("board");
    let sessions = service::session::publisher(node).expect("publisher");
    let events = service::events::publisher(node).expect("publisher");
    let parameters = service::parameters::publisher(node).expect("publisher");
    let plans = service::plan::publisher(node).expect("publisher");
    let replies = service::replies::publisher(node).expect("publisher");
    let records = service::records::publisher(node, 64).expect("publisher");
    let snapshots = service::snapshots::publisher(node, 64).expect("publisher");
    let scenes = service::scene::publisher(node, 64).expect("publisher");

    meeting.open().expect("shared memory");
    let mut link = Link::new(alone.0.clone());
    let mut good = Session::zeroed();
    (good.session_id, good.schema_version) = (session_id, SCHEMA_VERSION);
    let states = invalid::<HapticState>();
    let (bad_events, bad_parameters, bad_plans) = (
        invalid::<Event>(),
        invalid::<ParametersInForce>(),
        invalid::<PlanInForce>(),
    );
    let (bad_replies, bad_records) = (invalid::<Reply>(), invalid::<TickRecord>());
    let (bad_snapshots, bad_vertices, bad_scenes) = (
        invalid::<SnapshotHeader>(),
        invalid::<Vertex>(),
        invalid::<SceneHeader>(),
    );
    let mut sent = 0;
    // On a busy machine the link's thread meets the core some rounds later.
    let begun = Instant::now();
    for (n, i) in (0..states.len()).cycle().enumerate() {
        let is_enough = n >= ROUNDS * states.len() && link.invalid_dropped() > DROPPED;
        if is_enough || begun.elapsed() > Duration::from_secs(30) {
            break;
        }
        good.time_ns += 1;
        sessions.send(good).expect("sent");
        board.write(&states[i]);
        events.send(bad_events[i]).expect("sent");
        parameters.send(bad_parameters[i]).expect("sent");
        plans.send(bad_plans[i]).expect("sent");
        replies.send(bad_replies[i]).expect("sent");
        records.send(&session_id, &[bad_records[i]; 4]).expect("sent");
        snapshots.send(&bad_snapshots[i], &[bad_vertices[i]; 8]).expect("sent");
        scenes.send(&bad_scenes[i], &[u32::MAX; 9]).expect("sent");
        sent += 8;
        link.poll();
        link.take_records();
    }
    println!("{sent} invalid messages, {} dropped", link.invalid_dropped());
    // And invalid sessions.
    for session in invalid::<Session>() {
        sessions.send(session).expect("sent");
        link.poll();
    }
    assert!(
        link.invalid_dropped() > DROPPED,
        "{} values were dropped",
        link.invalid_dropped()
    );
    assert!(link.scene().is_none(), "an invalid scene was used");
    let _: LinkStatus = link.status();
}
