//! Hardens the environment of a program with more rights than its user: no variable of the user names a file in it.

use std::ffi::{CStr, OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

/// Variables that name no file.
const KEPT: [&str; 7] = [
    "COLUMNS",
    "DISPLAY",
    "LANG",
    "LANGUAGE",
    "NO_COLOR",
    "TERM",
    "WAYLAND_DISPLAY",
];
const RUNTIME_FOLDER: &str = "XDG_RUNTIME_DIR";

/// Returns the user's folder of this variable, by default one below the home folder; `None` for a user without a home.
pub(crate) fn user_folder(variable: &str, below_home: &str) -> Option<PathBuf> {
    let from = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let own = from(variable).filter(|folder| folder.is_absolute());
    own.or_else(|| Some(from("HOME")?.join(below_home)))
}

/// Removes the user's variables if the kernel gave this program rights that its user lacks (`setcap`). Call it first in
/// `main`.
///
/// Paths then come from the system: the home folder from its list of users, programs from `/usr/bin`.
pub fn cleanse() {
    if !stylet_hw::has_more_rights_than_user() {
        return;
    }
    // SAFETY: getuid has no preconditions.
    let user = unsafe { libc::getuid() };
    for (name, value) in std::env::vars_os() {
        if !is_kept(&name, &value, user) {
            // SAFETY: no other thread runs yet.
            unsafe { std::env::remove_var(name) };
        }
    }
    // SAFETY: as above.
    unsafe { std::env::set_var("PATH", "/usr/bin:/bin") };
    if let Some(home) = home(user) {
        // SAFETY: as above.
        unsafe { std::env::set_var("HOME", home) };
    }
}

fn is_kept(name: &OsStr, value: &OsStr, user: libc::uid_t) -> bool {
    if value.as_bytes().contains(&b'/') {
        // The folder in which hosts meet the core: only the system's own for this user.
        return name == RUNTIME_FOLDER && value.as_bytes() == format!("/run/user/{user}").as_bytes();
    }
    KEPT.iter().any(|kept| name == *kept) || name.as_bytes().starts_with(b"LC_")
}

fn home(user: libc::uid_t) -> Option<PathBuf> {
    // SAFETY: no other thread runs yet, so that none overwrites the entry.
    let entry = unsafe { libc::getpwuid(user).as_ref() }?;
    // SAFETY: the system's entry has a home folder that ends with zero.
    let home = unsafe { CStr::from_ptr(entry.pw_dir) };
    Some(PathBuf::from(OsString::from(OsStr::from_bytes(home.to_bytes()))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_variable_that_names_a_file_is_kept() {
        let kept = |name: &str, value: &str| is_kept(OsStr::new(name), OsStr::new(value), 1000);
        for (name, value) in [
            ("STYLET_LIBHD", "/tmp/evil.so"),
            ("STYLET_LIBHD", "evil.so"),
            ("STYLET_LIBDRD", "evil.so"),
            ("STYLET_HAPLY_URL", "ws://localhost:1"),
            ("HOME", "/tmp"),
            ("GTDD_HOME", "/tmp"),
            ("XDG_STATE_HOME", "/tmp"),
            ("XDG_CACHE_HOME", "/tmp"),
            ("TMPDIR", "/tmp"),
            ("PATH", "/tmp"),
            ("TZ", "/tmp/zone"),
            ("LC_ALL", "/tmp/locale"),
            (RUNTIME_FOLDER, "/tmp"),
            (RUNTIME_FOLDER, "/run/user/1001"),
        ] {
            assert!(!kept(name, value), "{name}={value}");
        }
        for (name, value) in [
            ("TERM", "xterm"),
            ("LC_ALL", "C.UTF-8"),
            ("DISPLAY", ":0"),
            (RUNTIME_FOLDER, "/run/user/1000"),
        ] {
            assert!(kept(name, value), "{name}={value}");
        }
    }
}
