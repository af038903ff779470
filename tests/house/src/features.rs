//! Checks that the commands of `make` build each package with one set of features, because another set compiles the
//! package, and all that stands on it, again.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Features of each package that this command of cargo builds, as often as they differ.
fn features(arguments: &str) -> BTreeMap<String, BTreeSet<String>> {
    let found = Command::new(env!("CARGO"))
        .args(arguments.split(' '))
        .args([
            "--profile",
            "quick",
            "--locked",
            "--unit-graph",
            "-Z",
            "unstable-options",
        ])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        // The graph of units is an unstable output of cargo.
        .env("RUSTC_BOOTSTRAP", "1")
        .output()
        .expect("cargo runs");
    assert!(found.status.success(), "{}", String::from_utf8_lossy(&found.stderr));
    let graph: Value = serde_json::from_slice(&found.stdout).expect("JSON");
    let mut all = BTreeMap::<_, BTreeSet<_>>::new();
    for unit in graph["units"].as_array().expect("units") {
        if unit["mode"] == "build" {
            let name = format!("{} {}", unit["pkg_id"], unit["target"]["name"]);
            all.entry(name).or_default().insert(unit["features"].to_string());
        }
    }
    all
}

#[test]
fn no_package_is_built_again_with_other_features() {
    let run = features("build --bin rt-core --bin stylet-bridge --bin host-ui");
    for later in [
        "build --workspace --bin stylet-lab --bin stylet-clinic",
        "test",
        "test --workspace",
    ] {
        let later_features = features(later);
        let again: Vec<_> = run
            .iter()
            .filter(|(name, sets)| {
                later_features
                    .get(*name)
                    .is_some_and(|others| !others.is_superset(sets))
            })
            .collect();
        assert!(
            again.is_empty(),
            "`cargo {later}` turns on features that `make run` has off: {again:#?}"
        );
    }
}
