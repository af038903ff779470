//! Two hands in one procedure, as whole processes: both are visible and movable, and each may fail without the other.

use fake_haply::{Server, Service, Wrong};
use nalgebra::Vector3;
use std::time::Duration;
use stylet_host::link::Link;
use stylet_shm_schema::{EventKind, Fault, HandMove, ProbeMove, RefusalCode, Request, flags};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, until};

const LONG: Duration = Duration::from_secs(20);

/// The host is dropped before its core.
struct Rig {
    link: Link,
    core: Core,
}

impl Rig {
    fn start(options: &[&str]) -> Self {
        let mut core = Core::start_with(&[&["--rt-if-allowed"], options].concat());
        let link = core.host();
        let mut rig = Self { link, core };
        assert!(rig.waits_for(|link| {
            let second = link.second_state().is_some_and(|s| s.tick > 10);
            second && link.state().is_some_and(|s| s.tick > 10)
        }));
        rig
    }

    fn waits_for(&mut self, ready: impl Fn(&Link) -> bool) -> bool {
        let link = &mut self.link;
        until(LONG, || {
            link.poll();
            ready(link)
        })
    }

    fn engage(&mut self) {
        let mut armed = false;
        let link = &mut self.link;
        let engaged = until(LONG, || {
            armed |= ask(link, &Request::Engage).is_ok();
            link.poll();
            is_on(link, flags::ENGAGED) == [true; 2]
        });
        assert!(engaged, "{armed} {:?}", faults(&self.link));
    }
}

/// Returns a flag of the needle's hand and of the other hand.
fn is_on(link: &Link, flag: u32) -> [bool; 2] {
    [
        link.state().is_some_and(|s| s.flags & flag != 0),
        link.second_state().is_some_and(|s| s.flags & flag != 0),
    ]
}

fn faults(link: &Link) -> [Fault; 2] {
    let numbers = [
        link.state().expect("live").fault,
        link.second_state().expect("a second device").fault,
    ];
    numbers.map(|number| Fault::from_number(number).expect("a known fault"))
}

fn has_event(link: &Link, kind: EventKind) -> bool {
    link.events().iter().any(|e| e.kind == kind as u32)
}

#[test]
fn both_hands_are_seen_and_each_goes_where_it_is_asked_to() {
    where_the_machine_runs(|| {
        let mut rig = Rig::start(&["--device-2", "simulated", "--scene", "pelvis"]);
        let session = *rig.link.session().expect("live");
        assert!(session.second_device.read().starts_with("simulated") && session.second_period_ns == 1_000_000);
        let needle = rig.link.state().expect("live").tip_in_scene_m;
        let before = Vector3::from(rig.link.second_state().expect("seen").tip_in_scene_m);
        assert!(
            (before - Vector3::from(needle)).norm() > 0.02,
            "the other hand begins below the rectum"
        );
        let goal = before + Vector3::new(0.004, -0.003, 0.02);
        let hand = HandMove {
            tip_m: goal.into(),
            direction: [0.0, 0.0, 1.0],
            speed_m_per_s: 0.05,
            acceleration_m_per_s2: 2.0,
        };
        let up = Some([-0.6, 0.8, 0.0]);
        ask(&mut rig.link, &Request::MoveSecondHand(ProbeMove { hand, up })).expect("carried out");
        assert!(rig.waits_for(|link| is_on(link, flags::AT_GOAL)[1]));
        let there = Vector3::from(rig.link.second_state().expect("seen").tip_in_scene_m);
        assert!((there - goal).norm() < 5e-4, "{there} {goal}");
        // Rotated about its axis by atan2(0.6, 0.8), whichever of both came first.
        let turned = |link: &Link| link.second_state().expect("seen").world_from_tool;
        let half = 0.6_f64.atan2(0.8) / 2.0;
        assert!(
            rig.waits_for(|link| (turned(link)[2] - half.sin()).abs() < 1e-3),
            "{:?}",
            turned(&rig.link)
        );
        let records = rig.link.take_second_records();
        let numbers: Vec<_> = records.iter().map(|r| r.tick).collect();
        assert!(
            numbers.len() > 100 && numbers.windows(2).all(|w| w[1] == w[0] + 1),
            "every tick, once"
        );
        assert_eq!(
            rig.link.state().expect("live").tip_in_scene_m,
            needle,
            "the needle's hand stays"
        );
        drop(rig.link);
        let report = rig.core.finish();
        assert!(report["second"]["ticks"].as_u64().expect("a count") > 100, "{report:#}");
    });
}

