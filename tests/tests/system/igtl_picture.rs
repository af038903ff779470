//! `host-ui igtl --image`: a client gets the picture that `host-ui picture` writes of the same probe, at its place.

use crate::igtl::{Served, receive_one};
use std::io::BufReader;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use stylet_host::link::Link;
use stylet_igtl::codec::{Body, Image};
use stylet_tests::hand::Insertion;
use stylet_tests::{Core, program, until};

pub const SIDE: usize = 768;
/// Depth of the picture and radius of the probe: the middle beam from the probe's axis, mm.
const HIGH_MM: f64 = 70.0;

fn picture_of(stream: &mut TcpStream) -> Image {
    receive_one(stream, |message| match (message.device.as_str(), message.body) {
        ("Ultrasound", Body::Image(image)) => Some(image),
        _ => None,
    })
}

/// Lets `host-ui picture` write the same view.
pub fn written(core: &Core, view: &str, folder: &Path) -> PathBuf {
    let file = folder.join(format!("{view}.png"));
    let picture = Command::new(program("host-ui"))
        .args(["picture", "--instance", core.instance.name(), "--view", view, "--out"])
        .arg(&file)
        .output()
        .expect("host-ui runs");
    assert!(picture.status.success(), "{}", String::from_utf8_lossy(&picture.stderr));
    file
}

/// Returns the greys of a PNG file, whose three colours are the same.
pub fn greys_of(file: &Path) -> Vec<u8> {
    let file = BufReader::new(std::fs::File::open(file).expect("written"));
    let mut reader = png::Decoder::new(file).read_info().expect("a PNG file");
    let mut rgba = vec![0; SIDE * SIDE * 4];
    reader.next_frame(&mut rgba).expect("a picture of this size");
    let pixels = rgba.chunks_exact(4);
    pixels
        .map(|pixel| {
            assert!(pixel[0] == pixel[1] && pixel[1] == pixel[2], "{pixel:?}");
            pixel[0]
        })
        .collect()
}

fn is_as_written(image: &Image, written: &[u8]) {
    assert_eq!(image.size.map(usize::from), [SIDE, SIDE, 1]);
    let shades: std::collections::BTreeSet<u8> = written.iter().copied().collect();
    let mean = mean_off(&image.greys, written);
    println!("mean absolute difference {mean} of {} shades", shades.len());
    assert!(shades.len() > 40, "an empty picture");
    assert!(image.greys == written, "the pictures differ");
}

fn mean_off(a: &[u8], b: &[u8]) -> f64 {
    let off = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)));
    off.sum::<f64>() / a.len() as f64
}

fn is_near(what: &str, found: [f32; 3], expected: [f64; 3]) {
    let off = (0..3)
        .map(|a| (f64::from(found[a]) - expected[a]).abs())
        .fold(0.0, f64::max);
    assert!(off < 1e-3, "{what}: {found:?}, {expected:?}");
}

fn wait_for(link: &mut Link, is_there: impl Fn(&Link) -> bool) {
    let came = until(Duration::from_secs(10), || {
        link.poll();
        is_there(link)
    });
    assert!(came, "the core sends it");
}

#[test]
fn a_client_gets_the_picture_that_host_ui_picture_writes() {
    let mut core = Core::start_with(&["--no-rt", "--scene", "pelvis"]);
    let mut link = core.host();
    wait_for(&mut link, |link| link.scene().is_some());
    let folder = tempfile::tempdir().expect("a folder");
    let served = Served::start(&core, &["--image", "transverse"]);
    let mut stream = served.connect();
    let image = picture_of(&mut stream);
    is_as_written(&image, &greys_of(&written(&core, "transverse", folder.path())));

    // The patient's left is on the right, anterior is up, and the fan of 160 degrees fills the width.
    let scene = link.scene().expect("announced").header;
    let pixel_mm = 2.0 * HIGH_MM * 80_f64.to_radians().sin() / SIDE as f64;
    is_near("columns", image.columns[0], [-pixel_mm, 0.0, 0.0]);
    is_near("rows", image.columns[1], [0.0, -pixel_mm, 0.0]);
    is_near("thickness", image.columns[2], [0.0, 0.0, 2.0]);
    let middle_mm = |low: [f64; 3], high: [f64; 3]| {
        let middle_m = [0, 1, 2].map(|a| (low[a] + high[a]) * 0.5);
        scene.patient().patient_from_scene(middle_m).map(|c| c * 1e3)
    };
    let rectum = scene.structures().iter().find(|s| s.name.read() == "rectal wall");
    let rectum_mm = rectum.map(|s| middle_mm(s.lower_m, s.upper_m)).expect("a rectal wall");
    let target_mm = middle_mm(scene.target_lower_m, scene.target_upper_m);
    let expected_mm = [rectum_mm[0], rectum_mm[1] + 0.5 * HIGH_MM, target_mm[2]];
    is_near("middle", image.columns[3], expected_mm);

    drop(link);
    core.finish();
    let words = receive_one(&mut stream, |message| match message.body {
        Body::Text(words) if message.device == "State" && words.contains("rt-core --instance") => Some(words),
        _ => None,
    });
    println!("without a core: {words}");
}

