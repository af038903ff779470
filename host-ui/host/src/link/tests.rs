//! A host against a core made of the same ports.

use super::*;
use bytemuck::Zeroable;
use stylet_files::LabelVolume;
use stylet_ports::{self as service, Meeting, StateWriter};

/// A name whose shared memory is removed at the end; drop it last.
struct Swept(Instance);

impl std::ops::Deref for Swept {
    type Target = Instance;
    fn deref(&self) -> &Instance {
        &self.0
    }
}

impl Drop for Swept {
    fn drop(&mut self) {
        self.0.sweep();
    }
}

fn instance(name: &str) -> Swept {
    Swept(Instance::new(&format!("{name}-{}", std::process::id())).unwrap())
}

/// Polls like a frame until the condition holds.
fn until(link: &mut Link, mut holds: impl FnMut(&mut Link) -> bool) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(20) {
        link.poll();
        if holds(link) {
            return true;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    false
}

/// A core's meeting point, with every service that a host joins.
fn core(instance: &Instance) -> Meeting {
    let core = Meeting::new(instance).unwrap();
    core.open().unwrap();
    core
}

/// Returns a link with open ports: everything sent from now on reaches it.
fn connected(core: &Meeting) -> Link {
    let sessions = service::session::watch(&core.node).unwrap();
    let stops = service::stops::watch(&core.node).unwrap();
    let mut link = Link::new(core.node.epoch().instance().clone());
    assert!(until(&mut link, |_| {
        sessions.connected().subscribers == 1 && stops.connected().publishers == 1
    }));
    link
}

fn announce(id: u64, time_ns: u64) -> Session {
    let mut session = Session::zeroed();
    (session.session_id, session.schema_version, session.period_ns) = (id, SCHEMA_VERSION, 1_000_000);
    (session.time_ns, session.started_ns) = (time_ns, id);
    session
}

#[test]
fn no_core_says_what_to_type() {
    let instance = instance("absent");
    let mut link = Link::new(instance.0.clone());
    link.poll();
    let LinkStatus::Absent { why } = link.status() else {
        panic!("{:?}", link.status())
    };
    assert!(why.contains("rt-core --instance absent-"), "{why}");
    assert!(link.send(&Request::Engage).is_err());
}

#[test]
fn a_restarted_core_is_found_and_nothing_of_the_first_run_is_left() {
    let instance = instance("restart");
    let mut link = Link::new(instance.0.clone());
    for run in 1..=3_u64 {
        let core = core(&instance);
        let board = StateWriter::create(&core.node, run).unwrap();
        let mut state = HapticState::zeroed();
        state.tick = 10 * run;
        board.write(&state);
        let parameters = service::parameters::publisher(&core.node).unwrap();
        let in_force = ParametersInForce {
            session_id: run,
            generation: run,
            effective_tick: 1,
            set: ParameterSet::default(),
        };
        // Sent before the announcement: the link keeps it.
        parameters.send(in_force).unwrap();
        std::thread::sleep(Duration::from_millis(20));
        link.poll();
        assert!(link.parameters().is_none_or(|p| p.session_id == run - 1));
        let sessions = service::session::publisher(&core.node).unwrap();
        sessions.send(announce(run, run)).unwrap();
        let begun = |link: &mut Link| {
            sessions.connect();
            parameters.connect();
            link.session().is_some_and(|s| s.session_id == run) && link.state().is_some() && link.parameters().is_some()
        };
        assert!(until(&mut link, begun));
        assert_eq!(link.state().unwrap().tick, 10 * run);
        assert_eq!(link.parameters().unwrap().generation, run);
        assert_eq!(link.status(), LinkStatus::Live);
    }
}

/// A failed bridge is restarted with new ports, and resends what hosts may have missed.
#[test]
fn a_host_on_new_ports_of_a_run_has_every_record_exactly_once() {
    let instance = instance("epoch");
    let mut link = Link::new(instance.0.clone());
    let mut ticks = Vec::new();
    for (from, to) in [(1, 100), (50, 300), (250, 301)] {
        let core = core(&instance);
        let sessions = service::session::publisher(&core.node).unwrap();
        let records = service::records::publisher(&core.node, MAX_BATCH).unwrap();
        sessions.send(announce(5, from)).unwrap();
        let send = |tick: u64| {
            let record = TickRecord {
                session_id: 5,
                tick,
                ..TickRecord::zeroed()
            };
            records.send(&5, &[record]).unwrap();
        };
        if from > 1 {
            // Before any host exists.
            (from..=to).for_each(send);
        }
        let connect = || {
            sessions.connect();
            records.connect();
        };
        assert!(until(&mut link, |link| {
            connect();
            link.session().is_some_and(|s| s.time_ns == from)
        }));
        if from == 1 {
            (from..=to).for_each(send);
        }
        assert!(until(&mut link, |link| {
            connect();
            ticks.extend(link.take_records().iter().map(|r| r.tick));
            ticks.last() == Some(&to)
        }));
    }
    assert!(ticks.iter().zip(1..).all(|(&tick, n)| tick == n), "{ticks:?}");
}

#[test]
fn invalid_messages_are_counted_and_not_used() {
    let instance = instance("invalid");
    let core = core(&instance);
    let mut link = connected(&core);
    let node = &core.node;
    let sessions = service::session::publisher(node).unwrap();
    sessions.send(announce(7, 1)).unwrap();
    let plans = service::plan::publisher(node).unwrap();
    plans
        .send(bytemuck::pod_read_unaligned(&vec![0xff; size_of::<PlanInForce>()]))
        .unwrap();
    let events = service::events::publisher(node).unwrap();
    events
        .send(bytemuck::pod_read_unaligned(&vec![0xff; size_of::<Event>()]))
        .unwrap();
    assert!(until(&mut link, |link| link.invalid_dropped() >= 2));
    assert!(link.plan().is_none() && link.events().is_empty());
    assert_eq!(link.invalid_dropped(), 2);
}

#[test]
fn a_command_and_a_volume_arrive_and_are_answered_once() {
    let instance = instance("answer");
    let core = core(&instance);
    let mut link = connected(&core);
    let node = &core.node;
    let sessions = service::session::publisher(node).unwrap();
    let replies = service::replies::publisher(node).unwrap();
    let commands = service::commands::subscriber(node).unwrap();
    let uploads = service::uploads::subscriber(node).unwrap();
    sessions.send(announce(9, 1)).unwrap();
    assert!(until(&mut link, |link| link.status() == LinkStatus::Live));

    let request = Request::LoadBuiltinScene(2);
    let id = link.send(&request).unwrap();
    let mut arrived = None;
    assert!(until(&mut link, |_| {
        arrived = commands.receive();
        arrived.is_some()
    }));
    let command = arrived.unwrap();
    assert_eq!((command.command_id, Request::decode(&command)), (id, Ok(request)));
    for (host_id, text) in [(command.host_id, "mine"), (command.host_id ^ 1, "another's")] {
        let refusal = Refusal::new(RefusalCode::SceneLoading, text);
        replies.send(Reply::new(9, (host_id, id), Err(&refusal))).unwrap();
    }
    let mut answer = None;
    assert!(until(&mut link, |link| {
        answer = link.reply(id);
        answer.is_some()
    }));
    let refusal = answer.unwrap().unwrap_err();
    assert_eq!(refusal.text, "mine");
    assert!(refusal.is_for(RefusalCode::SceneLoading));
    assert_eq!(link.reply(id), None);

    let volume = LabelVolume {
        dims: [2, 3, 4],
        spacing_m: 1e-3,
        structures: Vec::new(),
        layers: Vec::new(),
        cells: (0..24).collect(),
        patient: stylet_anatomy::PatientFrame::default(),
        name: "gland".to_owned(),
        voxels_per_label: Vec::new(),
        warnings: Vec::new(),
    };
    for _ in 0..3 {
        let id = link.upload(&volume).unwrap();
        let mut arrived = None;
        assert!(until(&mut link, |_| {
            arrived = uploads.receive();
            arrived.is_some()
        }));
        let sample = arrived.unwrap();
        assert_eq!(sample.header().command_id, id);
        assert_eq!(sample.values(), &volume.cells[..]);
    }
}

fn sends_records(core: &Meeting, session_id: u64, batches: u64, every: Duration) {
    let node = &core.node;
    let sessions = service::session::publisher(node).unwrap();
    sessions.send(announce(session_id, 1)).unwrap();
    let records = service::records::publisher(node, MAX_BATCH).unwrap();
    std::thread::sleep(Duration::from_millis(50));
    for batch in 0..batches {
        if batch % 100 == 0 {
            // The heartbeat: without it the host would recreate its ports.
            sessions.send(announce(session_id, 2 + batch)).unwrap();
        }
        let two = [1, 2].map(|n| TickRecord {
            session_id,
            tick: 2 * batch + n,
            ..TickRecord::zeroed()
        });
        records.send(&session_id, &two).unwrap();
        std::thread::sleep(every);
    }
}

/// The window took records in its frame: all but the last 64 batches, 0.13 s, were lost without notice.
#[test]
fn a_frame_of_three_seconds_loses_no_record() {
    let instance = instance("slow");
    let core = core(&instance);
    let mut link = connected(&core);
    let sender = std::thread::spawn(move || {
        sends_records(&core, 5, 1500, Duration::from_millis(2));
        core
    });
    assert!(until(&mut link, |link| link.session().is_some()));
    let _core = sender.join().unwrap();
    let mut ticks = Vec::new();
    until(&mut link, |link| {
        ticks.extend(link.take_records().iter().map(|r| r.tick));
        ticks.len() == 3000
    });
    assert_eq!(ticks.len(), 3000);
    assert!(ticks.iter().zip(1..).all(|(&tick, n)| tick == n));
}

/// Gaps in the numbers of the events were ignored.
#[test]
fn unseen_events_count_only_from_when_the_host_joined() {
    let mut inbox = Inbox::default();
    inbox.begin(announce(1, 1));
    for sequence in [7, 8, 8, 12] {
        let mut event = Event::zeroed();
        (event.session_id, event.sequence) = (1, sequence);
        inbox.put_event(event);
    }
    assert_eq!((inbox.run.events.len(), inbox.run.events_unseen), (3, 3));
}

#[test]
fn a_request_that_cannot_be_sent_is_answered() {
    let instance = instance("unsent");
    let core = core(&instance);
    let mut link = connected(&core);
    let node = &core.node;
    let sessions = service::session::publisher(node).unwrap();
    sessions.send(announce(3, 1)).unwrap();
    assert!(until(&mut link, |link| link.status() == LinkStatus::Live));
    // No port takes commands.
    let id = link.send(&Request::Engage).unwrap();
    let mut answer = None;
    assert!(until(&mut link, |link| {
        answer = link.reply(id);
        answer.is_some()
    }));
    let why = answer.unwrap().unwrap_err().text;
    assert!(why.contains("queue is full or it has just ended"), "{why}");
}
