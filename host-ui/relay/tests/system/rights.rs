//! No command passes without the right to it, and each refusal names the member and the request.

use crate::fixture::{Keys, Named, core, join, keep, until};
use crate::host::{Host, go, node, still_moving_m};
use std::time::Duration;
use stylet_ports as service;
use stylet_relay::keys::{Lab, Role, Validity};
use stylet_shm_schema::{EventKind, Exercise, Mark, Request};

fn marked() -> Request {
    Request::Mark(Mark {
        text: "left lobe".to_owned(),
        before_s: 0.0,
    })
}

fn hand_of(host: &mut Host) -> [f64; 3] {
    host.state().expect("seen").tip_in_scene_m
}

#[test]
fn an_observer_sees_and_moves_nothing_and_a_revoked_one_sees_no_longer() {
    let (near, far) = (Named::new(), Named::new());
    let _core = core(&near, &[]);
    let keys = Keys::new();
    let served = keys.serve(&near);
    let joined = join(&keys.invite("olga", Role::Observer, Validity::days(1)), &far);
    let mut host = Host::new(&far);
    assert!(host.sees_the_core(Duration::from_secs(10)), "{}", joined.log());
    let scene = host.scene.expect("seen");
    let before = hand_of(&mut host);
    for request in [
        go(&scene, 0.0, 0.1),
        Request::Engage,
        Request::StopHand,
        Request::Reset,
        Request::Shutdown,
        Request::BeginExercise(Exercise::DeviceLost),
        Request::EndExercises,
        marked(),
    ] {
        let refused = host.ask(&request).expect_err("an observer");
        assert!(refused.contains("observer"), "{refused}");
    }
    assert_eq!(hand_of(&mut host), before, "the hand has moved");
    let log = served.log();
    for kind in ["MoveHand", "Engage", "StopHand", "Reset", "Shutdown"] {
        let line = format!("refused: olga (observer, seat 1): {kind}");
        assert!(log.contains(&line), "{line} is missing in {log}");
    }

    keys.lab.revoke("olga").expect("known");
    assert!(joined.says("is not heard", Duration::from_secs(10)), "{}", served.log());
    host.taken.clear();
    std::thread::sleep(Duration::from_secs(2));
    host.poll();
    host.taken.clear();
    host.send(&Request::StopHand);
    std::thread::sleep(Duration::from_secs(1));
    host.poll();
    assert!(
        host.taken.is_empty(),
        "a revoked member sees {} records",
        host.taken.len()
    );
    let line = "refused: olga (observer, seat 1): to connect: the certificate is revoked";
    assert!(served.says(line, Duration::from_secs(10)), "{}", served.log());
}

#[test]
fn an_instructor_stops_the_hand_and_does_not_move_it() {
    let (near, far) = (Named::new(), Named::new());
    let _core = core(&near, &[]);
    let keys = Keys::new();
    let _served = keys.serve(&near);
    let joined = join(&keys.invite("ina", Role::Instructor, Validity::days(1)), &far);
    let (mut host, mut local) = (Host::new(&far), Host::new(&near));
    assert!(host.sees_the_core(Duration::from_secs(10)), "{}", joined.log());
    assert!(local.sees_the_core(Duration::from_secs(10)));
    let scene = local.scene.expect("seen");
    local.ask(&go(&scene, 0.0, 0.005)).expect("a hand beside the core");
    assert!(
        until(Duration::from_secs(5), || still_moving_m(&mut local) > 1e-4),
        "the hand is on its way"
    );
    assert!(
        host.ask(&go(&scene, 0.01, 0.1))
            .expect_err("an instructor")
            .contains("instructor")
    );
    host.ask(&Request::StopHand).expect("allowed");
    assert!(
        until(Duration::from_secs(3), || still_moving_m(&mut local) < 1e-6),
        "the hand goes on"
    );
    host.ask(&Request::SetPlan(None)).expect("allowed");
    // A fault is injected and removed, and a mark is made: the events return to the requesting host.
    host.ask(&Request::BeginExercise(Exercise::DeviceLost))
        .expect("allowed");
    let lost = |host: &mut Host| {
        host.state()
            .is_some_and(|s| s.fault == stylet_shm_schema::Fault::DeviceLost as u32)
    };
    assert!(until(Duration::from_secs(3), || lost(&mut local)), "no fault");
    host.ask(&Request::EndExercises).expect("allowed");
    local.ask(&Request::Engage).expect("beside the core");
    assert!(until(Duration::from_secs(3), || !lost(&mut local)), "still lost");
    host.ask(&marked()).expect("allowed");
}

