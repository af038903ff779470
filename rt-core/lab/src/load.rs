//! Load of normal priority next to the loops: child processes of this program, so that none of their memory is locked.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use stylet_runtime::control;
use stylet_shm_schema::Instance;
use stylet_wall::packet::Socket;

/// Load that runs next to the loops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Load {
    /// Nothing
    #[default]
    None,
    /// One process that computes for each core
    Cpu,
    /// One process that streams 64 MiB through memory for each core
    Memory,
    /// Two processes that write 4 MiB and sync them to disk, again and again
    Io,
    /// A host that takes everything the core publishes and copies it without a pause
    Ui,
    /// All of the above
    All,
    /// The operator's window, drawing without a pause: `host-ui` from the folder of this program; needs a display
    Window,
}

/// One process of a load.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LoadProcess {
    /// Computes in registers
    Cpu,
    /// Streams 64 MiB through memory
    Memory,
    /// Writes 4 MiB and syncs them to disk
    Io,
    #[value(skip)]
    /// Copies everything that the core publishes: `stylet-bridge`, which knows shared memory
    Ui,
}

impl LoadProcess {
    /// Returns the core for a process with `before` of its kind before it: one on each core. Left to itself the kernel
    /// would mix them differently each time, and a wake-up that interrupts a stream through memory takes twice as long
    /// as one that interrupts a computation.
    fn core(self, before: usize) -> Option<usize> {
        let cores = core_affinity::get_core_ids()?;
        matches!(self, Self::Cpu | Self::Memory)
            .then(|| cores.get(before))
            .flatten()
            .map(|core| core.id)
    }
}

impl Load {
    /// Returns its name on the command line.
    pub(crate) fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }

    fn work(self, cores: usize) -> Vec<LoadProcess> {
        match self {
            Self::None | Self::Window => Vec::new(),
            Self::Cpu => vec![LoadProcess::Cpu; cores],
            Self::Memory => vec![LoadProcess::Memory; cores],
            Self::Io => vec![LoadProcess::Io; 2],
            Self::Ui => vec![LoadProcess::Ui],
            Self::All => [Self::Cpu, Self::Memory, Self::Io, Self::Ui]
                .iter()
                .flat_map(|l| l.work(cores))
                .collect(),
        }
    }

    /// Returns the load in words, for a machine with `cores` cores.
    pub(crate) fn describe(self, cores: usize) -> String {
        if self == Self::Window {
            return "the operator's window, drawing without a pause".to_owned();
        }
        let all = self.work(cores);
        let kinds = [
            (LoadProcess::Cpu, "computing"),
            (LoadProcess::Memory, "streaming 64 MiB through memory"),
            (LoadProcess::Io, "writing 4 MiB and syncing"),
            (LoadProcess::Ui, "copying all that is published"),
        ];
        let counted = kinds.map(|(kind, what)| (all.iter().filter(|w| **w == kind).count(), what));
        let said: Vec<String> = counted
            .iter()
            .filter(|(n, _)| *n > 0)
            .map(|(n, what)| format!("{n} {what}"))
            .collect();
        match said.is_empty() {
            true => "no load of this program".to_owned(),
            false => format!("processes of normal priority: {}", said.join(", ")),
        }
    }
}

/// Reason why a load does not run.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// This program, which the loads are, cannot be found.
    #[error("cannot find this program: {0}")]
    Program(io::Error),
    /// A process of the load does not start.
    #[error("cannot start the load: {0}")]
    Start(io::Error),
    /// The window load has no display.
    #[error("the window load needs a display; without one: xvfb-run -a rt-core latency ...")]
    NoDisplay,
    /// The window's program does not start.
    #[error("cannot start {}: {why}; build it: cargo build --release -p host-ui", .program.display())]
    Window {
        /// Expected path.
        program: PathBuf,
        /// Error of the system.
        why: io::Error,
    },
    /// The load ended: nothing was measured under it.
    #[error("the load ended by itself ({0})")]
    Ended(std::process::ExitStatus),
    /// The load's file cannot be used.
    #[error("{}: {why}", .file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// Error of the system.
        why: io::Error,
    },
}

/// The processes of a load; ended when dropped.
pub(crate) struct Running {
    processes: Vec<Child>,
    /// A host ends when this is closed.
    hosts: Vec<Socket>,
}

impl Running {
    /// Starts the load; `folder` is where the io load may write.
    pub(crate) fn start(load: Load, instance: &Instance, folder: &Path) -> Result<Self, LoadError> {
        let program = std::env::current_exe().map_err(LoadError::Program)?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let mut running = Self {
            processes: Vec::new(),
            hosts: Vec::new(),
        };
        let all = load.work(cores);
        for (index, work) in all.iter().enumerate() {
            if *work == LoadProcess::Ui {
                let (socket, process) = control::watcher("load", instance).map_err(LoadError::Start)?;
                running.processes.push(process);
                running.hosts.push(socket);
                continue;
            }
            let name = work.to_possible_value().expect("no variant is skipped");
            let mut command = Command::new(&program);
            command
                .args(["load", name.get_name(), "--file"])
                .arg(folder.join(format!("load-{index}.tmp")))
                .stdin(Stdio::null());
            let before = all[..index].iter().filter(|w| *w == work).count();
            if let Some(core) = work.core(before) {
                command.arg("--core").arg(core.to_string());
            }
            running.processes.push(command.spawn().map_err(LoadError::Start)?);
        }
        if load == Load::Window {
            running.processes.push(window(&program, instance)?);
        }
        Ok(running)
    }

