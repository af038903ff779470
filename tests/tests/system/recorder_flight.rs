//! Flight recordings of a running core, repeated in another process: every force and every element, bit for bit.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;
use stylet_runtime::replay::{file::Flight, lines::LinesAgain, repeat};
use stylet_runtime::rt::exchange::HapticOrder;
use stylet_shm_schema::{EventKind, Exercise, ParameterChange, ParameterId, Request, TickRecord};
use stylet_tests::hand::Insertion;
use stylet_tests::stopped::StoppedThread;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, program, until};

fn replay(file: &Path) -> Output {
    Command::new(program("rt-core"))
        .arg("replay")
        .arg(file)
        .output()
        .expect("rt-core runs")
}

fn assert_identical(file: &Path) -> Flight {
    let output = replay(file);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{}\n{text}{}", file.display(), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "not repeated bit for bit");
    assert_eq!(text.matches("bit-identical").count(), 2, "forces and tissue");
    Flight::read(file).expect("just read")
}

/// Requests a recording and returns its file.
fn request(core: &Core, hand: &mut Insertion) -> PathBuf {
    ask(&mut hand.link, &Request::SaveFlight).expect("saved");
    hand.take();
    let kind = EventKind::FlightSaved as u32;
    let event = hand
        .link
        .events()
        .iter()
        .rfind(|e| e.kind == kind)
        .expect("an event with the place");
    let file = core.flights().pop().expect("a file");
    assert!(
        file.display().to_string().starts_with(&event.text.read()),
        "{} {}",
        file.display(),
        event.text.read()
    );
    file
}

#[test]
fn request_fault_and_end_leave_recordings_that_repeat_bit_for_bit() {
    where_the_machine_runs(|| {
        let mut core = Core::start_with(&["--rt-if-allowed", "--tissue", "paper"]);
        let mut hand = Insertion::begin(&mut core, 0.006);
        // Parameters, seeds and a reversal on the way, for longer than two checkpoints of the tissue.
        hand.watch(Duration::from_secs(5));
        let change = |id, value| ParameterChange { id, value };
        let changes = vec![
            change(ParameterId::MembranePeak, 4.5),
            change(ParameterId::ShearHorizontal, 0.4),
        ];
        ask(&mut hand.link, &Request::SetParameters(changes)).expect("set");
        hand.watch(Duration::from_secs(3));
        ask(&mut hand.link, &Request::DropSeed { strand_pitch_m: None }).expect("dropped");
        hand.go(0.02, 0.02);
        hand.watch(Duration::from_secs(2));
        let requested = assert_identical(&request(&core, &mut hand));
        let haptic = requested.haptic.as_ref().expect("recorded");
        let tissue = requested.tissue.as_ref().expect("recorded");
        assert!(haptic.ticks.len() >= 4000, "{} ticks", haptic.ticks.len());
        assert!(
            haptic.memory.state.tick > 1000,
            "the recording begins in the middle of the session"
        );
        assert!(tissue.ticks.len() >= 800 && tissue.middle.is_some() && !tissue.orders.is_empty());
        assert!(
            tissue.memory.body.iter().any(|&byte| byte != 0),
            "it begins with tissue that is not at rest"
        );
        // The forces in the file are those that the host saw.
        let seen = |tick| hand.records.iter().find(|r: &&TickRecord| r.tick == tick);
        let compared = haptic
            .ticks
            .iter()
            .filter_map(|e| seen(e.record.tick).map(|r| (e.record, *r)));
        assert!(compared.inspect(|(a, b)| assert_eq!(a, b)).count() > 3000);

        // A fault: the tissue thread is stopped for a while.
        drop(StoppedThread::stop(core.id(), "tissue"));
        let stopped = StoppedThread::stop(core.id(), "tissue");
        assert!(hand.watch_until(Duration::from_secs(3), |link| {
            link.state().is_some_and(|s| s.fault != 0)
        }));
        drop(stopped);
        assert!(
            until(Duration::from_secs(5), || core.flights().len() == 2),
            "{:?}",
            core.flights()
        );
        let fault = core
            .flights()
            .into_iter()
            .find(|f| f.display().to_string().contains("-fault"))
            .expect("of the fault");
        let flight = assert_identical(&fault);
        let faults: Vec<u32> = flight
            .haptic
            .expect("recorded")
            .ticks
            .iter()
            .map(|e| e.record.fault)
            .collect();
        assert!(
            faults.first() == Some(&0) && faults.last() != Some(&0),
            "it shows the way into the fault"
        );

        // The end, with the force on.
        ask(&mut hand.link, &Request::Engage).expect("re-armed");
        hand.watch(Duration::from_secs(1));
        drop(hand);
        let folder = core.flights()[0].parent().expect("in a folder").to_owned();
        core.finish();
        let files = std::fs::read_dir(folder).expect("there").flatten().map(|f| f.path());
        let exit: Vec<PathBuf> = files
            .filter(|f| f.display().to_string().ends_with("-exit.flight"))
            .collect();
        assert_eq!(exit.len(), 1);
        let last = assert_identical(&exit[0])
            .haptic
            .expect("recorded")
            .ticks
            .pop()
            .expect("ticks");
        assert_eq!(last.record.force_on_hand_n, [0.0; 3], "the last tick leaves no force");
        what_was_changed_is_found(&requested, &exit[0]);
    });
}

