//! The simulator: an insertion without a window.

use crate::{json, typed};
use stylet_test_kit::{program, scratch};

/// The tissue moves with the needle, so the first seeds rest short of their plan; the force stays below the device's.
#[test]
fn a_procedure_drops_five_seeds_and_says_where_they_rest() {
    let folder = scratch("journey-procedure");
    let core = program("rt-core");
    let instance = format!("journey-{}", std::process::id());
    let words = [
        "procedure",
        "--core",
        &core.to_string_lossy(),
        "--instance",
        &instance,
        "--out",
        "out",
    ];
    let said = typed("host-ui", &words, &folder);
    assert!(said.contains("off plan: 5 seeds"), "{said}");
    let result = json(&folder.join("out/result.json"));
    assert_eq!(result["completed"], true);
    let seeds = result["seeds"].as_array().expect("a list");
    assert_eq!(seeds.len(), 5);
    let force = |key: &str| result["force"][key].as_f64().expect("a number");
    assert!(
        force("peak_n") > 1.0 && force("peak_n") < force("device_limit_n"),
        "{}",
        result["force"]
    );
    let records = std::fs::read_to_string(folder.join("out/force.csv")).expect("written");
    assert!(records.lines().count() > 1000, "a tick of 1 ms has a line");
}
