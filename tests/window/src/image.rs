//! Greys of an image in the slices of the real window: their place, their motion with the tissue,
//! and their end.

use crate::driven::{Driven, misplaced};
use egui_kittest::kittest::{NodeT, Queryable};
use host_ui::app::App;
use host_ui::view::orientation::Orientation;
use nalgebra::{Rotation3, Vector3};
use std::io::Write;
use std::path::{Path, PathBuf};
use stylet_files::{Image, Progress};
use stylet_surfaces::field::Field;
use stylet_tests::scratch;

const DIMS: [usize; 3] = [90, 100, 110];
const SPACING_MM: f64 = 0.8;
/// Wavelength of the grey waves along each axis of the scene.
const WAVE_M: [f64; 3] = [0.024, 0.031, 0.012];
/// Tolerance of a grey. Linear interpolation between voxels costs 1.4 greys at a crest along z. The
/// steepest slope is 33 greys a millimetre, and the shader finds the material point to a fifth of
/// one.
const GREY_OFF: f64 = 8.0;
const MOVED_M: f64 = 1e-3;

/// Returns waves without an edge, 0 to about 4000.
fn value(scene_m: [f64; 3]) -> f64 {
    let wave = |a: usize| (std::f64::consts::TAU * scene_m[a] / WAVE_M[a]).sin();
    2000.0 + 600.0 * wave(0) + 500.0 * wave(1) + 900.0 * wave(2)
}

/// Writes a volume that lies obliquely in the patient, `shift_m` from the middle of the target.
fn write_image(driven: &Driven, path: &Path, shift_m: f64) {
    let header = driven.window.state().link().scene().expect("live").header;
    let m = header.patient_from_scene;
    let turn = nalgebra::Matrix3::from_row_slice(&m[..9]);
    let origin = Vector3::from_column_slice(&m[9..]);
    let (low, high) = (
        Vector3::from(header.target_lower_m),
        Vector3::from(header.target_upper_m),
    );
    let middle = turn * ((low + high) / 2.0) + origin + Vector3::new(shift_m, 0.0, 0.0);
    let axes = Rotation3::from_euler_angles(0.3, -0.2, 0.5).into_inner();
    let step = SPACING_MM * 1e-3;
    let half = Vector3::from(DIMS.map(|d| (d - 1) as f64 / 2.0 * step));
    let first = middle - axes * half;
    let mut data = Vec::new();
    for n in 0..DIMS.iter().product::<usize>() {
        let at = [n % DIMS[0], n / DIMS[0] % DIMS[1], n / DIMS[0] / DIMS[1]];
        let patient = first + axes * Vector3::from(at.map(|i| i as f64 * step));
        let scene = turn.transpose() * (patient - origin);
        data.extend((value(scene.into()).round() as i16).to_le_bytes());
    }
    let triple = |v: Vector3<f64>| format!("({},{},{})", v.x, v.y, v.z);
    let columns = [0, 1, 2].map(|a| triple(axes.column(a) * SPACING_MM)).join(" ");
    let text = format!(
        "NRRD0004\ntype: int16\ndimension: 3\nspace: right-anterior-superior\nsizes: {} {} {}\nendian: little\n\
         space directions: {columns}\nspace origin: {}\nencoding: raw\n\n",
        DIMS[0],
        DIMS[1],
        DIMS[2],
        triple(first * 1e3)
    );
    std::fs::write(path, [text.into_bytes(), data].concat()).expect("written");
}

fn load(driven: &mut Driven, path: &Path) {
    if driven.window.query_by_label("Load image…").is_none() {
        driven.click("1  Choose the scene");
    }
    driven.type_into("elements", path.to_str().expect("words"));
    driven.click("Load image…");
}

/// Agreement of places in a slice, or of those whose tissue has moved.
#[derive(Debug, Default)]
struct Agreement {
    places: usize,
    /// Number of places whose grey is that of the tissue there now, and of the tissue there at
    /// rest.
    now: usize,
    at_rest: usize,
}

impl Agreement {
    fn now(&self) -> f64 {
        self.now as f64 / self.places as f64
    }
}

/// Returns all places, and those where tissue has come from more than `MOVED_M` away.
fn agreement(driven: &mut Driven, image: &Image) -> [Agreement; 2] {
    driven.window.run_steps(3);
    let picture = driven.window.render().expect("a picture");
    let app: &App = driven.window.state();
    let (scene, snapshot) = (app.link().scene().expect("live"), app.link().snapshot().expect("live"));
    let field = Field::of(scene.header.nodes, &snapshot.displacements_m).expect("fits");
    let rect = driven.window.get_by_label("Sagittal slice").rect();
    let plane = app.middle().plane(Orientation::Sagittal, rect);
    let [low, high] = image.range.map(f64::from);
    let grey = |place: [f64; 3]| ((value(place) - low) / (high - low) * 255.0).clamp(0.0, 255.0);
    let mut found = <[Agreement; 2]>::default();
    for y in (rect.top() as u32 + 20..rect.bottom() as u32 - 20).step_by(2) {
        for x in (rect.left() as u32 + 20..rect.right() as u32 - 20).step_by(2) {
            let place = plane.in_scene(egui::pos2(x as f32 + 0.5, y as f32 + 0.5));
            let [r, g, b, _] = picture.get_pixel(x, y).0;
            // Overlays have colours; ultrasound is tinted a little.
            if r.max(g).max(b) - r.min(g).min(b) > 8 {
                continue;
            }
            let rest = field.rest_of_m(place);
            let is = |grey: f64| usize::from((f64::from(g) - grey).abs() < GREY_OFF);
            let (now, at_rest) = (is(grey(rest.into())), is(grey(place.into())));
            let moved = (rest - place).norm() > MOVED_M;
            for of in &mut found[..1 + usize::from(moved)] {
                of.places += 1;
                of.now += now;
                of.at_rest += at_rest;
            }
        }
    }
    assert!(found[0].places > 5000, "{found:?}");
    found
}

