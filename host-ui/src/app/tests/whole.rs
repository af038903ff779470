//! Every state of the window in all its sizes, with the longest possible texts.

use super::class::{inject_exercises, line_to_a_core, trainees, whole_class};
use super::fixture::{Drawn, LONG_PATH, dose, live, long_named_labels, many_needles, one_needle, proposals};
use super::text::misplaced;
use super::update::{deciding, drawing, searching};
use crate::action::Action;
use crate::app::App;
use crate::app::layout::Narrow;
use crate::panel::question::Question;
use crate::panel::workflow::Progress;
use crate::planner::JobProgress;
use crate::settings::Layout;
use crate::shown::{LoadState, Note, Shown, Watched};
use crate::view::state::Tool;
use bytemuck::Zeroable;
use stylet_host::link::{LinkStatus, TimeMark};
use stylet_procedure::{Step, Waiting, WaitsFor};
use stylet_shm_schema::{EventKind, Fault, Request, SecondState, Text, TickRecord, flags};
use stylet_shm_schema::{LeftNeedlePose, MAX_LEFT_NEEDLES};

pub type State = (&'static str, fn(&mut App));

pub const STATES: &[State] = &[
    ("absent", |app| {
        app.shown.status = LinkStatus::Absent {
            why: format!(
                "an rt-core of another version is running (schema 6, this program has 7): start the one beside {LONG_PATH}"
            ),
        };
    }),
    ("silent", |app| {
        app.shown = live();
        app.shown.status = LinkStatus::Silent {
            since: std::time::Duration::from_secs(12_345),
        };
    }),
    ("every banner", |app| {
        app.shown = live();
        every_banner(&mut app.shown);
    }),
    ("no line, folded, force waits", |app| {
        app.shown = without_line(flags::WAITING | flags::FOLDED);
        if let Some(state) = &mut app.shown.state {
            (state.lag_ns, state.lag_m, state.folded_from_m) = (1_234_000_000, 12.3e-3, 12.3e-3);
        }
    }),
    ("no line, by the law of the paper", |app| app.shown = without_line(0)),
    ("over a relay", |app| {
        app.shown = one_needle(0.03, 2);
        app.shown.relayed = Some(line_to_a_core(true));
    }),
    ("who is there", |app| {
        app.shown = one_needle(0.03, 2);
        app.shown.relayed = Some(line_to_a_core(true));
        app.shown.class = Some(whole_class());
        app.class = true;
    }),
    ("a class beside the core", |app| {
        app.shown = one_needle(0.03, 2);
        app.shown.class = Some(stylet_shm_schema::Class {
            is_beside_core: 1,
            local_operates: 1,
            ..whole_class()
        });
        app.class = true;
    }),
    ("instructor with every exercise", |app| {
        app.shown = one_needle(0.03, 2);
        inject_exercises(app);
        app.instructor.toggle();
    }),
    ("list of trainees", |app| {
        app.shown = one_needle(0.03, 2);
        inject_exercises(app);
        trainees(app);
    }),
    ("over a relay that is not heard", |app| {
        app.shown = one_needle(0.03, 2);
        app.shown.relayed = Some(line_to_a_core(false));
        app.shown.status = LinkStatus::Silent {
            since: std::time::Duration::from_secs(12_345),
        };
    }),
    ("second device is lost", |app| {
        app.shown = one_needle(0.03, 2);
        second_device(&mut app.shown, Fault::DeviceNotCalibrated);
    }),
    ("second device stands still", |app| {
        app.shown = one_needle(0.03, 2);
        second_device(&mut app.shown, Fault::None);
        if let Some(state) = &mut app.shown.state {
            state.time_ns = 10_000_000_000;
        }
    }),
    ("recording", |app| recorded(app, one_needle(0.03, 2), false)),
    ("recording with the guide", |app| {
        recorded(app, one_needle(0.03, 2), false);
        app.workflow.guide.open = true;
    }),
    ("recording at its end", |app| recorded(app, one_needle(0.0, 5), true)),
    ("scene", |app| app.shown = live()),
    ("core in this process", |app| {
        app.shown = live();
        app.shown.is_stepped = true;
    }),
    ("file is read", |app| {
        app.shown = live();
        app.shown.load = LoadState::Reading(format!("{LONG_PATH}: resampling to the lattice"), 0.4);
        app.workflow.scene_path = LONG_PATH.to_owned();
    }),
    ("file is refused", |app| {
        app.shown = live();
        app.shown.load = LoadState::Refused(format!("{LONG_PATH}: it is no volume, no scene and no DICOM file"));
        app.shown.note = Some(Note {
            refused: true,
            text: format!("Debrief not saved: {LONG_PATH}/debrief.html: permission denied; choose another folder"),
        });
    }),
    ("structures of a file", |app| {
        app.shown = live();
        app.files.structures = Some(long_named_labels());
    }),
    ("parameters", |app| {
        app.shown = live();
        app.parameters.open = true;
    }),
    ("help", |app| {
        app.shown = live();
        app.help = true;
    }),
    ("guide without a core", |app| app.workflow.guide.open = true),
    ("guide through the plan", |app| guided(app, live())),
    ("guide to the entry", |app| guided(app, one_needle(-0.05, 0))),
    ("guide through a membrane", |app| {
        let mut shown = one_needle(0.01, 0);
        if let Some(state) = &mut shown.state {
            state.flags = flags::REAL_TIME | flags::IN_CONTACT;
            state.puncture_depth_m = 0.2;
        }
        guided(app, shown);
    }),
    ("guide after a reset", |app| {
        let mut shown = one_needle(0.03, 0);
        shown.is_free_inside = true;
        guided(app, shown);
    }),
    ("guide on the way in", |app| guided(app, one_needle(0.03, 0))),
    ("guide at a drop", |app| guided(app, one_needle(0.07, 1))),
    ("guide out", |app| guided(app, one_needle(0.03, 5))),
    ("guide at the end", |app| {
        guided(app, one_needle(0.0, 5));
        app.shown.dose = Some(dose(5));
    }),
    ("question before a reset", |app| {
        app.shown = one_needle(0.0, 5);
        app.question = Some(Question::Remove("Reset", Box::new(Action::Send(Request::Reset))));
    }),
    ("planned", |app| app.shown = one_needle(0.0, 0)),
    ("inserting", |app| app.shown = one_needle(0.03, 0)),
    ("dropping", |app| {
        app.shown = one_needle(0.06, 2);
        app.shown.dose = Some(dose(2));
    }),
    ("needles that stay in, at a drop", |app| {
        app.shown = one_needle(0.06, 2);
        stay_in(&mut app.shown);
    }),
    ("needles that stay in, at the end", |app| {
        app.shown = one_needle(0.0, 5);
        app.shown.dose = Some(dose(5));
        stay_in(&mut app.shown);
    }),
    ("debrief", |app| {
        app.shown = one_needle(0.0, 5);
        app.shown.dose = Some(dose(5));
    }),
    ("plan of many needles", |app| app.shown = many_needles(24, 0)),
    ("proposals of a plan", |app| {
        app.shown = many_needles(24, 0);
        let plan = app.shown.planning.implant.as_ref().map(|implant| implant.plan.clone());
        app.shown.planning.proposals = plan.map(|plan| proposals(&plan));
    }),
    ("plan is made", |app| {
        app.shown = many_needles(24, 0);
        app.workflow.plan.path = LONG_PATH.to_owned();
        every_banner(&mut app.shown);
    }),
    ("plan is compensated", |app| {
        app.shown = many_needles(24, 0);
        app.shown.planning.job = Some(JobProgress {
            what: "Rehearsing needle 12 (M13), 12 of 24; about 1 h 12 min left".to_owned(),
            share: Some(0.45),
        });
    }),
    ("needle 2 of 19", |app| {
        app.shown = many_needles(19, 2);
        running(&mut app.shown, None);
    }),
    ("needle 2 of 19 waits", |app| {
        app.shown = many_needles(19, 2);
        let waits_for = WaitsFor::Tip { off_along_m: -0.1234 };
        running(
            &mut app.shown,
            Some(Waiting {
                waits_for,
                for_s: 1234.0,
            }),
        );
    }),
    ("instruments in a narrow window", |app| {
        app.shown = one_needle(0.03, 2);
        app.narrow = Narrow::Right;
    }),
    ("needles in a narrow window", |app| {
        app.shown = many_needles(24, 0);
        app.narrow = Narrow::Right;
    }),
    ("picture of the probe", |app| {
        app.shown = one_needle(0.03, 2);
        app.settings.layout = Layout::Probe;
    }),
    ("fluoroscopy", |app| {
        app.shown = one_needle(0.03, 2);
        app.settings.layout = Layout::Fluoroscopy;
    }),
    ("gland is contoured", |app| drawing(app, Tool::Contour)),
    ("seeds are marked", |app| drawing(app, Tool::Seeds)),
    ("needles that are left are planned", searching),
    ("update of the plan", deciding),
    ("goes on at needle 2 of 19", |app| {
        app.shown = many_needles(19, 2);
        app.shown.continues_at = Some((1, 19));
    }),
];

/// Shows a recording instead of a core.
fn recorded(app: &mut App, shown: Shown, has_ended: bool) {
    app.shown = shown;
    app.shown.running = true;
    app.shown.watched = Some(Watched {
        name: LONG_PATH.to_owned(),
        at_s: 123.4,
        length_s: 1234.5,
        is_held: !has_ended,
        has_ended,
        speed: 0.25,
        marks: [
            (100.0, EventKind::Puncture),
            (600.0, EventKind::SeedDropped),
            (900.0, EventKind::FaultRaised),
        ]
        .map(|(at_s, kind)| TimeMark { at_s, kind })
        .into(),
    });
}

/// Shows the guide, after a membrane gave way.
fn guided(app: &mut App, shown: Shown) {
    app.shown = shown;
    app.workflow.guide.open = true;
    let tick = |depth_m, flags| {
        let mut record = TickRecord::zeroed();
        (record.depth_m, record.flags, record.force_on_hand_n) = (depth_m, flags, [0.0, 0.0, -12.345]);
        record
    };
    app.workflow.guide.membranes.take(&[
        tick(0.0123, flags::IN_CONTACT),
        tick(0.0123, flags::IN_CONTACT | flags::PUNCTURED),
    ]);
}

fn running(shown: &mut Shown, waits: Option<Waiting>) {
    (shown.running, shown.run_step, shown.run_needle) = (true, Some(Step::Place), Some((1, 19)));
    shown.run_waits = waits;
}

/// Leaves as many needles in the tissue as are allowed.
fn stay_in(shown: &mut Shown) {
    shown.left = vec![LeftNeedlePose::zeroed(); MAX_LEFT_NEEDLES];
}

/// Returns a needle in tissue that was not prepared for it.
fn without_line(more: u32) -> Shown {
    let mut shown = one_needle(0.03, 2);
    if let Some(state) = &mut shown.state {
        state.flags = flags::REAL_TIME | flags::ENGAGED | flags::IN_CONTACT | flags::LINE_NEEDED | more;
    }
    shown
}

fn second_device(shown: &mut Shown, fault: Fault) {
    let mut second = SecondState::zeroed();
    (second.tick, second.fault, second.world_from_tool) = (1, fault as u32, [0.0, 0.0, 0.0, 1.0]);
    second.tip_in_scene_m = [0.05, 0.02, 0.0];
    shown.second = Some(second);
    if let Some(session) = &mut shown.session {
        session.second_period_ns = 1_000_000;
        session.second_device = Text::new("Geomagic Touch X, serial number 12345678901234567890, firmware 2");
    }
}

fn every_banner(shown: &mut Shown) {
    if let Some(state) = &mut shown.state {
        (state.fault, state.flags) = (Fault::DeviceSilent as u32, 0);
    }
    if let Some(session) = &mut shown.session {
        session.advice =
            Text::new(&"allow rtprio for this user in /etc/security/limits.d and log in again\n".repeat(9));
    }
    (shown.refusals, shown.last_refusal) = (12_345, "needle.puncture_depth = 1000 mm\n".repeat(8));
    shown.disconnected = Some("3Dconnexion SpaceMouse Pro Wireless (cabled), with a long name".to_owned());
    shown.controllers.denied = vec![format!(
        "/dev/input/event17 cannot be read; run: sudo usermod -aG input $USER, {LONG_PATH}"
    )];
}

/// Asserts that nothing is clipped. Guards against "Stop" and "done" buttons that were cut off
/// while many needles ran.
fn assert_in_place(pixels: [f32; 2], scales: &[f32]) {
    let mut problems = Vec::new();
    for scale in scales {
        for (name, make) in STATES {
            let mut drawn = Drawn::new(pixels, *scale);
            make(&mut drawn.app);
            let at = format!("{name}, {} x {}, {} %", pixels[0], pixels[1], scale * 100.0);
            problems.extend(
                misplaced(&mut drawn)
                    .into_iter()
                    .map(|problem| format!("{at}: {problem}")),
            );
        }
    }
    assert!(
        problems.is_empty(),
        "{} problems:\n{}",
        problems.len(),
        problems.join("\n")
    );
}

/// Tests the smallest window.
#[test]
fn no_text_is_clipped_or_overlaps_at_960_x_600() {
    assert_in_place([960.0, 600.0], &[1.0, 1.5]);
}

#[test]
fn no_text_is_clipped_or_overlaps_at_1280_x_720() {
    assert_in_place([1280.0, 720.0], &[1.0, 1.5, 2.0]);
}

/// Tests one scale; larger ones leave as few points as 1280 x 720.
#[test]
fn no_text_is_clipped_or_overlaps_at_1366_x_768() {
    assert_in_place([1366.0, 768.0], &[1.0]);
}

/// Tests scales whose points include those of 1280 x 720, at 150 %.
#[test]
fn no_text_is_clipped_or_overlaps_at_1920_x_1080() {
    assert_in_place([1920.0, 1080.0], &[1.0, 2.0]);
}

/// Tests scales whose points include those of 1920 x 1080, at 200 %.
#[test]
fn no_text_is_clipped_or_overlaps_at_3840_x_2160() {
    assert_in_place([3840.0, 2160.0], &[1.0, 1.5]);
}

/// Tests steps that are opened by hand.
#[test]
fn no_text_is_clipped_in_a_step_opened_by_hand() {
    let mut problems = Vec::new();
    for (pixels, scale) in [([1280.0, 720.0], 1.0), ([1280.0, 720.0], 2.0)] {
        for step in Progress::ALL {
            for make in [|| many_needles(24, 1), || one_needle(0.03, 3)] {
                let mut drawn = Drawn::new(pixels, scale);
                drawn.app.shown = make();
                drawn.frame();
                drawn.app.workflow.open_by_hand(step);
                let found = misplaced(&mut drawn);
                let at = format!("{}, {} x {}, {} %", step.name(), pixels[0], pixels[1], scale * 100.0);
                problems.extend(found.into_iter().map(|problem| format!("{at}: {problem}")));
            }
        }
    }
    assert!(
        problems.is_empty(),
        "{} problems:\n{}",
        problems.len(),
        problems.join("\n")
    );
}
