//! The laboratory, a study with its page, commands on files, and OpenIGTLink.

use crate::{Ended, command, json, typed};
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::time::Duration;
use stylet_test_kit::{repository, scratch, until};

#[test]
fn the_laboratory_measures_two_seconds_and_verifies_its_report() {
    let folder = scratch("journey-lab");
    let words = [
        "latency",
        "--duration",
        "2s",
        "--rt-if-allowed",
        "--rounds",
        "0",
        "--out",
        "report",
    ];
    // The exit code tells the verdict, which depends on the machine.
    let measured = command("rt-core", &words, &folder).output();
    let said = measured.expect("rt-core starts").stderr;
    let report = folder.join("report/report.json");
    assert!(report.exists(), "{}", String::from_utf8_lossy(&said));
    assert_eq!(json(&report)["schema"], "stylet.latency/2");
    typed("rt-core", &["verify", "report"], &folder);
}

#[test]
fn a_study_of_one_implant_makes_rows_and_a_page() {
    let folder = scratch("journey-study");
    let plan = std::fs::read_to_string(repository("docs/study/paper-plan.toml")).expect("a plan");
    std::fs::write(folder.join("plan.toml"), plan).expect("written");
    let study = "name = \"journey\"\nimplants = 1\n[[gland]]\nscene = \"paper\"\nplan = \"plan.toml\"\n";
    std::fs::write(folder.join("study.toml"), study).expect("written");
    let said = typed("rt-core", &["study", "study.toml", "--out", "out"], &folder);
    assert!(said.contains("16 insertions, 0 of them failed"), "{said}");
    typed("host-ui", &["study", "out", "--out", "page"], &folder);
    let rows = std::fs::read_to_string(folder.join("page/insertions.csv")).expect("written");
    assert_eq!(rows.lines().count(), 17);
    assert!(folder.join("page/study.html").exists());
}

/// TG-43U1, eq. 1: strength, dose rate constant and anisotropy factor at 1 cm of the 6711, over its whole life.
#[test]
fn a_seed_gives_the_published_dose_at_1_cm() {
    let folder = scratch("journey-dose");
    let place = |name: &str, at: &str| std::fs::write(folder.join(name), format!("x_mm,y_mm,z_mm\n{at}\n"));
    place("seeds.csv", "0,0,0").expect("written");
    place("points.csv", "10,0,0").expect("written");
    let source = repository("sources/i125_6711.toml");
    let (source, inputs) = (
        source.to_string_lossy(),
        ["--seeds", "seeds.csv", "--points", "points.csv"],
    );
    let words = [
        &["dose", "--source", &source, "--strength-u", "0.5", "--out", "out"][..],
        &inputs,
    ]
    .concat();
    typed("host-ui", &words, &folder);
    let table = std::fs::read_to_string(folder.join("out/dose_points.csv")).expect("written");
    let dose_gy: f64 = table
        .trim()
        .rsplit(',')
        .next()
        .and_then(|cell| cell.parse().ok())
        .expect("a dose");
    let expected_gy = 0.5 * 0.965 * 0.944 * 59.4 * 24.0 / std::f64::consts::LN_2 / 100.0;
    assert!(
        (dose_gy / expected_gy - 1.0).abs() < 1e-3,
        "{dose_gy} Gy for {expected_gy}"
    );
}

#[test]
fn a_client_of_openigtlink_receives_the_needle() {
    let folder = scratch("journey-igtl");
    let instance = format!("journey-igtl-{}", std::process::id());
    let port = TcpListener::bind("127.0.0.1:0")
        .and_then(|free| free.local_addr())
        .expect("a port");
    let address = port.to_string();
    let core = ["--instance", &instance, "--rt-if-allowed"];
    let start = |name, words: &[&str]| Ended(command(name, words, &folder).spawn().expect("it starts"));
    let _core = start("rt-core", &core);
    let _server = start("host-ui", &["igtl", "--instance", &instance, "--listen", &address]);
    let mut stream = None;
    assert!(until(Duration::from_secs(20), || {
        stream = TcpStream::connect(&address).ok();
        stream.is_some()
    }));
    let mut stream = stream.expect("connected");
    stream
        .set_read_timeout(Some(Duration::from_secs(20)))
        .expect("a timeout");
    // A message begins with a version and the name of its type, 12 bytes; the needle is a TRANSFORM.
    let mut kinds = String::new();
    let received = until(Duration::from_secs(20), || {
        let mut header = [0; 58];
        stream.read_exact(&mut header).expect("a header");
        kinds += &String::from_utf8_lossy(&header[2..14]);
        let bytes = u64::from_be_bytes(header[42..50].try_into().expect("eight bytes"));
        std::io::copy(&mut (&stream).take(bytes), &mut std::io::sink()).expect("a body");
        kinds.contains("TRANSFORM")
    });
    assert!(received, "only {kinds}");
}