/// The trainee operates, and cannot inject or remove the fault to be found.
#[test]
fn an_operator_marks_and_puts_no_fault_in() {
    let (near, far) = (Named::new(), Named::new());
    let _core = core(&near, &[]);
    let keys = Keys::new();
    let _served = keys.serve(&near);
    let joined = join(&keys.invite("otto", Role::Operator, Validity::days(1)), &far);
    let mut host = Host::new(&far);
    assert!(host.sees_the_core(Duration::from_secs(10)), "{}", joined.log());
    for request in [
        Request::BeginExercise(Exercise::StiffTissue { factor: 2.0 }),
        Request::EndExercises,
    ] {
        let refused = host.ask(&request).expect_err("an operator");
        assert!(refused.contains("operator"), "{refused}");
    }
    host.ask(&marked()).expect("allowed");
    let is_mark = |e: &stylet_shm_schema::Event| e.kind == EventKind::Mark as u32 && e.text.read() == "left lobe";
    let node = node(&far);
    let events = service::events::subscriber(&node).expect("a port");
    let came = until(Duration::from_secs(3), || {
        std::iter::from_fn(|| events.receive()).any(|e| is_mark(&e))
    });
    assert!(came, "the mark did not come back");
}

/// True if a member whose certificate is not accepted receives nothing and sends nothing.
fn is_shut_out(validity: Validity, of_another_lab: bool) -> String {
    let (near, far) = (Named::new(), Named::new());
    let core = core(&near, &[]);
    let keys = Keys::new();
    let served = keys.serve(&near);
    let path = keys.invite("eve", Role::Operator, validity);
    if of_another_lab {
        // The same names, signed by an authority that she made herself.
        let folder = keys.folder.join("of-eve");
        let own = Lab::new(&folder);
        own.make(&["127.0.0.1".to_owned()]).expect("made");
        let (mut forged, code) = own.invite("eve", Role::Operator, "127.0.0.1", validity).expect("made");
        let invitation = crate::fixture::invitation(&path);
        (forged.server, forged.authority) = (invitation.server, invitation.authority);
        keep(&path, &(forged, code));
    }
    let joined = join(&path, &far);
    let mut host = Host::new(&far);
    assert!(!host.sees_the_core(Duration::from_secs(4)), "{}", joined.log());
    let mut local = Host::new(&near);
    assert!(local.sees_the_core(Duration::from_secs(10)), "{}", core.log());
    let before = hand_of(&mut local);
    let scene = local.scene.expect("seen");
    // A member that never connected shows nothing here: hosts find no core.
    if host.has_ports() {
        host.send(&go(&scene, 0.0, 0.2));
    }
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(hand_of(&mut local), before, "the hand has moved");
    println!("{}", joined.log());
    let log = served.log();
    assert!(!log.contains("connected: "), "{log}");
    log
}

#[test]
fn an_expired_certificate_is_refused_and_logged() {
    let log = is_shut_out(Validity::ended(), false);
    println!("{log}");
    let line = "refused: eve (operator, seat 1): to connect: the certificate has expired";
    assert!(log.contains(line), "{log}");
}

#[test]
fn a_certificate_of_ones_own_is_refused_and_logged() {
    let log = is_shut_out(Validity::days(1), true);
    println!("{log}");
    assert!(log.contains("refused: a connection, in its handshake: "), "{log}");
}
