//! The banners over the pictures, and their texts.

use super::*;
use crate::panel::workflow::scene::solved_in;
use bytemuck::Zeroable;
use stylet_shm_schema::{HapticState, flags};

fn live() -> Shown {
    let mut shown = Shown::empty("lab");
    shown.status = LinkStatus::Live;
    let mut state = HapticState::zeroed();
    state.flags = flags::REAL_TIME | flags::ENGAGED;
    shown.state = Some(state);
    shown
}

#[test]
fn no_banner_without_a_problem_and_absence_has_one_remedy() {
    assert!(banners(&live()).is_empty());
    let list = banners(&Shown::empty("lab"));
    assert_eq!(list[0].remedy.as_ref().map(|(name, _)| *name), Some("Start it"));
    let mut absent = Shown::empty("lab");
    absent.status = LinkStatus::Absent {
        why: "no rt-core is running (instance \"lab\"). Start it in another terminal: rt-core --instance lab"
            .to_owned(),
    };
    assert!(
        !banners(&absent)[0].text.contains("terminal"),
        "{}",
        banners(&absent)[0].text
    );
    absent.reads_recording = true;
    assert!(banners(&absent)[0].text.contains("rt-core --instance lab"));
}

/// Guards against a core that ended without a reason, and placed seeds without a message.
#[test]
fn an_ended_core_is_reported_with_reason_and_kept_seeds() {
    let mut shown = live();
    shown.session = Some(stylet_shm_schema::Session::zeroed());
    shown.status = LinkStatus::Absent {
        why: "rt-core has stopped. Start it in another terminal: rt-core".to_owned(),
    };
    shown.last_fault = "the force loop has stopped".to_owned();
    shown.seeds = vec![stylet_shm_schema::SeedPose::zeroed(); 2];
    let text = &banners(&shown)[0].text;
    assert!(
        text.starts_with(
            "Its last fault: the force loop has stopped. The plan and 2 seeds remain on display. rt-core has stopped."
        ),
        "{text}"
    );
}

#[test]
fn a_force_that_is_off_or_waits_and_a_refusal_each_have_their_banner() {
    let titles = |shown: &Shown| banners(shown).iter().map(|b| b.title).collect::<Vec<_>>();
    let mut shown = live();
    if let Some(state) = &mut shown.state {
        state.flags |= flags::WAITING;
    }
    assert_eq!(titles(&shown), ["The force is held back"]);
    if let Some(state) = &mut shown.state {
        state.flags = flags::REAL_TIME;
    }
    shown.refusals = 2;
    shown.last_refusal = "needle.puncture_depth = 1000 mm".to_owned();
    assert_eq!(titles(&shown), ["The force is off", "Request refused"]);
    assert!(banners(&shown)[1].text.contains("puncture_depth"));
}

#[test]
fn a_run_that_is_not_real_time_keeps_its_badge_alone_on_request() {
    let mut shown = live();
    if let Some(state) = &mut shown.state {
        state.flags &= !flags::REAL_TIME;
    }
    let mut session = stylet_shm_schema::Session::zeroed();
    session.session_id = 7;
    shown.session = Some(session);
    let is_warned = |shown: &Shown| banners(shown).iter().any(|b| b.title == "Not real-time");
    assert!(is_warned(&shown));
    shown.reduced = Some(7);
    assert!(!is_warned(&shown));
    session.session_id = 8;
    shown.session = Some(session);
    assert!(is_warned(&shown), "another run");
}

#[test]
fn an_exercise_has_its_own_banner() {
    let mut shown = live();
    let mut session = stylet_shm_schema::Session::zeroed();
    session.exercises.put(Exercise::DeviceLost);
    session.exercises.put(Exercise::StiffTissue { factor: 2.0 });
    shown.session = Some(session);
    if let Some(state) = &mut shown.state {
        state.fault = Fault::DeviceLost as u32;
    }
    let list = banners(&shown);
    assert_eq!(
        list.iter().map(|b| b.title).collect::<Vec<_>>(),
        ["Fault: the force is off", "Exercise", "Exercise"]
    );
    assert!(
        list[2].text.starts_with("Tissue 2.0 times as stiff."),
        "{}",
        list[2].text
    );
}