#[test]
fn the_picture_is_that_of_the_probe_in_the_second_hand() {
    let mut core = Core::start_with(&["--no-rt", "--scene", "pelvis", "--device-2", "simulated"]);
    let mut link = core.host();
    wait_for(&mut link, |link| {
        link.scene().is_some() && link.second_state().is_some_and(|second| second.tick > 0)
    });
    let folder = tempfile::tempdir().expect("a folder");
    let served = Served::start(&core, &["--image", "sagittal"]);
    let image = picture_of(&mut served.connect());
    is_as_written(&image, &greys_of(&written(&core, "sagittal", folder.path())));
    let (scene, second) = (link.scene().expect("announced").header, link.second_state());
    let tip_m = second.expect("ticks").tip_in_scene_m;
    // The hand rests upright: its axis is the scene's z, its beam the scene's y.
    let middle_m = [tip_m[0], tip_m[1] + 0.5e-3 * HIGH_MM, tip_m[2] - 42.5e-3];
    let middle_mm = scene.patient().patient_from_scene(middle_m).map(|c| c * 1e3);
    is_near("middle", image.columns[3], middle_mm);
    drop((served, link));
    core.finish();
}

/// Tissue that is held creeps, so the two pictures are of slightly different moments. Without the present tissue, or
/// without the needle, the difference was more than 0.7 of the change.
#[test]
fn needle_and_tissue_are_where_host_ui_picture_has_them() {
    let mut core = Core::start_with(&["--no-rt"]);
    let folder = tempfile::tempdir().expect("a folder");
    let served = Served::start(&core, &["--image", "sagittal"]);
    let before = picture_of(&mut served.connect()).greys;
    // From here on the hand stops unless it is watched.
    let mut hand = Insertion::begin(&mut core, 0.015);
    hand.watch(Duration::from_secs(6));
    let (image, file) = std::thread::scope(|scope| {
        let pictures = scope.spawn(|| {
            let mut stream = served.connect();
            // The first is the newest that was sent before.
            picture_of(&mut stream);
            (picture_of(&mut stream).greys, written(&core, "sagittal", folder.path()))
        });
        while !pictures.is_finished() {
            hand.watch(Duration::from_millis(50));
        }
        pictures.join().expect("ran")
    });
    let (changed, off) = (mean_off(&image, &before), mean_off(&image, &greys_of(&file)));
    println!("mean absolute difference {off}; {changed} since before the insertion");
    assert!(off < 0.2 * changed, "{off} of {changed}");
    drop((served, hand));
    core.finish();
}

#[test]
fn without_a_graphics_driver_images_are_refused_at_the_start() {
    let mut refused = Command::new(program("host-ui"))
        .args(["igtl", "--listen", "127.0.0.1:0", "--image", "transverse"])
        .env("VK_DRIVER_FILES", "/nonexistent.json")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("host-ui runs");
    let ends = until(Duration::from_secs(20), || {
        refused.try_wait().is_ok_and(|status| status.is_some())
    });
    let _ = refused.kill();
    let refused = refused.wait_with_output().expect("ended");
    let words = String::from_utf8_lossy(&refused.stderr);
    assert!(ends && !refused.status.success(), "it serves without a driver: {words}");
    assert!(words.contains("mesa-vulkan-drivers"), "{words}");
}
