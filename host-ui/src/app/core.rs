//! A core that this window starts to replace one that has ended.

use super::App;
use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use stylet_host::core_args::SceneChoice;
use stylet_shm_schema::{BUILTIN_SCENES, affinity};

const PROGRAM: &str = "rt-core";

/// Its messages. A pipe would end with the window, and the core on its next message.
const LOG: &str = "out/rt-core.log";

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
        if let Some(scene) = self.present_scene() {
            self.files.first_scene = Some(scene);
        }
        let mut command = Command::new(&program);
        command
            .args(["--instance", &self.shown.instance, "--rt-if-allowed"])
            .stdin(Stdio::null())
            .stderr(log().map_or_else(|_| Stdio::inherit(), Stdio::from))
            .process_group(0);
        // SAFETY: `return_to_all_cores` makes one system call and allocates nothing.
        // The window has left the core of the last force loop; both loops of the next core would share what is left.
        unsafe {
            command.pre_exec(|| {
                affinity::return_to_all_cores();
                Ok(())
            });
        }
        match command.spawn() {
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

impl App {
    /// Returns how the scene on display is loaded again; `None` before the first one, and if another window sent it.
    fn present_scene(&self) -> Option<SceneChoice> {
        let name = self.shown.scene.as_ref()?.name.read();
        let built_in = BUILTIN_SCENES.iter().position(|scene| *scene == name);
        self.scene_file()
            .map(SceneChoice::File)
            .or(built_in.map(SceneChoice::BuiltIn))
    }

    /// Says why the core that this window started has failed.
    pub(super) fn take_core(&mut self) {
        let Some(StartedCore(child)) = &mut self.started_core else {
            return;
        };
        let Ok(Some(status)) = child.try_wait() else { return };
        self.started_core = None;
        if !status.success() {
            let last = last_line(&std::fs::read(LOG).unwrap_or_default());
            self.refuse(format!(
                "rt-core ended ({status}): {last} All its messages are in {LOG}."
            ));
        }
    }
}

fn log() -> std::io::Result<File> {
    std::fs::create_dir_all("out")?;
    File::create(LOG)
}

/// Returns the last line with text, safe to show.
fn last_line(log: &[u8]) -> String {
    let text = String::from_utf8_lossy(log);
    let last = text.lines().rev().find(|line| !line.trim().is_empty());
    stylet_base::format::printable(last.unwrap_or("It gave no reason."))
}

/// Returns the program next to this one, or the one on the search path.
fn program() -> PathBuf {
    let own = std::env::current_exe().unwrap_or_default();
    let mut places = own.ancestors().skip(1).take(2).map(|folder| folder.join(PROGRAM));
    places.find(|place| place.is_file()).unwrap_or_else(|| PROGRAM.into())
}

#[cfg(test)]
mod tests {
    use crate::app::tests::fixture::Drawn;

    /// Guards against a core that failed to start without a word.
    #[test]
    fn a_core_that_fails_is_reported_with_its_last_words() {
        assert_eq!(super::last_line(b"one\nrt-core: no memory\n\n"), "rt-core: no memory");
        let mut drawn = Drawn::new([1280.0, 720.0], 1.0);
        let failed = std::process::Command::new("false").spawn().expect("a program");
        drawn.app.started_core = Some(super::StartedCore(failed));
        while drawn.app.started_core.is_some() {
            drawn.app.take_core();
        }
        let note = drawn.app.shown.note.take().expect("a message");
        assert!(
            note.refused && note.text.starts_with("rt-core ended (exit status: 1): "),
            "{}",
            note.text
        );
    }
}
