//! The window without a core: it says what to type, and its dialogs open.

use egui_kittest::kittest::Queryable;
use egui_kittest::{Harness, SnapshotOptions};
use host_ui::app::{App, Options};
use stylet_shm_schema::PARAMETERS;
use stylet_shm_schema::service::Instance;

fn window(instance: &str) -> Harness<'static, App> {
    let options = Options {
        instance: Instance::new(instance).expect("a valid name"),
        scene: None,
        label: None,
    };
    Harness::builder()
        .with_size([1280.0, 800.0])
        .wgpu()
        .build_eframe(|cc| App::new(cc, options))
}

/// Another version of the software driver may round a few edges otherwise; a moved or missing widget is thousands of pixels.
fn tolerant() -> SnapshotOptions {
    SnapshotOptions::new().max_failed_pixels(500)
}

/// The window asks for frames for ever, so `run` would never end.
fn settle(window: &mut Harness<'_, App>) {
    window.run_steps(5);
}

#[test]
fn without_a_core_the_window_says_what_to_type() {
    let mut window = window("ui-window-absent");
    settle(&mut window);
    window.get_by_label("rt-core is absent");
    window.get_by_label_contains("rt-core --instance ui-window-absent");
    assert!(
        window.query_by_label("The force is off").is_none(),
        "nothing is known of the force"
    );
    window.snapshot_options("window_absent", &tolerant());
}

#[test]
fn parameters_dialog_opens_and_lists_every_parameter() {
    let mut window = window("ui-window-parameters");
    settle(&mut window);
    window.get_by_label("Parameters").click();
    settle(&mut window);
    for parameter in &PARAMETERS {
        assert!(
            window.query_all_by_label(parameter.label).next().is_some(),
            "{} is not listed",
            parameter.label
        );
    }
    window.snapshot_options("window_parameters", &tolerant());
}
