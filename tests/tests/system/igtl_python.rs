//! `host-ui igtl` with the client of another implementation, pyigtl: it reads the codec's output, watches a core and
//! moves its hand.

use crate::igtl::{Served, distance_m, tip_m, watched};
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use stylet_tests::Core;

/// Runs pyigtl, which `make igtl-test` installs in a separate folder, naming its Python in `STYLET_PYIGTL`.
fn pyigtl(words: &[&str]) -> serde_json::Value {
    let python = std::env::var("STYLET_PYIGTL").expect("STYLET_PYIGTL names a Python with pyigtl");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-ui/igtl/tests/client.py");
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
