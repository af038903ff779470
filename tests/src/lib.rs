//! Fixtures for whole-system tests: a separate core process for each test, and a host connected to it.

pub mod hand;
pub mod phantom;
pub mod pointer;
pub mod rehearsal;
pub mod sender;
pub mod stage;
pub mod stopped;
pub mod window_process;

use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use stylet_host::link::{Link, LinkStatus};
use stylet_shm_schema::Instance;
use stylet_shm_schema::Request;
pub use stylet_test_kit::{program, scratch, until, witness};

/// Returns a unique instance name.
pub fn fresh_instance() -> Instance {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    Instance::new(&format!("t{}-{number}", std::process::id())).expect("letters, digits and a hyphen")
}

/// A name without a core, whose files are removed when it is dropped: declare it before its users.
pub struct Alone(pub Instance);

impl Drop for Alone {
    fn drop(&mut self) {
        self.0.sweep();
    }
}

/// A running `rt-core`; ended when dropped. Its hosts must be dropped before it, or their files stay in `/dev/shm`.
pub struct Core {
    child: Child,
    pub instance: Instance,
    report: PathBuf,
}

impl Core {
    pub fn start() -> Self {
        Self::start_with(&["--rt-if-allowed"])
    }

    pub fn start_with(options: &[&str]) -> Self {
        Self::launch(fresh_instance(), options, &[])
    }

    /// Starts under a name that another core may have had.
    pub fn start_as(instance: Instance, options: &[&str]) -> Self {
        Self::launch(instance, options, &[])
    }

    /// Starts with these variables in its environment.
    pub fn start_in(options: &[&str], variables: &[(&str, &str)]) -> Self {
        Self::launch(fresh_instance(), options, variables)
    }

    fn launch(instance: Instance, options: &[&str], variables: &[(&str, &str)]) -> Self {
        let report = scratch(&format!("core-{}", instance.name())).join("report.json");
        let mut command = Command::new(program("rt-core"));
        // SAFETY: between fork and exec it only makes a system call.
        unsafe { command.pre_exec(use_every_core) };
        let child = command
            .args(["--instance", instance.name(), "--exit-with-parent", "--report"])
            .arg(&report)
            .arg("--flight-dir")
            .arg(report.with_file_name("flights"))
            .args(options)
            .envs(variables.iter().copied())
            .stderr(Stdio::null())
            .spawn()
            .expect("rt-core starts");
        Self {
            child,
            instance,
            report,
        }
    }

    /// Flight recordings written so far, oldest first.
    pub fn flights(&self) -> Vec<PathBuf> {
        let files = std::fs::read_dir(self.report.with_file_name("flights"));
        let mut files: Vec<PathBuf> = files.into_iter().flatten().flatten().map(|f| f.path()).collect();
        files.retain(|f| f.extension().is_some_and(|e| e == "flight"));
        files.sort();
        files
    }

    /// Kills the core with SIGKILL, without any cleanup. Returns the name, for the next core.
    pub fn kill(mut self) -> Instance {
        self.child.kill().expect("ours");
        self.child.wait().expect("ours");
        let instance = self.instance.clone();
        // The files of the dead core stay: the next one must cope with them.
        std::mem::forget(self);
        instance
    }

