//! A host against a core made of the same ports.

use super::*;
use bytemuck::Zeroable;
use stylet_shm_schema::service;

/// A name that leaves nothing in shared memory; to be dropped last.
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
    link.poll();
    for run in 1..=3_u64 {
        let node = instance.node().unwrap();
        let board = service::create_state_board(&node, run).unwrap();
        let writer = board.writer_builder().create().unwrap();
        let entry = writer.entry::<HapticState>(&service::STATE_KEY).unwrap();
        let mut state = HapticState::zeroed();
        state.tick = 10 * run;
        entry.update_with_copy(state);
        let parameters = service::parameters(&node)
            .unwrap()
            .publisher_builder()
            .create()
            .unwrap();
        let in_force = ParametersInForce {
            session_id: run,
            generation: run,
            effective_tick: 1,
            set: ParameterSet::default(),
        };
        // Before the announcement: the link keeps it.
        parameters.send_copy(in_force).unwrap();
        link.poll();
        assert!(link.parameters().is_none_or(|p| p.session_id == run - 1));
        let sessions = service::session(&node).unwrap().publisher_builder().create().unwrap();
        sessions.send_copy(announce(run, run)).unwrap();
        link.poll();
        assert_eq!(link.session().unwrap().session_id, run);
        assert_eq!(link.state().unwrap().tick, 10 * run);
        assert_eq!(link.parameters().unwrap().generation, run);
        assert_eq!(link.status(), LinkStatus::Live);
    }
}

#[test]
fn invalid_messages_are_counted_and_not_used() {
    let instance = instance("invalid");
    let mut link = Link::new(instance.0.clone());
    link.poll();
    let node = instance.node().unwrap();
    let sessions = service::session(&node).unwrap().publisher_builder().create().unwrap();
    sessions.send_copy(announce(7, 1)).unwrap();
    let plans = service::plan(&node).unwrap().publisher_builder().create().unwrap();
    plans
        .send_copy(bytemuck::pod_read_unaligned(&vec![0xff; size_of::<PlanInForce>()]))
        .unwrap();
    let events = service::events(&node).unwrap().publisher_builder().create().unwrap();
    events
        .send_copy(bytemuck::pod_read_unaligned(&vec![0xff; size_of::<Event>()]))
        .unwrap();
    link.poll();
    assert!(link.plan().is_none() && link.events().is_empty());
    assert_eq!(link.invalid_dropped(), 2);
}

#[test]
fn a_command_and_a_volume_arrive_and_are_answered_once() {
    let instance = instance("answer");
    let mut link = Link::new(instance.0.clone());
    link.poll();
    let node = instance.node().unwrap();
    let sessions = service::session(&node).unwrap().publisher_builder().create().unwrap();
    let replies = service::replies(&node).unwrap().publisher_builder().create().unwrap();
    let commands = service::commands(&node).unwrap().subscriber_builder().create().unwrap();
    let uploads = service::uploads(&node).unwrap().subscriber_builder().create().unwrap();
    sessions.send_copy(announce(9, 1)).unwrap();
    link.poll();

    let request = Request::LoadBuiltinScene(2);
    let id = link.send(&request).unwrap();
    let command = *commands.receive().unwrap().unwrap();
    assert_eq!((command.command_id, Request::decode(&command)), (id, Ok(request)));
    for (host_id, text) in [(command.host_id, "mine"), (command.host_id ^ 1, "another's")] {
        let refusal = Refusal::new(RefusalCode::SceneLoading, text);
        replies.send_copy(Reply::new(9, (host_id, id), Err(&refusal))).unwrap();
    }
    link.poll();
    let answer = link.reply(id).unwrap();
    assert_eq!(answer.text, "mine");
    assert!(answer.is_refused_for(RefusalCode::SceneLoading) && !answer.accepted);
    assert_eq!(link.reply(id), None);

    let volume = LabelVolume {
        dims: [2, 3, 4],
        spacing_m: 1e-3,
        structures: Vec::new(),
        cells: (0..24).collect(),
        patient: stylet_anatomy::PatientFrame::default(),
        name: "gland".to_owned(),
        voxels_per_label: Vec::new(),
        warnings: Vec::new(),
    };
    for _ in 0..3 {
        let id = link.upload(&volume).unwrap();
        let sample = uploads.receive().unwrap().unwrap();
        assert_eq!(sample.user_header().command_id, id);
        assert_eq!(sample.payload(), &volume.cells[..]);
    }
}
