//! An `rt-core` that the procedure started and ends.

use super::error::ProcedureError;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use stylet_shm_schema::Instance;

const END_LIMIT: Duration = Duration::from_secs(4);

pub struct Core(Child);

impl Core {
    pub fn start(path: &Path, instance: &Instance, device: Option<&str>) -> Result<Self, ProcedureError> {
        let device = device.iter().flat_map(|name| ["--device", name]);
        Command::new(path)
            .args(device)
            .args(["--instance", instance.name(), "--rt-if-allowed", "--exit-with-parent"])
            .stdin(Stdio::null())
            .spawn()
            .map(Self)
            .map_err(|why| ProcedureError::CoreNotStarted {
                path: path.to_owned(),
                why,
            })
    }

    /// Returns its exit status; `None` while it runs.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.0.try_wait().ok()?
    }
}

impl Drop for Core {
    fn drop(&mut self) {
        if self.ended().is_some() {
            return;
        }
        // SAFETY: the child is ours and has not been waited for, so its number is still its own.
        unsafe { libc::kill(self.0.id() as libc::pid_t, libc::SIGTERM) };
        let asked = Instant::now();
        while self.ended().is_none() {
            if asked.elapsed() > END_LIMIT {
                let _killed = self.0.kill();
                let _reaped = self.0.wait();
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}
