//! A core that this window starts to replace one that has ended.

use super::App;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

const PROGRAM: &str = "rt-core";

/// Core that ends with the window, unless the window crashes: then it runs on, and the next window finds it.
#[derive(Debug)]
pub struct StartedCore(Child);

impl Drop for StartedCore {
    fn drop(&mut self) {
        let has_ended = !matches!(self.0.try_wait(), Ok(None));
        if !has_ended && !std::thread::panicking() {
            // SAFETY: the child is ours and has not been waited for, so its number is still its own.
            unsafe { libc::kill(self.0.id() as libc::pid_t, libc::SIGTERM) };
        }
    }
}

impl App {
    /// Starts a core under the window's instance name, in a separate process group.
    pub(super) fn start_core(&mut self) {
        let program = program();
        self.started_core = None;
        let started = Command::new(&program)
            .args(["--instance", &self.shown.instance, "--rt-if-allowed"])
            .stdin(Stdio::null())
            .process_group(0)
            .spawn();
        match started {
            Ok(child) => self.started_core = Some(StartedCore(child)),
            Err(why) => {
                let text = format!(
                    "Cannot start {}: {why}. Start rt-core in a terminal.",
                    program.display()
                );
                self.refuse(text);
            }
        }
    }
}

/// Returns the program next to this one, or the one on the search path.
fn program() -> PathBuf {
    let own = std::env::current_exe().unwrap_or_default();
    let mut places = own.ancestors().skip(1).take(2).map(|folder| folder.join(PROGRAM));
    places.find(|place| place.is_file()).unwrap_or_else(|| PROGRAM.into())
}
