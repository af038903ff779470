//! Environment variables that a desktop session sets, and whose absence, as in `ssh` or `su`, makes
//! libraries write to the terminal.

use std::ffi::{OsStr, OsString};
use std::path::Path;

const RUNTIME_FOLDER: &str = "XDG_RUNTIME_DIR";

/// Sets the folder for the user's sockets if no session did. Libraries look for the desktop's
/// sockets there; without it, graphics drivers write an error to the terminal each time.
pub fn name_runtime_folder() {
    if let Some(folder) = missing_runtime_folder(std::env::var_os(RUNTIME_FOLDER).as_deref()) {
        // SAFETY: `main` calls this before any other thread starts.
        unsafe { std::env::set_var(RUNTIME_FOLDER, folder) };
    }
}

/// Returns the folder that sessions use, unless `named` is one. It need not exist, because nothing
/// is created in it.
fn missing_runtime_folder(named: Option<&OsStr>) -> Option<OsString> {
    let is_named = named.is_some_and(|folder| Path::new(folder).is_absolute());
    // SAFETY: no preconditions.
    (!is_named).then(|| format!("/run/user/{}", unsafe { libc::getuid() }).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_runtime_folder_gets_the_session_default() {
        assert_eq!(missing_runtime_folder(Some(OsStr::new("/run/user/1000"))), None);
        for none in [None, Some(OsStr::new("")), Some(OsStr::new("run"))] {
            let folder = missing_runtime_folder(none).expect("a folder");
            assert!(Path::new(&folder).starts_with("/run/user"), "{folder:?}");
        }
    }
}
