//! A core, a lab, and the two sides of the relay, each ended when dropped.

use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use stylet_relay::keys::{Invitation, Lab, Role, Validity, write_invitation};
use stylet_shm_schema::Instance;
pub use stylet_test_kit::{program, until};

/// Returns a number unique in this process.
pub fn fresh() -> u32 {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// A unique name; its files are removed when it is dropped, so declare it before its users.
pub struct Named(pub Instance);

impl Named {
    pub fn new() -> Self {
        Self(Instance::new(&format!("r{}-{}", std::process::id(), fresh())).expect("letters, digits and a hyphen"))
    }
}

impl Drop for Named {
    fn drop(&mut self) {
        until(Duration::from_secs(2), || {
            self.0.sweep();
            !self.0.folder().exists()
        });
    }
}

/// Returns an empty folder for one test's files.
pub fn scratch(name: &str) -> PathBuf {
    stylet_test_kit::scratch(&format!("relay-{name}-{}", fresh()))
}

/// A process of the test, with its output in a file.
pub struct Running {
    pub child: Child,
    log: PathBuf,
}

impl Running {
    pub fn start(command: &mut Command, log: PathBuf) -> Self {
        Self::start_with(command, Stdio::null(), log)
    }

    pub fn start_with(command: &mut Command, input: Stdio, log: PathBuf) -> Self {
        let out = File::create(&log).expect("the log can be written");
        let err = out.try_clone().expect("a second handle");
        // SAFETY: between fork and exec it only makes a system call.
        unsafe { command.pre_exec(end_with_the_test) };
        let child = command
            .stdin(input)
            .stdout(out)
            .stderr(err)
            .spawn()
            .expect("the program starts");
        Self { child, log }
    }

    pub fn signal(&self, signal: i32) {
        // SAFETY: a signal to a child that was not waited for yet.
        unsafe { libc::kill(self.child.id() as libc::pid_t, signal) };
    }

    pub fn log(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default()
    }

    pub fn says(&self, words: &str, limit: Duration) -> bool {
        until(limit, || self.log().contains(words))
    }
}

/// Ends the process with its test: a killed test cannot end it.
fn end_with_the_test() -> std::io::Result<()> {
    // SAFETY: a system call with plain arguments.
    match unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM) } {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error()),
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.signal(libc::SIGCONT);
        self.signal(libc::SIGTERM);
        let ended = until(Duration::from_secs(5), || matches!(self.child.try_wait(), Ok(Some(_))));
        if !ended {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// Starts the core of an instance.
pub fn core(named: &Named, options: &[&str]) -> Running {
    let folder = scratch("core");
    let mut command = Command::new(program("rt-core"));
    command
        .args([
            "--instance",
            named.0.name(),
            "--exit-with-parent",
            "--rt-if-allowed",
            "--flight-dir",
        ])
        .arg(folder.join("flights"))
        .args(options);
    Running::start(&mut command, folder.join("log"))
}

/// A lab's keys, and a free port of this machine.
pub struct Keys {
    pub folder: PathBuf,
    pub lab: Lab,
    pub port: u16,
}

impl Keys {
    pub fn new() -> Self {
        Self::reached_at(&["127.0.0.1".to_owned()])
    }

    /// Makes the keys of a machine with these addresses.
    pub fn reached_at(hosts: &[String]) -> Self {
        let folder = scratch("lab");
        let lab = Lab::new(&folder);
        lab.make(hosts).expect("keys");
        let socket = std::net::UdpSocket::bind("127.0.0.1:0").expect("a free port");
        let port = socket.local_addr().expect("bound").port();
        Self { folder, lab, port }
    }

    pub fn invite(&self, name: &str, role: Role, validity: Validity) -> PathBuf {
        self.invite_to(name, role, validity, "127.0.0.1")
    }

    pub fn invite_to(&self, name: &str, role: Role, validity: Validity, host: &str) -> PathBuf {
        let server = format!("{host}:{}", self.port);
        let invited = self.lab.invite(name, role, &server, validity).expect("invited");
        let path = self.folder.join(format!("{name}.invitation"));
        keep(&path, &invited);
        path
    }

    pub fn serving(&self, named: &Named, host: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_relay"));
        let listen = format!("{host}:{}", self.port);
        command
            .args(["serve", "--instance", named.0.name(), "--listen", &listen, "--keys"])
            .arg(&self.folder);
        command
    }

    pub fn serve(&self, named: &Named) -> Running {
        self.serve_on(named, "127.0.0.1")
    }

    pub fn serve_on(&self, named: &Named, host: &str) -> Running {
        let served = Running::start(&mut self.serving(named, host), scratch("serve").join("log"));
        assert!(
            served.says("serving instance", Duration::from_secs(10)),
            "{}",
            served.log()
        );
        served
    }
}

/// Saves an invitation, with its code next to it.
pub fn keep(path: &Path, (invitation, code): &(Invitation, String)) {
    write_invitation(path, invitation).expect("written");
    std::fs::write(path.with_extension("code"), code).expect("written");
}

/// Returns the code, as typed by the recipient.
pub fn code(invitation: &Path) -> File {
    File::open(invitation.with_extension("code")).expect("kept beside the invitation")
}

pub fn join(invitation: &Path, named: &Named) -> Running {
    let mut command = joining(invitation, named);
    Running::start_with(&mut command, code(invitation).into(), scratch("join").join("log"))
}

pub fn joining(invitation: &Path, named: &Named) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relay"));
    command
        .args(["join", "--instance", named.0.name(), "--invitation"])
        .arg(invitation);
    command
}

/// Returns the output of `relay lease`.
pub fn lease(named: &Named, words: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_relay"))
        .arg("lease")
        .args(words)
        .args(["--instance", named.0.name()])
        .output()
        .expect("the relay runs");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Reads a saved invitation.
pub fn invitation(path: &Path) -> Invitation {
    Invitation::read(path).expect("an invitation")
}
