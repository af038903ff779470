//! `rt-core` with file capabilities, started by a user without rights: it loads nothing named by a variable or an
//! option.
//!
//! It used to load `STYLET_LIBHD`, so that any user's code had the program's capabilities.

use std::ffi::CString;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use stylet_test_kit::program;

/// User id of "nobody".
const NOBODY: u32 = 65534;
/// Each of these names a folder with a library under every name that is searched for, or one of the libraries.
const FOLDERS: [&str; 8] = [
    "HOME",
    "GTDD_HOME",
    "XDG_STATE_HOME",
    "XDG_CACHE_HOME",
    "XDG_CONFIG_HOME",
    "XDG_RUNTIME_DIR",
    "TMPDIR",
    "LD_LIBRARY_PATH",
];
const FILES: [(&str, &str); 3] = [
    ("STYLET_LIBHD", "libHD.so"),
    ("STYLET_LIBDRD", "libdrd.so"),
    ("LD_PRELOAD", "libHD.so"),
];

/// Counts files opened, read or made in a folder by any process.
struct Watch(libc::c_int);

impl Watch {
    fn of(folder: &Path) -> Self {
        // SAFETY: inotify_init1 has no preconditions.
        let watch = Self(unsafe { libc::inotify_init1(libc::IN_NONBLOCK | libc::IN_CLOEXEC) });
        let name = CString::new(folder.as_os_str().as_bytes()).expect("no zero");
        let what = libc::IN_OPEN | libc::IN_ACCESS | libc::IN_CREATE;
        // SAFETY: `name` ends with a zero.
        assert!(unsafe { libc::inotify_add_watch(watch.0, name.as_ptr(), what) } >= 0);
        watch
    }

    fn saw_something(&self) -> bool {
        let mut bytes = [0_u8; 4096];
        // SAFETY: `bytes` is valid for writes of its length.
        unsafe { libc::read(self.0, bytes.as_mut_ptr().cast(), bytes.len()) > 0 }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        // SAFETY: the descriptor is ours.
        unsafe { libc::close(self.0) };
    }
}

struct Trap {
    folder: tempfile::TempDir,
}

impl Trap {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let trap = Self { folder };
        std::fs::create_dir(trap.path("trap")).expect("made");
        for (from, to) in [
            ("rt-core", "plain"),
            ("rt-core", "capable"),
            ("libfake_hd.so", "trap/libHD.so"),
            ("libfake_drd.so", "trap/libdrd.so"),
            ("libfake_drd.so", "trap/libdhd.so"),
        ] {
            std::fs::copy(program(from), trap.path(to)).expect("copied");
        }
        for open in ["", "trap"] {
            std::fs::set_permissions(trap.path(open), std::fs::Permissions::from_mode(0o755)).expect("ours");
        }
        trap
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs a copy of the program as a user without rights; returns its output, and whether it accessed the folder.
    fn run(&self, copy: &str, options: &[&str], variables: &[(&str, PathBuf)]) -> (String, bool) {
        let watch = Watch::of(&self.path("trap"));
        let mut command = Command::new(self.path(copy));
        command
            .args(options)
            .env_clear()
            .current_dir("/")
            .uid(NOBODY)
            .gid(NOBODY);
        let output = command.envs(variables.iter().cloned()).output().expect("it starts");
        let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        (text, watch.saw_something())
    }
}

/// Makes a copy of the program with capabilities, and one without; `None` if they cannot be granted.
fn trap() -> Option<Trap> {
    // SAFETY: geteuid has no preconditions.
    if unsafe { libc::geteuid() } != 0 {
        println!("skipped: only root gives a file capabilities");
        return None;
    }
    let trap = Trap::new();
    let given = Command::new("setcap")
        .arg("cap_sys_nice,cap_ipc_lock=ep")
        .arg(trap.path("capable"))
        .status();
    if !given.is_ok_and(|status| status.success()) {
        println!("skipped: setcap (package libcap2-bin) is missing, or the file system keeps no capabilities");
        return None;
    }
    Some(trap)
}

#[test]
fn a_capable_program_loads_nothing_that_a_variable_names() {
    let Some(trap) = trap() else { return };
    let folders = FOLDERS.iter().map(|name| (*name, trap.path("trap")));
    let files = FILES.iter().map(|(name, file)| (*name, trap.path("trap").join(file)));
    for (name, value) in folders.chain(files) {
        for options in [
            ["devices"].as_slice(),
            &["doctor"],
            &["--instance", "rights-trap", "--device", "phantom"],
        ] {
            let (text, looked) = trap.run("capable", options, &[(name, value.clone())]);
            assert!(!looked, "{name} with {options:?}: {text}");
        }
    }
    // The same trap closes on a program without rights.
    for (name, file) in FILES {
        let (text, looked) = trap.run("plain", &["devices"], &[(name, trap.path("trap").join(file))]);
        assert!(looked, "{name}: {text}");
    }
}

#[test]
fn a_capable_program_refuses_a_library_that_an_option_names() {
    let Some(trap) = trap() else { return };
    for (option, file) in [("--libhd", "libHD.so"), ("--libdrd", "libdrd.so")] {
        let path = trap.path("trap").join(file);
        let options = ["devices", option, path.to_str().expect("text")];
        let (text, looked) = trap.run("capable", &options, &[]);
        assert!(!looked && text.contains("more rights than its user"), "{text}");
        let (text, looked) = trap.run("plain", &options, &[]);
        assert!(looked && !text.contains("more rights"), "{text}");
    }
}
