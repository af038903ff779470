//! Windows that end, hang or lose their readers while they move the hand, by a script or by a gamepad: the counterpart
//! of `motion_sender` for programs without a window.

use crate::driven::{Driven, window_on};
use crate::plugged::Table as Plugs;
use egui_kittest::kittest::Queryable;
use evdev::AbsoluteAxisCode;
use std::process::Command;
use std::time::Duration;
use stylet_controllers::{Controllers, Kind};
use stylet_shm_schema::{Instance, flags};
use stylet_tests::pointer::Pointer;
use stylet_tests::sender::{Place, Sender, Table, kinds, trial};
use stylet_tests::stage::Stage;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Display, program, repeats, until};

const SIZE: [f32; 2] = [1280.0, 800.0];
const RUN: &str = "Run steps 2 to 6";
const BEGINS_WITHIN: Duration = Duration::from_secs(40);
/// Marks a test process as the window of this instance, with the stick pushed by this much.
const INSTANCE: &str = "SENDERS_INSTANCE";
const STICK: &str = "SENDERS_STICK";

/// Position of the window's button for a run; the same in the real one.
fn run_button() -> [f32; 2] {
    let driven = Driven::open_plain(SIZE);
    let middle = driven.window.get_by_label(RUN).rect().center();
    [middle.x, middle.y]
}

fn window(stage: &Stage, display: &Display) -> Command {
    let mut command = Command::new(program("host-ui"));
    command.args([
        "--instance",
        stage.core.instance.name(),
        "--no-controllers",
        "--count-frames",
    ]);
    command.env("DISPLAY", display.name()).env_remove("WAYLAND_DISPLAY");
    command
}

/// Clicks until the hand moves.
fn begin_run(stage: &mut Stage, pointer: &mut Pointer, button: [f32; 2]) {
    let moves = |stage: &mut Stage, limit| {
        until(limit, || {
            stage.observer.poll();
            // The motion by which the needle was drawn out is at its goal.
            let state = stage.observer.state();
            state.is_some_and(|s| s.flags & (flags::IN_MOTION | flags::AT_GOAL) == flags::IN_MOTION)
        })
    };
    let begins = (0..10).any(|_| {
        moves(stage, Duration::from_secs(3)) || {
            pointer.click(button);
            false
        }
    });
    assert!(begins, "the button for a run is not where it should be: {button:?}");
}

#[test]
#[ignore = "a window of slow frames promises its hand for too long"]
fn a_hand_whose_window_ends_or_hangs_is_at_rest_within_5_mm_and_400_ticks() {
    let button = run_button();
    where_the_machine_runs(|| {
        let mut stage = Stage::open();
        let display = Display::open();
        let mut pointer = Pointer::of(&display);
        let mut table = Table::begin("window");
        for (place, ending) in kinds() {
            let seen: Vec<_> = (0..repeats("SENDERS_TRIALS", 1))
                .map(|_| {
                    stage.draw_out();
                    let mut sender = Sender::start(window(&stage, &display), ending);
                    begin_run(&mut stage, &mut pointer, button);
                    let after = Duration::from_secs_f64(0.25 * stage.random.unit());
                    trial(&mut stage.observer, &mut sender, (place, ending), after, BEGINS_WITHIN)
                })
                .collect();
            table.row((place, ending), &seen);
        }
        stage.close();
        table.end();
    });
}

#[test]
#[ignore = "a window of slow frames promises its hand for too long"]
fn a_hand_rests_within_5_mm_and_400_ticks_of_its_gamepad_windows_end() {
    where_the_machine_runs(|| {
        let mut stage = Stage::open();
        let mut table = Table::begin("gamepad");
        for (place, ending) in kinds() {
            let seen: Vec<_> = (0..repeats("SENDERS_TRIALS", 1))
                .map(|_| {
                    stage.draw_out();
                    stage.go_to_entry();
                    let mut sender = Sender::start(with_gamepad(&stage, place), ending);
                    let after = Duration::from_secs_f64(0.15 * stage.random.unit());
                    trial(&mut stage.observer, &mut sender, (place, ending), after, BEGINS_WITHIN)
                })
                .collect();
            table.row((place, ending), &seen);
        }
        stage.close();
        table.end();
    });
}

fn with_gamepad(stage: &Stage, place: Place) -> Command {
    let mut command = Command::new(std::env::current_exe().expect("a test knows its own file"));
    command.args([
        "--exact",
        "--ignored",
        "--nocapture",
        "senders::window_with_a_stick_that_is_pushed",
    ]);
    command.env(INSTANCE, stage.core.instance.name());
    // Away is in.
    command.env(STICK, if place == Place::Air { "1" } else { "-1" });
    command
}

#[test]
#[ignore = "the program that the gamepad's trials end"]
fn window_with_a_stick_that_is_pushed() {
    let (Ok(instance), Ok(stick)) = (std::env::var(INSTANCE), std::env::var(STICK)) else {
        return;
    };
    let instance = Instance::new(&instance).expect("a name");
    let mut window = window_on(&instance, SIZE);
    let plugs = Plugs::default();
    window.state_mut().use_controllers(Controllers::start(plugs.clone()));
    plugs.plug(Kind::Gamepad);
    let mut pushes = false;
    // Until it is ended.
    loop {
        window.run_steps(1);
        if !pushes && window.query_by_label("Test gamepad").is_some() && window.state().link().plan().is_some() {
            pushes = true;
            plugs.axis(AbsoluteAxisCode::ABS_Y, stick.parse().expect("a share"));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}
