//! A tissue model of a crate outside the workspace.

use std::process::Command;
use stylet_test_kit::repository;

#[test]
fn the_runtime_takes_a_tissue_model_of_another_crate() {
    let target = std::env::current_exe().expect("a test knows its own file");
    let target = target.ancestors().nth(3).expect("<target>/<profile>/deps/<test>");
    let tested = Command::new("cargo")
        .args(["test", "--offline", "--locked", "--lib", "--manifest-path"])
        .arg(repository("tests/outside-tissue/Cargo.toml"))
        .arg("--target-dir")
        .arg(target.join("outside-tissue"))
        .output()
        .expect("cargo");
    let said = String::from_utf8_lossy(&tested.stdout);
    assert!(
        tested.status.success() && said.contains("1 passed"),
        "{said}\n{}",
        String::from_utf8_lossy(&tested.stderr)
    );
}