    /// Fails if a process of the load has ended early: the load was then incomplete.
    pub(crate) fn ended(&mut self) -> Result<(), LoadError> {
        for child in &mut self.processes {
            if let Ok(Some(status)) = child.try_wait() {
                return Err(LoadError::Ended(status));
            }
        }
        Ok(())
    }
}

/// Returns the path of the window's program in the folder of this one.
fn window(program: &Path, instance: &Instance) -> Result<Child, LoadError> {
    if std::env::var_os("DISPLAY").is_none() && std::env::var_os("WAYLAND_DISPLAY").is_none() {
        return Err(LoadError::NoDisplay);
    }
    let window = program.with_file_name("host-ui");
    Command::new(&window)
        .args(["--instance", instance.name(), "--without-pause", "--no-controllers"])
        .stdin(Stdio::null())
        .spawn()
        .map_err(|why| LoadError::Window { program: window, why })
}

impl Drop for Running {
    fn drop(&mut self) {
        self.hosts.clear();
        for child in &mut self.processes {
            // SIGTERM lets the child remove its file and leave shared memory.
            // SAFETY: the child is ours and not yet waited for.
            unsafe { libc::kill(child.id() as libc::pid_t, libc::SIGTERM) };
        }
        for child in &mut self.processes {
            let _ = child.wait();
        }
    }
}

/// Runs one such process, on `core` if given; ends when `stopped`.
///
/// # Errors
/// `file` cannot be written.
pub fn work(kind: LoadProcess, core: Option<usize>, file: &Path, stopped: impl Fn() -> bool) -> Result<(), LoadError> {
    if let Some(id) = core {
        // If not permitted, it loads whichever core it gets.
        core_affinity::set_for_current(core_affinity::CoreId { id });
    }
    match kind {
        LoadProcess::Cpu => compute(stopped),
        LoadProcess::Memory => stream(stopped),
        LoadProcess::Io => {
            let ended = write_and_sync(file, stopped).map_err(|why| LoadError::File {
                file: file.to_owned(),
                why,
            });
            let _ = std::fs::remove_file(file);
            ended?;
        }
        LoadProcess::Ui => {}
    }
    Ok(())
}

fn compute(stopped: impl Fn() -> bool) {
    let mut x = 1.0_f64;
    while !stopped() {
        for _ in 0..100_000 {
            x = std::hint::black_box(x * 1.000_000_1 + 1e-9).sqrt();
        }
    }
}

/// Size beyond that of any cache.
const STREAMED_BYTES: usize = 64 << 20;

fn stream(stopped: impl Fn() -> bool) {
    let mut from = vec![1_u64; STREAMED_BYTES / 16];
    let mut to = vec![0_u64; STREAMED_BYTES / 16];
    while !stopped() {
        to.copy_from_slice(std::hint::black_box(&from));
        std::mem::swap(&mut from, &mut to);
    }
}

fn write_and_sync(path: &Path, stopped: impl Fn() -> bool) -> std::io::Result<()> {
    let mut file = File::create(path)?;
    let block = vec![0x5a_u8; 4 << 20];
    while !stopped() {
        file.seek(SeekFrom::Start(0))?;
        file.write_all(&block)?;
        file.sync_all()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_is_the_sum_of_the_others() {
        let sum: usize = [Load::Cpu, Load::Memory, Load::Io, Load::Ui]
            .iter()
            .map(|l| l.work(3).len())
            .sum();
        assert_eq!(Load::All.work(3).len(), sum);
        assert!(Load::None.work(3).is_empty());
        assert!(Load::All.describe(3).contains("3 computing"));
    }

    #[test]
    fn what_runs_once_for_each_core_has_a_core_each() {
        let cores = core_affinity::get_core_ids().expect("cores");
        for work in [LoadProcess::Cpu, LoadProcess::Memory] {
            let on: Vec<_> = (0..cores.len()).filter_map(|before| work.core(before)).collect();
            assert_eq!(on, cores.iter().map(|c| c.id).collect::<Vec<_>>());
        }
        assert_eq!(LoadProcess::Io.core(0), None);
    }

    #[test]
    fn io_load_writes_and_leaves_nothing() {
        let file = std::env::temp_dir().join(format!("stylet-load-{}", std::process::id()));
        let passes = std::cell::Cell::new(0);
        let seen = std::cell::Cell::new(0);
        let stopped = || {
            seen.set(seen.get().max(std::fs::metadata(&file).map_or(0, |m| m.len())));
            passes.set(passes.get() + 1);
            passes.get() > 2
        };
        work(LoadProcess::Io, None, &file, stopped).expect("the temporary folder can be written");
        assert_eq!(seen.get(), 4 << 20);
        assert!(!file.exists());
    }
}