#[test]
fn a_relay_banner_shows_trainee_operator_and_delay() {
    let mut shown = live();
    let mut line = stylet_shm_schema::Relayed {
        is_heard: 1,
        snapshot_age_ns: 34_000_000,
        round_trip_ns: 3_000_000,
        snapshots_lost: 7,
        server: stylet_shm_schema::Text::new("192.168.1.5:7461"),
        name: stylet_shm_schema::Text::new("Ina"),
        operator: stylet_shm_schema::Text::new("élodie"),
        role: stylet_shm_schema::Text::new("instructor"),
        ..stylet_shm_schema::Relayed::zeroed()
    };
    shown.relayed = Some(line);
    let list = banners(&shown);
    assert_eq!(
        list.iter().map(|b| b.text.as_str()).collect::<Vec<_>>(),
        [
            "Ina, instructor, at 192.168.1.5:7461. Élodie is operating. Shown 34 ms late, round trip 3 ms; 0 records and 7 snapshots lost."
        ]
    );
    line.operates = 1;
    shown.relayed = Some(line);
    assert!(banners(&shown)[0].text.contains("You are operating"));
    (line.is_heard, line.snapshot_age_ns) = (0, 2_500_000_000);
    shown.relayed = Some(line);
    shown.status = LinkStatus::Silent {
        since: std::time::Duration::from_secs(2),
    };
    let list = banners(&shown);
    assert_eq!(list.len(), 1, "one cause, one banner");
    assert!(list[0].text.contains("for 2.5 s"), "{}", list[0].text);
}

#[test]
fn folded_tissue_has_a_banner_while_folded() {
    let mut shown = live();
    if let Some(state) = &mut shown.state {
        state.folded_from_m = 7.93e-3;
    }
    // At the place of a membrane that gave way.
    assert!(banners(&shown).is_empty());
    if let Some(state) = &mut shown.state {
        state.flags |= stylet_shm_schema::flags::FOLDED;
    }
    let list = banners(&shown);
    assert_eq!(list.len(), 1);
    assert!(list[0].text.contains("folded beyond 7.9 mm"), "{}", list[0].text);
}

/// Checks that each row of docs/stability.md that says no names a warning which the window shows.
#[test]
fn unstable_cases_are_warned_of_while_they_last() {
    let page = include_str!("../../../../docs/stability.md");
    let not_met = page
        .lines()
        .filter(|line| line.starts_with("| ") && line.contains("**no**"));
    let mut numbers: Vec<u32> = not_met
        .map(|line| line[2..].split(' ').next().unwrap_or("").parse().expect("a number"))
        .collect();
    numbers.dedup();
    let texts = |shown: &Shown| {
        banners(shown)
            .into_iter()
            .map(|b| format!("{}: {}", b.title, b.text))
            .collect::<Vec<_>>()
    };
    for number in numbers {
        let mut shown = live();
        let state = shown.state.as_mut().expect("live");
        let wanted = match number {
            // Cells near the tip fold.
            3 | 5 | 14 => {
                (state.flags, state.folded_from_m) = (state.flags | flags::FOLDED, 4e-3);
                "Tissue folded: "
            }
            // The answer of finite elements off their line follows some ticks later.
            7 => {
                state.flags |= flags::LINE_NEEDED | flags::IN_CONTACT;
                (state.lag_ns, state.lag_m) = (15_000_000, 1.5e-3);
                "No needle line: The tissue was not prepared for this needle, and its answer is 15 ms"
            }
            32 | 42 | 48 => {
                state.flags |= flags::LINE_NEEDED | flags::IN_CONTACT;
                "No needle line: "
            }
            // This one belongs to the scene, while it is loaded, and is not a banner.
            35 => {
                let mut scene = stylet_shm_schema::SceneHeader::zeroed();
                (scene.spacing_m, scene.body_edge) = (1.364e-3, 1);
                assert_eq!(solved_in(&scene), None);
                scene.body_edge = 2;
                let said = solved_in(&scene);
                assert_eq!(said.as_deref(), Some("Tissue solved in elements of 2.7 mm"));
                continue;
            }
            _ => panic!("row {number} of docs/stability.md is not met: what warns of it?"),
        };
        let list = texts(&shown);
        assert!(
            list.iter().any(|text| text.starts_with(wanted)),
            "row {number}: {list:?}"
        );
    }
    // A needle on its line, or outside, needs no warning.
    let mut shown = live();
    for flag in [
        flags::LINE_NEEDED,
        flags::LINE_NEEDED | flags::LINE_READY | flags::IN_CONTACT,
    ] {
        shown.state.as_mut().expect("live").flags = flags::REAL_TIME | flags::ENGAGED | flag;
        assert!(banners(&shown).is_empty());
    }
}

