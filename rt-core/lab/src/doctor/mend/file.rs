//! Changed settings, as the file from which they are undone.

use super::MendError;
use super::allowed::{self, ForeignChange};
use crate::doctor::tunable::{self, Tunable};
use crate::machine::Machine;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read, Write};
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::Path;

const SCHEMA: &str = "stylet.settings/1";
/// Most bytes read; a PC of 1,000 cores needs a tenth.
const MOST_BYTES: u64 = 4 << 20;

/// Problem with the file of an undo.
#[derive(Debug, thiserror::Error)]
pub enum UndoProblem {
    /// It cannot be read or written, or others can write it.
    #[error(transparent)]
    File(#[from] io::Error),
    /// Not a list of settings.
    #[error("not a file of settings: {0}")]
    Json(#[from] serde_json::Error),
    /// A list of another version.
    #[error("expected schema {SCHEMA}, found {0:?}")]
    Schema(String),
    /// A change that the doctor does not make.
    #[error(transparent)]
    Foreign(#[from] ForeignChange),
}

/// State of a change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    Planned,
    Applied,
    /// The kernel refused it, for this reason.
    Refused(String),
    Undone,
    /// Changed by others since, to this value; left alone.
    Foreign(String),
}

/// One setting.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    pub check: String,
    /// Path without the leading slash.
    pub path: String,
    pub before: String,
    pub after: String,
    pub state: State,
}

/// All changes in the order in which they are applied; undone in reverse.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Changes {
    schema: String,
    /// Start of the PC: a restart undoes the changes by itself.
    boot: String,
    pub changes: Vec<Change>,
}

fn boot() -> String {
    let id = std::fs::read_to_string("/proc/sys/kernel/random/boot_id");
    id.unwrap_or_default().trim().to_owned()
}

impl Changes {
    /// Plans the settings that are not met, without applying any.
    pub fn planned(tunables: &[Tunable]) -> Self {
        let open = tunables.iter().filter(|t| !t.is_met());
        Self {
            schema: SCHEMA.to_owned(),
            boot: boot(),
            changes: open
                .map(|t| Change {
                    check: t.check.to_owned(),
                    path: t.path.clone(),
                    before: t.now.clone(),
                    after: t.wanted.clone(),
                    state: State::Planned,
                })
                .collect(),
        }
    }

    /// Reads a list. A list that others can write, or that names anything but this program's settings, is refused.
    pub fn read(path: &Path) -> Result<Self, MendError> {
        Self::open(path, false).map(|(read, _)| read)
    }

    /// Returns the list and its file, which receives the states of an undo: its name may point elsewhere by then.
    pub fn open_to_undo(path: &Path) -> Result<(Self, File), MendError> {
        Self::open(path, true)
    }

    fn open(path: &Path, is_written: bool) -> Result<(Self, File), MendError> {
        checked(path, is_written).map_err(|why| MendError::of_undo(path, why))
    }

    /// Rewrites the list into its file.
    pub fn rewrite(&self, path: &Path, file: &File) -> Result<(), MendError> {
        let text = self.text();
        let written = file.write_all_at(text.as_bytes(), 0);
        let written = written.and_then(|()| file.set_len(text.len() as u64));
        written.map_err(|why| MendError::of_undo(path, why.into()))
    }

    pub fn text(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// Writes each value and reads it back.
    pub fn apply(&mut self, machine: &Machine) {
        for change in &mut self.changes {
            change.state = match put(machine, &change.path, &change.after) {
                Ok(()) => State::Applied,
                Err(why) => State::Refused(why),
            };
        }
    }

    /// Restores each applied setting, unless others have changed it since.
    ///
    /// A change that is only planned may have been made: the program was killed between both writes of its file.
    pub fn undo(&mut self, machine: &Machine) {
        for change in self.changes.iter_mut().rev() {
            if !matches!(change.state, State::Applied | State::Planned | State::Foreign(_)) {
                continue;
            }
            if let Err(why) = allowed::open(machine, &change.path) {
                change.state = State::Refused(why.to_string());
                continue;
            }
            let now = tunable::value(machine, &change.path).unwrap_or_default();
            change.state = if now == change.before {
                State::Undone
            } else if now != change.after {
                State::Foreign(now)
            } else {
                match put(machine, &change.path, &change.before) {
                    Ok(()) => State::Undone,
                    Err(why) => State::Refused(why),
                }
            };
        }
    }

    pub fn any_refused(&self) -> bool {
        let refused = |c: &Change| matches!(c.state, State::Refused(_) | State::Foreign(_));
        self.changes.iter().any(refused)
    }

    /// True if none of it is in force, or the PC was restarted since.
    pub fn is_undone(&self) -> bool {
        let done = |c: &Change| matches!(c.state, State::Undone | State::Refused(_));
        self.boot != boot() || self.changes.iter().all(done)
    }

    /// Returns a line for each.
    pub fn words(&self) -> String {
        let line = |c: &Change| {
            let state = match &c.state {
                State::Planned => "planned".to_owned(),
                State::Applied => "changed".to_owned(),
                State::Undone => "undone".to_owned(),
                State::Refused(why) => format!("REFUSED: {why}"),
                State::Foreign(now) => format!("LEFT ALONE: is {now} now, changed by somebody else"),
            };
            let (from, to) = match c.state {
                State::Undone => (&c.after, &c.before),
                _ => (&c.before, &c.after),
            };
            format!("{:<16} /{}: {from} -> {to}   {state}\n", c.check, c.path)
        };
        self.changes.iter().map(line).collect()
    }
}

fn checked(path: &Path, is_written: bool) -> Result<(Changes, File), UndoProblem> {
    let (text, file) = own_text(path, is_written)?;
    let read: Changes = serde_json::from_str(&text)?;
    if read.schema != SCHEMA {
        return Err(UndoProblem::Schema(read.schema));
    }
    read.changes.iter().try_for_each(allowed::check)?;
    Ok((read, file))
}

/// Reads the text of a regular file that no other user could have written; returns file and text.
fn own_text(path: &Path, is_written: bool) -> io::Result<(String, File)> {
    let flags = libc::O_NOFOLLOW | libc::O_NONBLOCK;
    let file = File::options()
        .read(true)
        .write(is_written)
        .custom_flags(flags)
        .open(path)?;
    let about = file.metadata()?;
    // SAFETY: neither has preconditions.
    let (user, group) = unsafe { (libc::geteuid(), libc::getegid()) };
    let by_others = about.mode() & 0o002 != 0 || about.mode() & 0o020 != 0 && about.gid() != group;
    if !about.is_file() || about.uid() != user || by_others {
        let why = "not a file that its user alone can write: an undo takes the list that 'rt-core doctor --apply' wrote, \
                   as the same user";
        return Err(io::Error::other(why));
    }
    let mut text = String::new();
    (&file).take(MOST_BYTES).read_to_string(&mut text)?;
    Ok((text, file))
}

fn put(machine: &Machine, path: &str, value: &str) -> Result<(), String> {
    write(machine, path, value).map_err(|e| e.to_string())?;
    match tunable::value(machine, path) {
        Some(now) if now == value => Ok(()),
        now => Err(format!("the kernel took it, and reports {:?}", now.unwrap_or_default())),
    }
}

fn write(machine: &Machine, path: &str, value: &str) -> io::Result<()> {
    let mut file = allowed::open(machine, path)?;
    if !machine.is_this() {
        // A kernel file has no length.
        file.set_len(0)?;
    }
    file.write_all(value.as_bytes())
}
