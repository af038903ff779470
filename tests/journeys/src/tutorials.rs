//! Each command of the README and the tutorials, as it is typed there. Where one takes long, a part of it is replaced.

mod page;

use page::Page;
use page::Try::{Elsewhere, Judged, Known, Stays, Succeeds, Window};
use std::path::Path;
use stylet_test_kit::repository;

const RECORD: (&str, &str) = ("--duration 60", "--duration 2");
/// A measurement of two seconds, on a machine without real-time rights too.
const SHORT: &str = "--duration 2s --rounds 0 --rt-if-allowed";

#[test]
fn each_page_with_commands_has_its_test() {
    let tutorials = std::fs::read_dir(repository("docs/tutorials")).expect("a folder");
    let names = tutorials.map(|page| page.expect("a page").file_name().into_string().expect("UTF-8"));
    let mut names: Vec<String> = names.collect();
    names.sort();
    let tested = [
        "first-implant.md",
        "measure-a-pc.md",
        "outside-witness.md",
        "own-device.md",
        "own-patient-data.md",
        "own-tissue-model.md",
    ];
    assert_eq!(names, tested);
}

#[test]
fn the_readme_names_what_can_be_made() {
    let packages = Elsewhere("`make package-test` does this in a root of its own");
    let mut page = Page::open("README.md");
    page.types(&[
        ("make run", &[], Known),
        ("make test", &[], Known),
        ("make package", &[], Known),
        ("sudo apt install ./target/package/stylet-*.deb", &[], packages),
        ("sudo apt purge stylet-rt-core stylet-host-ui", &[], packages),
    ]);
    page.ends();
}

#[test]
fn the_first_implant_works_as_typed() {
    let mut page = Page::open("docs/tutorials/first-implant.md");
    page.types(&[
        ("make run", &[], Known),
        ("host-ui procedure --core target/quick/rt-core --out out/first", &[], Succeeds),
        (
            "host-ui plan --core target/quick/rt-core --scene pelvis --source sources/i125_6711.toml --out plan.toml --csv \
             seeds.csv",
            &[],
            Succeeds,
        ),
    ]);
    // A procedure takes the time of a hand, so one needle of the plan stands for all.
    let plan = page.read("plan.toml");
    let second = plan.match_indices("[[needle]]").nth(1).expect("many needles").0;
    page.write("one-needle.toml", &plan[..second]);
    page.types(&[(
        "host-ui procedure --core target/quick/rt-core --scene pelvis --plan plan.toml --compensate --out out/implant",
        &[("plan.toml", "one-needle.toml")],
        Succeeds,
    )]);
    assert!(page.has("out/implant/score.json") && page.has("out/implant/debrief.html"));
    page.start_core();
    page.types(&[
        ("host-ui record --out session.mcap --duration 60", &[RECORD], Succeeds),
        (
            "host-ui export session.mcap --csv ticks.csv --motion hand.motion",
            &[],
            Succeeds,
        ),
        ("host-ui --watch session.mcap", &[], Window),
    ]);
    page.ends();
}

#[test]
fn a_pc_is_measured_as_typed() {
    let mut page = Page::open("docs/tutorials/measure-a-pc.md");
    page.types(&[
        ("rt-core doctor", &[], Judged),
        ("rt-core doctor --apply", &[], Judged),
        (
            "rt-core latency --duration 60s --out quiet",
            &[("--duration 60s", SHORT)],
            Judged,
        ),
        (
            "rt-core latency --duration 10m --load all --out loaded",
            &[("--duration 10m", SHORT)],
            Judged,
        ),
        (
            "sudo rt-core latency --duration 10m --load all --trace --out traced",
            &[],
            Elsewhere("the trace of the kernel belongs to one program; `make causes` uses it"),
        ),
        ("rt-core verify quiet", &[], Succeeds),
        ("rt-core cost --scene pelvis", &[("pelvis", "paper")], Succeeds),
    ]);
    page.ends();
}

