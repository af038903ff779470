//! Settings that the doctor makes, the only ones that it undoes. An undo runs as root, and any user may have written
//! its list.

use super::file::{Change, State};
use crate::doctor::tunable;
use crate::machine::Machine;
use rustix::fs::{self, Mode, OFlags, ResolveFlags};
use std::fs::File;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::fs::MetadataExt;

/// `f_type` of `statfs` for `/proc` and `/sys`.
const FILE_SYSTEMS: [u32; 2] = [0x9fa0, 0x6265_6572];
/// Bound on the length of a state, longer than the kernel's reason for a refusal.
const LONGEST_STATE: usize = 400;

/// Permitted values of a setting.
enum Values {
    Number,
    Word,
    Cores,
}

/// A setting by the shape of its path.
struct Setting {
    check: &'static str,
    values: Values,
    /// The doctor's value; `None` if it depends on the PC.
    wanted: Option<&'static str>,
}

impl Values {
    fn has(&self, text: &str) -> bool {
        let made_of = |longest: usize, allowed: fn(u8) -> bool| text.len() <= longest && text.bytes().all(allowed);
        match self {
            Self::Number => !text.is_empty() && is_number(text.strip_prefix('-').unwrap_or(text)),
            Self::Word => {
                !text.is_empty() && made_of(32, |b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
            }
            Self::Cores => {
                text.starts_with(|c: char| c.is_ascii_digit())
                    && made_of(512, |b| b.is_ascii_digit() || b == b',' || b == b'-')
            }
        }
    }
}

fn is_number(text: &str) -> bool {
    (1..=10).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_digit())
}

fn is_numbered(text: &str, name: &str) -> bool {
    text.strip_prefix(name).is_some_and(is_number)
}

fn setting(path: &str) -> Option<Setting> {
    use Values::{Cores, Number, Word};
    let (check, values, wanted) = match path.split('/').collect::<Vec<_>>()[..] {
        ["sys", "devices", "system", "cpu", core, "cpuidle", state, "disable"]
            if is_numbered(core, "cpu") && is_numbered(state, "state") =>
        {
            ("sleep states", Number, Some("1"))
        }
        ["proc", "sys", "kernel", "sched_rt_runtime_us"] => ("throttling", Number, Some("950000")),
        ["proc", "irq", number, "smp_affinity_list"] if is_number(number) => ("interrupts", Cores, None),
        _ => {
            let (check, wanted) = tunable::quiet(path)?;
            let values = if is_number(wanted) { Number } else { Word };
            (check, values, Some(wanted))
        }
    };
    Some(Setting { check, values, wanted })
}

/// Change that the doctor does not make.
#[derive(Debug, thiserror::Error)]
pub enum ForeignChange {
    /// Another setting.
    #[error("/{} is not a setting that the doctor makes", .0.escape_default())]
    Setting(String),
    /// A setting of another check.
    #[error("the doctor makes /{} in another check", .0.escape_default())]
    Check(String),
    /// Another value.
    #[error(
        "the doctor does not change /{} from \"{}\" to \"{}\"",
        .path.escape_default(), .before.escape_default(), .after.escape_default()
    )]
    Values {
        /// The setting.
        path: String,
        /// Value before.
        before: String,
        /// Value after.
        after: String,
    },
    /// Another text for its state.
    #[error("/{} has a state that the doctor does not write", .0.escape_default())]
    State(String),
}

/// Refuses a change that the doctor cannot have made.
pub fn check(change: &Change) -> Result<(), ForeignChange> {
    let path = change.path.clone();
    let Some(setting) = setting(&path) else {
        return Err(ForeignChange::Setting(path));
    };
    if change.check != setting.check {
        return Err(ForeignChange::Check(path));
    }
    let other = |value: &str| setting.wanted.is_some_and(|wanted| wanted != value);
    if !setting.values.has(&change.before) || !setting.values.has(&change.after) || other(&change.after) {
        let (before, after) = (change.before.clone(), change.after.clone());
        return Err(ForeignChange::Values { path, before, after });
    }
    match &change.state {
        State::Refused(text) | State::Foreign(text)
            if text.len() > LONGEST_STATE || text.chars().any(char::is_control) =>
        {
            Err(ForeignChange::State(path))
        }
        _ => Ok(()),
    }
}

/// Opens the file of a setting to write to it.
///
/// # Errors
/// If it is missing, is reached through a link other than that of a core to its frequency policy, or is not the
/// kernel's own.
pub fn open(machine: &Machine, path: &str) -> io::Result<File> {
    let (mount, rest) = path.split_once('/').ok_or(io::ErrorKind::NotFound)?;
    let flags = OFlags::PATH | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let folder = fs::open(machine.path(mount), flags, Mode::empty())?;
    let rest = of_policy(&folder, rest).unwrap_or_else(|| rest.to_owned());
    // Does not wait for a pipe in place of the file.
    let flags = OFlags::WRONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let resolve = ResolveFlags::BENEATH | ResolveFlags::NO_SYMLINKS | ResolveFlags::NO_MAGICLINKS;
    let file = File::from(fs::openat2(&folder, &*rest, flags, Mode::empty(), resolve)?);
    let about = file.metadata()?;
    if !about.is_file() || about.uid() != std::fs::metadata(machine.path(""))?.uid() {
        return Err(io::Error::other("not a file of the kernel, or not root's"));
    }
    if machine.is_this() && !FILE_SYSTEMS.contains(&(fs::fstatfs(&file)?.f_type as u32)) {
        return Err(io::Error::other("not in /proc or /sys"));
    }
    Ok(file)
}

/// Returns the same file in the folder of the frequency policy, to which the kernel links from the folder of a core.
fn of_policy(sys: &OwnedFd, path: &str) -> Option<String> {
    let (core, name) = path.split_once("/cpufreq/")?;
    let link = fs::readlinkat(sys, format!("{core}/cpufreq"), Vec::new()).ok()?;
    let policy = link.to_str().ok()?.strip_prefix("../cpufreq/")?;
    is_numbered(policy, "policy").then(|| format!("devices/system/cpu/cpufreq/{policy}/{name}"))
}

#[cfg(test)]
mod tests;
