//! `host-ui igtl` with clients in Python. pyigtl, another implementation, reads the codec's output, watches a core and
//! moves its hand; the module for 3D Slicer shows a core with Slicer's own nodes.

use crate::igtl::{Served, distance_m, tip_m, watched};
use crate::igtl_picture::{SIDE, greys_of, written};
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use stylet_shm_schema::Request;
use stylet_tests::hand::Insertion;
use stylet_tests::{Core, ask};

fn pyigtl(words: &[&str]) -> serde_json::Value {
    python("client.py", words)
}

/// Runs a script with pyigtl and slicer-core, which `make igtl-test` installs in a separate folder, naming its Python
/// in `STYLET_PYIGTL`.
fn python(script: &str, words: &[&str]) -> serde_json::Value {
    let python = std::env::var("STYLET_PYIGTL").expect("STYLET_PYIGTL names a Python with pyigtl");
    let script = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../host-ui/igtl/tests")
        .join(script);
    let output = Command::new(python)
        .arg(script)
        .args(words)
        .output()
        .expect("python runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{errors}");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
#[ignore = "needs pyigtl: make igtl-test"]
fn pyigtl_reads_every_message_but_status_of_which_it_knows_nothing() {
    let goldens = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-ui/igtl/tests/goldens");
    let seen = pyigtl(&["read", goldens.to_str().expect("text")]);
    for (name, says) in [
        (
            "transform",
            r#"[[0.0,-1.0,0.0,1.5],[1.0,0.0,0.0,-2.25],[0.0,0.0,1.0,30.125],[0.0,0.0,0.0,1.0]]"#,
        ),
        ("point", r#"[[[1.0,2.0,3.0],[-4.0,5.5,6.25]],["Seed 1","Seed 2"]]"#),
        (
            "polydata",
            r#"[[[0.0,0.0,0.0],[1.0,0.0,0.0],[0.0,1.0,0.0],[0.0,0.0,1.0]],[[3,0,2,1],[3,0,1,3]]]"#,
        ),
        (
            "image",
            r#"["ras",[[0.25,0.0,0.0,1.25],[0.0,0.0,2.0,-2.25],[0.0,-0.5,0.0,30.375],[0.0,0.0,0.0,1.0]],[[[0,1,127],[128,254,255]]]]"#,
        ),
        ("string", r#""Depth 31 mm, force 1.25 N""#),
    ] {
        let message = &seen[name];
        assert_eq!(message["says"].to_string(), says, "{name}");
        assert_eq!(
            (message["device"].as_str(), message["time"].as_f64()),
            (Some("Stylet"), Some(1_234_567_890.5))
        );
    }
    assert!(seen["status"].is_null(), "pyigtl has learned STATUS: compare it here");
}

#[test]
#[ignore = "needs pyigtl: make igtl-test"]
fn pyigtl_watches_and_moves_the_hand() {
    let mut core = Core::start_with(&["--no-rt", "--scene", "pelvis"]);
    let mut link = core.host();
    let served = Served::start(&core, &["--hand", "Stylus"]);
    let rest_m = tip_m(&mut link);
    let (host, port) = served.address.rsplit_once(':').expect("a port");
    let seconds = watched().as_secs_f64().to_string();
    let watching = std::thread::scope(|scope| {
        let watching = scope.spawn(|| pyigtl(&["watch", host, port, &seconds]));
        let mut farthest_m = 0.0_f64;
        while !watching.is_finished() {
            farthest_m = farthest_m.max(distance_m(tip_m(&mut link), rest_m));
            std::thread::sleep(Duration::from_millis(5));
        }
        println!("the hand was up to {:.2} mm away", farthest_m * 1e3);
        assert!((farthest_m - 5e-3).abs() < 5e-4, "{farthest_m} m; {}", served.log());
        watching.join().expect("ran")
    });
    println!("{watching}");
    assert!(watching["connected"].as_bool().expect("said"));
    let count = |device: &str| watching["counts"][device].as_f64().unwrap_or(0.0);
    assert!(count("Needle") > 20.0 * watched().as_secs_f64());
    assert!(
        ["Gland", "Seeds", "State"]
            .iter()
            .all(|device| count(device) > watched().as_secs_f64())
    );
    // A core without real time may lag on a busy machine, and says so.
    let log = served.log();
    let refused = log
        .lines()
        .find(|line| line.contains("refused") && !line.contains("too many requests"));
    assert_eq!(refused, None);
    drop((served, link));
    core.finish();
}

#[test]
#[ignore = "needs slicer-core: make igtl-test"]
fn slicer_shows_what_the_core_has_and_says_when_none_runs() {
    let mut core = Core::start_with(&["--no-rt"]);
    let mut hand = Insertion::begin(&mut core, 0.015);
    hand.watch(Duration::from_secs(4));
    ask(&mut hand.link, &Request::DropSeed { strand_pitch_m: None }).expect("dropped");
    let served = Served::start(&core, &[]);
    let (host, port) = served.address.rsplit_once(':').expect("a port");
    let watch = || python("slicer_nodes.py", &["watch", host, port, "6"]);
    // A host that goes on polling keeps the needle where it is.
    let shown = std::thread::scope(|scope| {
        let shown = scope.spawn(watch);
        while !shown.is_finished() {
            hand.watch(Duration::from_millis(50));
        }
        shown.join().expect("ran")
    });
    println!("{shown}");
    let kinds = serde_json::json!({
        "gland": "vtkMRMLModelNode",
        "needle": "vtkMRMLLinearTransformNode",
        "needle's shape": "vtkMRMLModelNode",
        "seeds": "vtkMRMLMarkupsFiducialNode",
    });
    assert_eq!(shown["kinds"], kinds);
    assert_eq!(shown["count"], 2, "a scene that was closed has no second gland");
    let scene = hand.link.scene().expect("live").header;
    let patient = scene.patient();
    let in_patient_mm = |in_scene_m: [f64; 3]| patient.patient_from_scene(in_scene_m).map(|c| c * 1e3);
    let is_near = |name: &str, shown: &serde_json::Value, expected: [f64; 3], within_mm: f64| {
        let shown: [f64; 3] = serde_json::from_value(shown.clone()).expect("a place");
        let off_mm = (0..3).map(|a| (shown[a] - expected[a]).abs()).fold(0.0, f64::max);
        println!("{name}: {off_mm:.3} mm off");
        assert!(off_mm < within_mm, "{name}: {shown:?}, {expected:?}");
    };
    let tip_mm = in_patient_mm(hand.link.state().expect("live").tip_in_scene_m);
    is_near("tip", &shown["tip_mm"], tip_mm, 0.2);
    let seed_m = hand.link.snapshot().expect("live").header.seeds[0].position_m;
    is_near("seed", &shown["seeds_mm"][0], in_patient_mm(seed_m), 0.2);
    // The scene of the paper lies along the patient's axes, and its needle along the third.
    let end = |what: &str, end: usize| serde_json::json!([0, 1, 2].map(|a| shown[what][2 * a + end].as_f64()));
    let shaft_mm = [tip_mm[0] - 0.635, tip_mm[1] - 0.635, tip_mm[2] - 200.0];
    is_near("shaft", &end("needle's shape", 0), shaft_mm, 0.3);
    is_near("gland, low", &end("gland", 0), in_patient_mm(scene.target_lower_m), 6.0);
    is_near(
        "gland, high",
        &end("gland", 1),
        in_patient_mm(scene.target_upper_m),
        6.0,
    );
    assert!(shown["is_live"].as_bool().expect("said") && shown["words"].to_string().contains("1 seeds"));
    drop(hand);
    core.finish();
    let shown = watch();
    assert!(
        !shown["is_live"].as_bool().expect("said") && shown["count"] == 0,
        "{shown}"
    );
    assert!(shown["words"].to_string().contains("rt-core --instance"), "{shown}");
}

#[test]
#[ignore = "needs pyigtl and slicer-core: make igtl-test"]
fn pyigtl_and_slicer_get_the_picture_that_host_ui_picture_writes() {
    let core = Core::start_with(&["--no-rt", "--scene", "pelvis"]);
    let folder = tempfile::tempdir().expect("a folder");
    let served = Served::start(&core, &["--image", "transverse"]);
    let (host, port) = served.address.rsplit_once(':').expect("a port");
    let png = written(&core, "transverse", folder.path());
    let raw = folder.path().join("greys");
    let read = pyigtl(&["picture", host, port, raw.to_str().expect("text")]);
    assert_eq!(std::fs::read(raw).expect("written"), greys_of(&png));
    assert_eq!(
        (&read["frame"], &read["size"]),
        (&"ras".into(), &serde_json::json!([1, SIDE, SIDE]))
    );
    let shown = python("slicer_nodes.py", &["picture", host, port, png.to_str().expect("text")]);
    println!("{shown}");
    assert_eq!(shown["off"], 0, "the largest difference of a pixel");
    assert_eq!(shown["size"], serde_json::json!([SIDE, SIDE, 1]));
    let at = |matrix: &serde_json::Value, n: usize| matrix[n / 4][n % 4].as_f64().expect("a number");
    let off = (0..16).map(|n| (at(&shown["ras_from_ijk"], n) - at(&read["ras_from_ijk"], n)).abs());
    assert!(off.fold(0.0, f64::max) < 1e-4, "{shown} {read}");
    drop(served);
    core.finish();
}

#[test]
#[ignore = "needs NumPy: make igtl-test"]
fn slicer_says_what_is_wrong_with_a_server() {
    python("slicer_nodes.py", &["strangers"]);
}
