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
use std::process::{Child, Command};
#[cfg(test)]
use std::time::Duration;

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

/// A program that ends with its owner, by SIGTERM: a core that is killed leaves its shared memory behind.
#[cfg(test)]
struct Ended(Child);

#[cfg(test)]
impl Drop for Ended {
    fn drop(&mut self) {
        let _ = Command::new("kill").arg(self.0.id().to_string()).status();
        if !stylet_test_kit::until(Duration::from_secs(10), || !matches!(self.0.try_wait(), Ok(None))) {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }
}

#[cfg(test)]
fn json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
    serde_json::from_str(&text).expect("JSON")
}
