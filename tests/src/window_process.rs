//! Windows of the operator's program, as processes of their own.

use crate::{Core, Display, program};
use std::process::{Child, Command, Stdio};

/// A real window on a display without a screen; killed with SIGKILL when dropped.
pub struct Window {
    child: Child,
    /// Where it has one to itself.
    _display: Option<Display>,
}

impl Window {
    /// On a display of its own.
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