fn in_scratch(name: &str) -> PathBuf {
    scratch(name).join("trus.nrrd")
}

#[test]
fn an_image_lies_where_its_file_says_and_moves_with_the_tissue() {
    let mut driven = Driven::open_plain([1280.0, 800.0]);
    let path = in_scratch("ui-image");
    write_image(&driven, &path, 0.0);
    let image = Image::read(&path, &Progress::default()).expect("read");
    driven.plan_and_place();
    let [speckle, _] = agreement(&mut driven, &image);
    assert!(speckle.now() < 0.2, "without the image: {speckle:?}");
    load(&mut driven, &path);
    driven.wait_for_label("is shown in the slices");
    let [all, _] = agreement(&mut driven, &image);
    driven.picture("image-at-rest");
    assert!(all.now() > 0.97, "at rest: {all:?}");
    driven.pull_tip(0.016);
    let [all, moved] = agreement(&mut driven, &image);
    driven.picture("image-moved");
    assert!(all.now() > 0.95, "moved: {all:?}");
    // The needle and the ring about its tip are white too, and lie here.
    assert!(
        moved.places > 200 && moved.now() > 0.85,
        "where tissue moved: {moved:?}"
    );
    assert!(
        3 * moved.at_rest < 2 * moved.now,
        "it would be the same at rest: {moved:?}"
    );
    assert_eq!(misplaced(&driven.window), Vec::<String>::new());
    driven.press(egui::Key::G);
    let [speckle, _] = agreement(&mut driven, &image);
    assert!(speckle.now() < 0.2, "hidden: {speckle:?}");
    driven.press(egui::Key::G);
    let [all, _] = agreement(&mut driven, &image);
    assert!(all.now() > 0.95, "and back: {all:?}");
    // Another scene is another patient.
    driven.click("pelvis");
    // The needle is in the tissue.
    driven.press(egui::Key::Y);
    driven.until("pelvis", |app| {
        app.link()
            .scene()
            .is_some_and(|s| s.header.name.read().contains("pelvis"))
    });
    driven.until("its surfaces", |app| {
        app.link().scene().is_some_and(|scene| scene.bodies_made().is_some())
    });
    driven.window.run_steps(3);
    assert!(
        driven.window.query_by_label("Image").is_none(),
        "the image of another scene"
    );
}

#[test]
fn foreign_images_and_other_files_are_refused_with_a_reason() {
    let mut driven = Driven::open_plain([1280.0, 800.0]);
    let path = in_scratch("ui-image-elsewhere");
    write_image(&driven, &path, 0.3);
    load(&mut driven, &path);
    driven.wait_for_label("is it of this patient");
    std::fs::write(&path, b"no image").expect("written");
    load(&mut driven, &path);
    driven.wait_for_label("its format is not supported");
    assert!(driven.window.query_by_label("Image").is_none());
}

/// Tests a hundred million empty voxels, which take a second or two to unpack.
#[test]
fn a_long_load_reports_its_share_and_ends_when_it_is_cancelled() {
    let mut driven = Driven::open_plain([1280.0, 800.0]);
    let path = scratch("ui-image-long").join("long.nrrd");
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nspace: right-anterior-superior\nsizes: 500 500 500\n\
                  space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: gzip\n\n";
    let mut file = std::fs::File::create(&path).expect("created");
    file.write_all(header.as_bytes()).expect("written");
    let mut packed = flate2::write::GzEncoder::new(file, flate2::Compression::fast());
    let nothing = vec![0; 500 * 500];
    (0..500).for_each(|_| packed.write_all(&nothing).expect("packed"));
    packed.finish().expect("written");
    load(&mut driven, &path);
    let share = |driven: &Driven| {
        let mut bars = driven
            .window
            .query_all_by_role(egui::accesskit::Role::ProgressIndicator);
        bars.find_map(|bar| bar.accesskit_node().numeric_value())
    };
    let mut seen: Vec<f64> = Vec::new();
    let start = std::time::Instant::now();
    while seen.len() < 3 && start.elapsed().as_secs() < 30 {
        driven.window.run_steps(1);
        seen.extend(share(&driven).filter(|s| *s > 0.0 && seen.last().is_none_or(|last| s > last)));
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert_eq!(seen.len(), 3, "shares that rise: {seen:?}");
    driven.window.get_by_label_contains("long.nrrd: reading voxels");
    assert_eq!(misplaced(&driven.window), Vec::<String>::new());
    driven.picture("loading");
    driven.click("Cancel");
    assert!(share(&driven).is_none(), "it is still shown");
    let readers = || {
        let tasks = std::fs::read_dir("/proc/self/task").expect("threads").flatten();
        let name = |task: std::fs::DirEntry| std::fs::read_to_string(task.path().join("comm")).unwrap_or_default();
        tasks.map(name).filter(|name| name.trim() == "file reader").count()
    };
    let ended = stylet_tests::until(std::time::Duration::from_millis(500), || readers() == 0);
    assert!(ended, "the reader goes on");
}
