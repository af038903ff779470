//! Windows of the operator's program, as separate processes.

use crate::{Core, Display, program};
use std::process::{Child, Command, Stdio};

/// A real window on a virtual display; killed with SIGKILL when dropped.
pub struct Window {
    child: Child,
    /// Present if it has a display to itself.
    _display: Option<Display>,
}

impl Window {
    /// Opens it on a separate display.
    pub fn open(core: &Core) -> Self {
        let display = Display::open();
        let child = start(&display, core);
        Self {
            child,
            _display: Some(display),
        }
    }

    pub fn open_on(display: &Display, core: &Core) -> Self {
        Self {
            child: start(display, core),
            _display: None,
        }
    }

    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }
}

impl Drop for Window {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn start(display: &Display, core: &Core) -> Child {
    let child = Command::new(program("host-ui"))
        .args(["--instance", core.instance.name()])
        .env("DISPLAY", display.name())
        .env_remove("WAYLAND_DISPLAY")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    child.expect("host-ui starts")
}
