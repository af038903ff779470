//! What other programs read of a measurement.

use serde_json::Value;
use std::collections::BTreeSet;
use std::process::Command;
use stylet_test_kit::{program, scratch};

/// Written by cyclictest 2.40 of Debian's rt-tests 2.4-1, with `-q -m -S -p 80 -i 1000 -l 1000 -h 100 --json=FILE`.
const THEIRS: &str = include_str!("cyclictest.json");

/// Adds each key with those above it and the kind of its value; a number stands for every number.
fn keys(value: &Value, above: &str, into: &mut BTreeSet<String>) {
    for (key, value) in value.as_object().into_iter().flatten() {
        let key = if key.parse::<u64>().is_ok() { "N" } else { key };
        let kind = match value {
            Value::Object(_) => "object",
            Value::String(_) => "text",
            Value::Number(n) if n.is_f64() => "decimal",
            Value::Number(_) => "number",
            _ => "other",
        };
        let path = format!("{above}/{key}");
        into.insert(format!("{path} {kind}"));
        keys(value, &path, into);
    }
}

fn keys_of(text: &str) -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    keys(&serde_json::from_str(text).expect("JSON"), "", &mut all);
    all
}

#[test]
fn cyclictest_json_has_the_keys_of_cyclictest_and_the_reports_ticks() {
    let out = scratch("lab-interchange");
    let measured = Command::new(program("rt-core"))
        .args(["latency", "--duration", "2s", "--rt-if-allowed", "--out"])
        .arg(&out)
        .output()
        .expect("rt-core starts");
    let read = |name: &str| {
        std::fs::read_to_string(out.join(name)).unwrap_or_else(|why| panic!("{name}: {why}: {measured:?}"))
    };
    let (text, report) = (read("cyclictest.json"), read("report.json"));
    assert_eq!(keys_of(&text), keys_of(THEIRS));
    let [ours, report]: [Value; 2] = [&text, &report].map(|text| serde_json::from_str(text).expect("JSON"));
    let force = &ours["thread"]["0"];
    let wake = &report["haptic"]["times"][0];
    assert_eq!(force["cycles"], wake["count"]);
    let counts = force["histogram"].as_object().expect("bins").values();
    assert_eq!(
        counts.filter_map(Value::as_u64).sum::<u64>(),
        wake["count"].as_u64().expect("a count")
    );
    let max_us = wake["max_us"].as_f64().expect("measured");
    assert_eq!(force["max"].as_u64(), Some(max_us as u64));
    // The same curves as a picture.
    let picture = read("osadl.svg");
    assert!(picture.starts_with("<svg") && picture.contains(&format!("largest {} ", max_us as u64)));
}