#[test]
fn a_witness_is_asked_as_typed() {
    let analyser = Elsewhere("a logic analyser is needed; tests/lab evaluates synthetic captures");
    let mut page = Page::open("docs/tutorials/outside-witness.md");
    page.types(&[
        (
            "sudo rt-core latency --duration 5m --out DIR --toggle /dev/ttyS0:rts",
            &[],
            analyser,
        ),
        (
            "sigrok-cli -d fx2lafw -c samplerate=1m --time 300s -C D0,D1,D2 -O csv -o capture.csv",
            &[],
            analyser,
        ),
        ("rt-core latency --out DIR --external capture.csv", &[], analyser),
        (
            "rt-core latency --out DIR --external capture.csv --motion D2",
            &[],
            analyser,
        ),
    ]);
    page.ends();
}

#[test]
fn a_recorded_hand_is_replayed_as_typed() {
    let mut page = Page::open("docs/tutorials/own-device.md");
    page.start_core();
    page.types(&[
        ("host-ui record --out session.mcap --duration 60", &[RECORD], Succeeds),
        ("host-ui export session.mcap --motion hand.motion", &[], Succeeds),
    ]);
    page.end_core();
    page.types(&[
        (
            "rt-core --device replay:hand.motion",
            &[("rt-core", "rt-core --rt-if-allowed")],
            Stays,
        ),
        ("rt-core devices", &[], Succeeds),
        (
            "rt-core --device phantom",
            &[],
            Elsewhere("tests/devices opens it with a fake of its driver"),
        ),
        ("cargo test --profile quick -p stylet-hw conformance", &[], Known),
    ]);
    page.ends();
}

#[test]
fn own_patient_data_work_as_typed() {
    let mut page = Page::open("docs/tutorials/own-patient-data.md");
    write_labels(&page.path("gland.nrrd"));
    write_greys(&page.path("trus.nrrd"));
    page.write("gland.toml", &page.listing("[volume]"));
    page.types(&[
        ("host-ui scene check gland.nrrd", &[], Succeeds),
        ("host-ui scene check gland.toml", &[], Succeeds),
        (
            "host-ui procedure --core target/quick/rt-core --scene gland.toml --out out/mine",
            &[],
            Succeeds,
        ),
        ("host-ui convert gland.nrrd gland.nii.gz", &[], Succeeds),
        ("host-ui convert gland.nrrd gland.seg.nrrd", &[], Succeeds),
    ]);
    page.start_core();
    page.types(&[
        ("host-ui --scene gland.toml", &[], Window),
        ("host-ui --scene gland.toml --image trus.nrrd", &[], Window),
    ]);
    page.ends();
}

#[test]
fn the_cost_of_a_tissue_model_is_asked_as_typed() {
    let mut page = Page::open("docs/tutorials/own-tissue-model.md");
    page.types(&[
        (
            "cargo test --profile quick -p stylet-tests-physics stability",
            &[],
            Known,
        ),
        ("rt-core cost --scene paper", &[], Succeeds),
        ("make report", &[], Known),
    ]);
    page.ends();
}

const SIDE: usize = 40;

/// Writes voxels of 1 mm, each with the value of its place from the middle, mm.
fn write_voxels(path: &Path, value: impl Fn([f64; 3]) -> u8) {
    let mut text = format!(
        "NRRD0004\ntype: uint8\ndimension: 3\nspace: right-anterior-superior\nsizes: {SIDE} {SIDE} {SIDE}\n\
         space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: raw\n\n"
    )
    .into_bytes();
    for n in 0..SIDE.pow(3) {
        let at = [n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE].map(|i| i as f64 - (SIDE / 2) as f64);
        text.push(value(at));
    }
    std::fs::write(path, text).expect("written");
}

/// Writes a gland with its urethra and a rectum behind it, labels 1 to 3.
fn write_labels(path: &Path) {
    write_voxels(path, |[x, y, z]| match x.hypot(y).hypot(z) < 14.0 {
        true if x.hypot(y) < 3.0 => 2,
        true => 1,
        false if x.hypot(y + 17.0) < 3.0 => 3,
        false => 0,
    });
}

fn write_greys(path: &Path) {
    write_voxels(path, |[x, y, z]| (x.hypot(y).hypot(z) * 5.0) as u8);
}