/// The whole path: the hand's goal, its loop, the contact in the tissue loop, the snapshot for a window, and the
/// returning force.
#[test]
fn a_pressed_probe_is_felt_and_moves_the_gland_until_withdrawn() {
    where_the_machine_runs(|| {
        let mut rig = Rig::start(&["--device-2", "simulated", "--scene", "pelvis"]);
        rig.engage();
        let scene = rig.link.scene().expect("live").header;
        let outside = Vector3::from(rig.link.second_state().expect("seen").tip_in_scene_m);
        let gland_m = (scene.target_lower_m[2] + scene.target_upper_m[2]) / 2.0;
        let within = Vector3::new(outside.x, outside.y, gland_m + 35e-3);
        let bring = |rig: &mut Rig, to: Vector3<f64>| {
            let hand = HandMove {
                tip_m: to.into(),
                direction: [0.0, 0.0, 1.0],
                speed_m_per_s: 0.04,
                acceleration_m_per_s2: 1.0,
            };
            ask(&mut rig.link, &Request::MoveSecondHand(ProbeMove { hand, up: None })).expect("carried out");
            assert!(
                rig.waits_for(|link| is_on(link, flags::AT_GOAL)[1]),
                "{:?}",
                faults(&rig.link)
            );
        };
        let force_n = |link: &Link| Vector3::from(link.second_state().expect("seen").force_on_hand_n);
        let moved_m = |link: &Link| link.snapshot().map_or(0.0, |s| s.header.max_displacement_m);
        assert_eq!((force_n(&rig.link).norm(), moved_m(&rig.link)), (0.0, 0.0));
        bring(&mut rig, within);
        // The rectum is lower than the probe is thick: both walls move, and push against each other.
        assert!(rig.waits_for(|link| moved_m(link) > 1e-3), "{}", moved_m(&rig.link));
        let lies_n = force_n(&rig.link);
        bring(&mut rig, within + Vector3::new(0.0, 6e-3, 0.0));
        let is_pressed = |link: &Link| force_n(link).y < lies_n.y - 1.0 && force_n(link).y < -0.5;
        let (force, moved) = (force_n(&rig.link), moved_m(&rig.link));
        assert!(
            rig.waits_for(is_pressed),
            "{lies_n:?} lies, {force:?} pressed, {moved} m"
        );
        assert!((2e-3..20e-3).contains(&moved_m(&rig.link)), "{}", moved_m(&rig.link));
        assert_eq!(faults(&rig.link), [Fault::None; 2]);
        bring(&mut rig, within);
        bring(&mut rig, outside);
        assert!(
            rig.waits_for(|link| force_n(link).norm() < 1e-9 && moved_m(link) < 1e-6),
            "{} N, {} m remain",
            force_n(&rig.link).norm(),
            moved_m(&rig.link)
        );
        drop(rig.link);
        rig.core.finish();
    });
}

#[test]
fn a_run_without_a_second_device_refuses_to_move_one_and_says_what_to_do() {
    let mut core = Core::start_with(&["--rt-if-allowed"]);
    let mut link = core.host();
    let refusal = ask(&mut link, &Request::StopSecondHand).expect_err("there is none");
    assert!(
        refusal.contains("--device-2"),
        "{refusal} {:?}",
        RefusalCode::NoSecondDevice
    );
    assert!(link.second_state().is_none() && !link.session().expect("live").has_second());
    drop(link);
    assert!(core.finish().get("second").is_none());
}

#[test]
fn the_second_device_is_lost_and_the_needle_goes_on() {
    where_the_machine_runs(|| {
        let service = Service::default();
        let server = Server::start(&service);
        let mut rig = Rig::start(&["--device-2", "haply", "--haply-url", &server.url()]);
        rig.engage();
        service.state().wrong = Wrong::Unplugged;
        assert!(rig.waits_for(|link| faults(link)[1] == Fault::DeviceLost));
        assert!(rig.waits_for(|link| is_on(link, flags::ENGAGED) == [true, false]));
        assert_eq!(faults(&rig.link)[0], Fault::None, "the needle's hand feels on");
        assert_eq!(rig.link.second_state().expect("seen").force_on_hand_n, [0.0; 3]);
        assert!(rig.waits_for(|link| has_event(link, EventKind::SecondFaultRaised)));
        assert!(!has_event(&rig.link, EventKind::FaultRaised));
        service.state().wrong = Wrong::Nothing;
        rig.engage();
        assert_eq!(faults(&rig.link), [Fault::None; 2]);
        drop(rig.link);
        rig.core.finish();
    });
}

#[test]
fn the_needle_is_lost_and_the_second_device_goes_on() {
    where_the_machine_runs(|| {
        let service = Service::default();
        let server = Server::start(&service);
        let options = [
            "--device",
            "haply",
            "--haply-url",
            &server.url(),
            "--device-2",
            "simulated",
        ];
        let mut rig = Rig::start(&options);
        rig.engage();
        service.state().wrong = Wrong::Unplugged;
        assert!(rig.waits_for(|link| is_on(link, flags::ENGAGED) == [false, true]));
        assert_eq!(faults(&rig.link), [Fault::DeviceLost, Fault::None]);
        assert!(!has_event(&rig.link, EventKind::SecondFaultRaised));
        drop(rig.link);
        rig.core.finish();
    });
}
