//! A segmentation without names, from the file to three proposals of a plan, by labels of the window alone.

use crate::driven::Driven;
use egui_kittest::kittest::Queryable;
use host_ui::app::App;
use std::path::Path;
use stylet_shm_schema::role;
use stylet_tests::scratch;

const DIMS: [usize; 3] = [50, 60, 50];

/// Writes a gland of 36 mm with its urethra, and a rectum behind it: labels 1 to 3, without names.
fn write_labels(path: &Path) {
    let mut labels = Vec::new();
    for n in 0..DIMS.iter().product::<usize>() {
        let at = [n % DIMS[0], n / DIMS[0] % DIMS[1], n / DIMS[0] / DIMS[1]];
        let [x, y, z] = [0, 1, 2].map(|a| at[a] as f64 - [25.0, 35.0, 25.0][a]);
        let is_rectum = x * x + (y + 26.0) * (y + 26.0) < 49.0 && z.abs() < 20.0;
        labels.push(match (x * x + y * y + z * z).sqrt() < 18.0 {
            true if x * x + y * y < 9.0 => 2,
            true => 1,
            false if is_rectum => 3,
            false => 0,
        });
    }
    let [x, y, z] = DIMS;
    let head = format!(
        "NRRD0004\ntype: uint8\ndimension: 3\nspace: right-anterior-superior\nsizes: {x} {y} {z}\nendian: little\n\
         space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: raw\n\n"
    );
    std::fs::write(path, [head.into_bytes(), labels].concat()).expect("written");
}

fn names(driven: &Driven) -> Vec<(String, u32)> {
    let scene = driven.window.state().link().scene().expect("live");
    let structures = scene.header.structures().iter();
    structures.map(|of| (of.name.read(), of.role)).collect()
}

#[test]
fn labels_without_names_become_a_scene_that_can_be_planned() {
    let mut driven = Driven::open_plain([1366.0, 768.0]);
    let folder = scratch("ui-own-data");
    let (path, scene_file) = (folder.join("gland.nrrd"), folder.join("gland.toml"));
    write_labels(&path);
    driven.click("1  Choose the scene");
    driven.type_into("elements", path.to_str().expect("words"));
    driven.click("Load scene…");
    driven.wait_for_label("Choose the target");
    driven.picture("own-data-labels");
    for (label, name) in [("1", "Prostate"), ("2", "Urethra"), ("3", "Rectum")] {
        driven.type_into(label, name);
    }
    driven.wait_for_label("These structures make a scene.");
    driven.click("Save scene file");
    driven.wait_for_label("Saved as");
    driven.picture("own-data-named");
    driven.click("Use these structures");
    driven.until("the scene", |app| {
        app.link().scene().is_some_and(|s| s.header.name.read() == "gland.nrrd")
    });
    let [target, spared] = [role::TARGET, role::SPARE];
    let expected = [("Prostate", target), ("Urethra", spared), ("Rectum", spared)];
    let expected = expected.map(|(name, role)| (name.to_owned(), role));
    assert_eq!(names(&driven), expected);
    driven.until("its outlines", |app| app.planner().planning().outlines.is_some());
    driven.window.run_steps(3);
    assert!(driven.window.query_by_label("Use these structures").is_none());
    driven.click("Automatic plan");
    driven.until("proposals", |app| app.planner().planning().proposals.is_some());
    driven.window.run_steps(3);
    driven.picture("own-data-planned");
    assert!(
        driven.window.query_all_by_label("met").count() >= 5,
        "limits of three structures"
    );

    // Another core gets the structures by their names.
    let run = |app: &App| app.link().session().map(|session| session.session_id);
    let first = run(driven.window.state());
    driven.core.kill_only();
    driven.wait_for_label("Start it again");
    driven.click("Start it again");
    driven.until("the scene under the other core", |app| {
        let scene = app.link().scene().filter(|scene| scene.header.structure_count == 3);
        run(app) != first && scene.is_some_and(|scene| Some(scene.header.session_id) == run(app))
    });
    assert_eq!(names(&driven), expected);

    // The file alone is enough the next time.
    let other = Driven::open_plain([1366.0, 768.0]);
    driven = other;
    driven.click("1  Choose the scene");
    driven.type_into("elements", scene_file.to_str().expect("words"));
    driven.click("Load scene…");
    driven.until("the scene", |app| {
        app.link().scene().is_some_and(|s| s.header.structure_count == 3)
    });
    assert_eq!(names(&driven), expected);
}