    /// Waits until it ends by itself.
    pub fn ended(&mut self, limit: Duration) -> Option<std::process::ExitStatus> {
        let mut status = None;
        until(limit, || {
            status = self.child.try_wait().expect("ours");
            status.is_some()
        });
        status
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Kills the process and keeps the fixture's data.
    pub fn kill_only(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Returns a host that sees this core live.
    pub fn host(&mut self) -> Link {
        let mut link = Link::new(self.instance.clone());
        let live = until(Duration::from_secs(10), || {
            link.poll();
            matches!(link.status(), LinkStatus::Live)
                && link.scene().is_some()
                && link.parameters().is_some()
                && link.snapshot().is_some()
        });
        assert!(live, "no live core: {:?}, running {}", link.status(), self.is_running());
        link
    }

    /// Ends it and returns the cost of each loop.
    pub fn finish(mut self) -> serde_json::Value {
        // SAFETY: the child is ours and not yet waited for.
        unsafe { libc::kill(self.child.id() as libc::pid_t, libc::SIGTERM) };
        let status = self.child.wait().expect("rt-core ends");
        assert!(status.success(), "rt-core ended with {status}");
        let text = std::fs::read_to_string(&self.report).expect("rt-core wrote its report");
        serde_json::from_str(&text).expect("the report is JSON")
    }
}

impl Drop for Core {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        // A background job of a dropped window closes its link a moment later.
        let is_swept = until(Duration::from_secs(2), || {
            self.instance.sweep();
            left_behind(&self.instance).is_empty()
        });
        // A test that fails for another reason reports that itself.
        assert!(
            is_swept || std::thread::panicking(),
            "a host of {} outlives its core: drop links, nodes and ports before the core ends. Left: {:?}",
            self.instance.name(),
            left_behind(&self.instance)
        );
    }
}

/// Undoes the affinity of a window in this process, which the next core would inherit.
fn use_every_core() -> std::io::Result<()> {
    // SAFETY: the set is plain data that lives through the call; cores that do not exist are left out by the kernel.
    unsafe {
        let mut all: libc::cpu_set_t = std::mem::zeroed();
        (0..libc::CPU_SETSIZE as usize).for_each(|core| libc::CPU_SET(core, &mut all));
        match libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &all) {
            0 => Ok(()),
            _ => Err(std::io::Error::last_os_error()),
        }
    }
}

/// Lists the files of an instance in shared memory.
pub fn left_behind(instance: &Instance) -> Vec<String> {
    let prefix = instance.prefix();
    let names = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    let names = names.map(|e| e.file_name().to_string_lossy().into_owned());
    let folder = Some(instance.folder()).filter(|folder| folder.exists());
    names
        .filter(|n| n.starts_with(&prefix))
        .chain(folder.map(|folder| folder.display().to_string()))
        .collect()
}

/// Sends one command and waits for its answer: `Ok` with the first tick that used it, or the reasons against it.
pub fn ask(link: &mut Link, request: &Request) -> Result<u64, String> {
    ask_within(link, request, Duration::from_secs(5))
}

/// Loads a built-in scene. The answer comes once the core has built it, which is ordinary work and takes long on a busy
/// machine.
pub fn load_builtin(link: &mut Link, number: u32) -> Result<u64, String> {
    ask_within(link, &Request::LoadBuiltinScene(number), Duration::from_secs(60))
}

fn ask_within(link: &mut Link, request: &Request, limit: Duration) -> Result<u64, String> {
    let id = link.send(request).map_err(|e| e.to_string())?;
    let mut answer = None;
    until(limit, || {
        link.poll();
        answer = link.reply(id);
        answer.is_some()
    });
    let answer = answer.ok_or_else(|| format!("no answer to {:?}", request.kind()))?;
    answer.map_err(|refusal| refusal.text)
}

/// Reads the clock of the records.
pub fn now_ns() -> u64 {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the call only writes to `now`.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut now) };
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Returns a number from the environment, which lengthens a test, or the everyday one.
pub fn repeats(variable: &str, everyday: u64) -> u64 {
    let asked = std::env::var(variable).ok().and_then(|n| n.parse().ok());
    asked.unwrap_or(everyday)
}

/// A display without a screen, for windows; closed when dropped.
pub struct Display {
    server: Child,
    number: u32,
}

impl Display {
    pub fn open() -> Self {
        // The server picks a free number and writes it to its standard output.
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts: `make test` installs it");
        let mut line = String::new();
        let output = server.stdout.take().expect("piped");
        std::io::BufRead::read_line(&mut std::io::BufReader::new(output), &mut line).expect("Xvfb names its display");
        let number = line.trim().parse().expect("a display number");
        Self { server, number }
    }

    pub fn name(&self) -> String {
        format!(":{}", self.number)
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // SIGTERM lets the server remove its socket and lock file.
        // SAFETY: the child is ours and not yet waited for.
        unsafe { libc::kill(self.server.id() as libc::pid_t, libc::SIGTERM) };
        let _ = self.server.wait();
    }
}
