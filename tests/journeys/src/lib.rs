//! One use of the simulator and of each product, as a user types it. The relay, which is not built with the workspace,
//! has its own tests.

#[cfg(test)]
mod products;
#[cfg(test)]
mod run_script;
#[cfg(test)]
mod simulator;
#[cfg(test)]
mod tutorials;

#[cfg(test)]
use serde_json::Value;
#[cfg(test)]
use std::path::Path;
#[cfg(test)]
use std::process::Command;

/// Returns a command in the folder of a test; recordings of flights stay there, too.
#[cfg(test)]
fn command(program: &str, words: &[&str], folder: &Path) -> Command {
    let mut command = Command::new(stylet_test_kit::program(program));
    command.args(words).current_dir(folder).env("XDG_STATE_HOME", folder);
    command
}

/// Runs a program to its end; returns its output if it succeeded.
#[cfg(test)]
fn typed(program: &str, words: &[&str], folder: &Path) -> String {
    let done = command(program, words, folder).output().expect("it starts");
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    let why = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{program} {words:?}: {said}{why}");
    said
}

#[cfg(test)]
fn json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
    serde_json::from_str(&text).expect("JSON")
}