#[test]
fn controller_problems_are_shown_without_a_core_too() {
    for mut shown in [live(), Shown::empty("lab")] {
        let before = banners(&shown).len();
        shown.disconnected = Some("Pad".to_owned());
        shown
            .controllers
            .denied
            .push("Cap cannot be read. Run: that".to_owned());
        let list = banners(&shown);
        assert_eq!(list.len(), before + 2);
        assert!(list[before].text.contains("Pad. The needle stays where it is"));
        assert_eq!(list[before].remedy, Some(("Dismiss", Action::DismissDisconnected)));
        assert!(list[before + 1].text.contains("Run: that"));
    }
}

#[test]
fn fault_comes_first_and_an_unknown_one_is_a_fault() {
    let mut shown = live();
    if let Some(state) = &mut shown.state {
        (state.fault, state.flags) = (999, 0);
    }
    let list = banners(&shown);
    assert_eq!(list[0].level, BannerLevel::Bad);
    assert_eq!(list[1].title, "Not real-time");
}

#[test]
fn a_lost_second_device_has_its_own_banner() {
    let mut shown = live();
    let mut session = stylet_shm_schema::Session::zeroed();
    session.second_period_ns = 1_000_000;
    shown.session = Some(session);
    assert_eq!(banners(&shown).len(), 0, "nothing is known of it yet");
    let mut second = stylet_shm_schema::SecondState::zeroed();
    second.flags = flags::ENGAGED;
    shown.second = Some(second);
    assert_eq!(banners(&shown).len(), 0);
    second.fault = Fault::DeviceLost as u32;
    shown.second = Some(second);
    let list = banners(&shown);
    assert_eq!(list.len(), 1);
    assert!(
        list[0].title.contains("Second device") && list[0].text.contains("not connected"),
        "{list:?}"
    );
    assert_eq!(list[0].remedy.as_ref().map(|r| r.0), Some("Re-arm both"));
    // The needle's own device is healthy.
    second.fault = 0;
    shown.second = Some(second);
    if let Some(state) = &mut shown.state {
        state.time_ns = 1_000_000_000;
    }
    let list = banners(&shown);
    assert!(
        list.len() == 1 && list[0].text.contains("has stopped") && list[0].remedy.is_none(),
        "{list:?}"
    );
    // A run without a second device has no such banner.
    shown.session = None;
    assert!(banners(&shown).is_empty());
}

/// Checks that the title of a picture stays legible under banners. If they all but cover the
/// picture, titles stay in place.
#[test]
fn labels_of_a_picture_stand_below_banners() {
    use crate::view::free::free_of_banners;
    use std::cell::Cell;
    let pictures = Rect::from_min_size(egui::pos2(20.0, 30.0), egui::vec2(700.0, 400.0));
    let low = Rect::from_min_size(pictures.min, egui::vec2(300.0, 70.0));
    let beside = Rect::from_min_size(egui::pos2(20.0, 240.0), egui::vec2(300.0, 190.0));
    let (count, seen) = (Cell::new(0), Cell::new([0.0; 3]));
    let mut harness = egui_kittest::Harness::new_ui(|ui| {
        seen.set([pictures, low, beside].map(|rect| free_of_banners(ui.ctx(), rect).top()));
        let refused = banners(&Shown::empty("lab"));
        let list: Vec<Banner> = refused.iter().cycle().take(count.get()).cloned().collect();
        banners_ui(ui.ctx(), pictures, &list);
    });
    let mut tops = |banners: usize| {
        count.set(banners);
        harness.run_steps(3);
        seen.get()
    };
    assert_eq!(tops(0), [30.0, 30.0, 240.0]);
    let [one, lowest, other] = tops(1);
    assert!(one > 50.0 && one < 120.0, "{one}");
    assert_eq!((lowest, other), (30.0, 240.0));
    let [three, ..] = tops(3);
    assert!(three > one + 40.0, "{three} {one}");
    assert_eq!(tops(0), [30.0, 30.0, 240.0], "none any more");
}