/// With finite elements neither loop was repeated: no recording held the needle's line, nor an elastic body.
#[test]
fn a_needle_on_a_line_leaves_a_recording_that_repeats_bit_for_bit() {
    where_the_machine_runs(|| {
        repeats_on_a_line("fem");
    });
}

#[test]
fn so_does_one_in_chainmail() {
    where_the_machine_runs(|| {
        repeats_on_a_line("chainmail");
    });
}

fn repeats_on_a_line(tissue: &str) {
    let mut core = Core::start_with(&["--rt-if-allowed", "--tissue", tissue]);
    let mut hand = Insertion::begin(&mut core, 0.01);
    hand.watch(Duration::from_secs(3));
    ask(&mut hand.link, &Request::DropSeed { strand_pitch_m: None }).expect("dropped");
    // Longer than either tape: both begin with the needle in tissue.
    hand.go(0.02, 0.01);
    hand.watch(Duration::from_secs(9));
    let first = request(&core, &mut hand);
    // The next one begins with returned tapes.
    hand.go(0.005, 0.01);
    hand.watch(Duration::from_secs(2));
    let second = request(&core, &mut hand);
    assert_ne!(first, second);
    drop(hand);
    core.finish();
    assert_identical(&second);
    let flight = assert_identical(&first);
    let haptic = flight.haptic.as_ref().expect("recorded");
    let tissue = flight.tissue.as_ref().expect("recorded");
    println!(
        "{} lines; {} of {} ticks on one; {} tissue ticks",
        flight.lines.len(),
        haptic.ticks_on_line(),
        haptic.ticks.len(),
        tissue.ticks.len()
    );
    assert_eq!(haptic.ticks_on_line(), haptic.ticks.len());
    assert!(haptic.line_state.as_ref().is_some_and(|state| state.is_in_contact()));
    assert!(tissue.ticks.iter().any(|tick| tick.loads.is_any()) && !flight.lines.is_empty());
}

/// Each exercise is on the tapes: a stiff line, a lost device, a body moved with a needle in it.
#[test]
fn exercises_repeat_bit_for_bit() {
    where_the_machine_runs(|| {
        let mut core = Core::start_with(&["--rt-if-allowed", "--tissue", "fem"]);
        let mut link = core.host();
        ask(
            &mut link,
            &Request::BeginExercise(Exercise::StiffTissue { factor: 2.5 }),
        )
        .expect("taken");
        drop(link);
        let mut hand = Insertion::begin(&mut core, 0.015);
        hand.watch(Duration::from_secs(3));
        let moved = Exercise::BodyMoved {
            by_m: [0.002, 0.0, -0.001],
        };
        ask(&mut hand.link, &Request::BeginExercise(moved)).expect("taken");
        ask(&mut hand.link, &Request::DropSeed { strand_pitch_m: None }).expect("dropped");
        hand.watch(Duration::from_secs(1));
        let before = request(&core, &mut hand);
        ask(&mut hand.link, &Request::BeginExercise(Exercise::DeviceLost)).expect("taken");
        assert!(hand.watch_until(Duration::from_secs(3), |link| {
            link.state().is_some_and(|s| s.fault != 0)
        }));
        hand.watch(Duration::from_millis(500));
        ask(&mut hand.link, &Request::EndExercises).expect("taken");
        ask(&mut hand.link, &Request::Engage).expect("re-armed");
        hand.watch(Duration::from_secs(2));
        let after = request(&core, &mut hand);
        drop(hand);
        core.finish();
        for file in [before, after] {
            let flight = assert_identical(&file);
            let haptic = flight.haptic.as_ref().expect("recorded");
            let has = |is: fn(&HapticOrder) -> bool| haptic.orders.iter().any(|(_, order)| is(order));
            let was_moved = haptic.memory.put_in.body_moved_m.norm() > 0.0;
            assert!(was_moved || has(|order| matches!(order, HapticOrder::MoveBody { .. })));
            assert!(
                flight.lines.iter().any(|line| line.stiffness() == 2.5),
                "a line of stiff tissue"
            );
        }
    });
}

/// One altered bit of one input changes the outcome, and the comparison detects it; a damaged file is refused.
fn what_was_changed_is_found(flight: &Flight, file: &Path) {
    let mut other = flight.clone();
    let haptic = other.haptic.as_mut().expect("recorded");
    let sample = haptic.ticks[2000].answer.read.as_mut().expect("a sample");
    sample.tip_in_world.z = f64::from_bits(sample.tip_in_world.z.to_bits() ^ 1);
    let found = repeat::haptic(&other, other.haptic.as_ref().expect("recorded")).expect("can be run");
    assert!(
        found.first_different == Some(2000) && !found.is_identical(),
        "{found:?}"
    );

    let tissue = other.tissue.as_mut().expect("recorded");
    // The last one: the next would hold the element again.
    let late = tissue.ticks.len() - 1;
    tissue.ticks[late].pose.held_travel_m.z += 1e-4;
    let recorded = other.tissue.as_ref().expect("recorded");
    let found = repeat::tissue(&other, recorded, LinesAgain::default()).expect("can be run");
    assert!(found.different > 0 && found.different_positions > 0, "{found:?}");

    let mut bytes = std::fs::read(file).expect("there");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let damaged = file.with_extension("damaged");
    std::fs::write(&damaged, &bytes).expect("written");
    let output = replay(&damaged);
    assert!(!output.status.success() && String::from_utf8_lossy(&output.stderr).contains("damaged"));
    std::fs::write(&damaged, &bytes[..20]).expect("written");
    assert!(!replay(&damaged).status.success());
}
