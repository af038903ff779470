//! The keys of a lab: its authority, the certificate of the machine with the core, and its members with their roles.
//!
//! A member's certificate names a *seat*, a number that is never reused; its member, role and expiry are in
//! `members.json` next to the authority's key. A role is therefore the lab's present decision, not that of the day on
//! which the certificate was made.

mod certificate;
mod code;

use crate::RelayError;
pub use certificate::Validity;
use certificate::{Authority, Subject};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Number of seats of a lab, the most certificates of one authority.
pub const SEATS: u16 = 256;

/// Certificate, key and authority of one side, PEM.
#[derive(Clone)]
pub struct Identity {
    /// The certificate of the lab's authority.
    pub authority: String,
    /// This side's certificate.
    pub certificate: String,
    /// This side's key.
    pub key: String,
}

/// Returns the common name of a seat's certificate.
pub fn seat_name(seat: u16) -> String {
    format!("seat-{seat:03}")
}

/// Parses the seat of a common name.
pub fn seat_of(name: &str) -> Option<u16> {
    let seat = name.strip_prefix("seat-")?.parse().ok()?;
    ((1..=SEATS).contains(&seat) && seat_name(seat) == name).then_some(seat)
}

/// What a member may do; see `serve::rights`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Moves the needle, while it has the lease.
    Operator,
    /// Stops the hand, changes parameters and scene.
    Instructor,
    /// Watches.
    Observer,
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Operator => "operator",
            Self::Instructor => "instructor",
            Self::Observer => "observer",
        })
    }
}

/// A person with a certificate.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Member {
    /// Number of the seat, 1 to [`SEATS`].
    pub seat: u16,
    /// Name for people.
    pub name: String,
    /// Role of the member.
    pub role: Role,
    /// End of the certificate, seconds since 1970.
    pub until_s: i64,
    /// The member is refused from now on.
    pub revoked: bool,
}

impl Member {
    /// Returns why the member is refused.
    pub fn why_closed(&self, now_s: i64) -> Option<&'static str> {
        if self.revoked {
            return Some("the certificate is revoked");
        }
        (now_s > self.until_s).then_some("the certificate has expired")
    }
}

/// Seconds since 1970; a clock before that makes every certificate invalid.
pub fn now_s() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(i64::MAX, |t| t.as_secs() as i64)
}

/// All persons with a certificate.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Members {
    /// Members in the order of their seats.
    pub members: Vec<Member>,
}

impl Members {
    /// Returns the member of a seat, revoked or not.
    pub fn at(&self, seat: u16) -> Option<&Member> {
        self.members.iter().find(|member| member.seat == seat)
    }
}

/// A member's file: all that `relay join` needs.
#[derive(Clone, Serialize, Deserialize)]
pub struct Invitation {
    /// Address of the lab's machine, with or without a port.
    pub server: String,
    /// Name of the member.
    pub name: String,
    /// Role of the member.
    pub role: Role,
    /// The seat.
    pub seat: u16,
    /// End of the certificate, seconds since 1970.
    pub until_s: i64,
    /// Certificate of the lab's authority, PEM.
    pub authority: String,
    /// Certificate of the member, PEM.
    pub certificate: String,
    /// Key of the member, PEM, sealed with the code of the invitation: whoever has both is the member.
    pub sealed_key: String,
}

impl Invitation {
    /// Reads a file written by `relay keys invite`.
    pub fn read(path: &Path) -> Result<Self, RelayError> {
        let text = read(path)?;
        let path = path.to_owned();
        match serde_json::from_str::<Self>(&text) {
            Ok(invitation) if (1..=SEATS).contains(&invitation.seat) => Ok(invitation),
            Ok(Self { seat, .. }) => Err(RelayError::NoSeat { path, seat }),
            Err(why) => Err(RelayError::NoInvitation { path, why }),
        }
    }

    /// Returns certificate, key and authority, opened with the code.
    pub fn identity(&self, code: &str) -> Result<Identity, RelayError> {
        Ok(Identity {
            authority: self.authority.clone(),
            certificate: self.certificate.clone(),
            key: code::open(&self.sealed_key, code)?,
        })
    }
}

/// The folder with a lab's keys.
#[derive(Clone, Debug)]
pub struct Lab {
    folder: PathBuf,
}

fn failed(path: &Path) -> impl FnOnce(std::io::Error) -> RelayError {
    let path = path.to_owned();
    move |why| RelayError::File { path, why }
}

fn read(path: &Path) -> Result<String, RelayError> {
    fs::read_to_string(path).map_err(failed(path))
}

/// Writes atomically to a file readable only by its owner.
fn write(path: &Path, text: &str) -> Result<(), RelayError> {
    let beside = path.with_extension("new");
    let _ = fs::remove_file(&beside);
    let file = fs::OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(&beside);
    let written = file.and_then(|mut file| file.write_all(text.as_bytes()).and_then(|()| file.sync_all()));
    written.and_then(|()| fs::rename(&beside, path)).map_err(failed(path))
}

fn write_json(path: &Path, content: &impl Serialize) -> Result<(), RelayError> {
    let text = serde_json::to_string_pretty(content).map_err(|why| RelayError::Json {
        path: path.to_owned(),
        why,
    })?;
    write(path, &text)
}

impl Lab {
    /// Returns the lab in `folder`.
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
        }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Makes an authority, and the certificate of the machine with the core under the names and addresses in `hosts`.
    pub fn make(&self, hosts: &[String]) -> Result<(), RelayError> {
        if self.file("authority.key").exists() {
            return Err(RelayError::LabExists(self.folder.clone()));
        }
        fs::create_dir_all(&self.folder).map_err(failed(&self.folder))?;
        let authority = Authority::make()?;
        let (certificate, key) = authority.sign(&Subject::Machine(hosts), Validity::days(3650))?;
        write(&self.file("authority.pem"), &authority.certificate)?;
        write(&self.file("authority.key"), &authority.key)?;
        write(&self.file("relay.pem"), &certificate)?;
        write(&self.file("relay.key"), &key)?;
        self.keep(&Members::default())
    }

    /// Returns certificate, key and authority of the machine with the core.
    pub fn identity(&self) -> Result<Identity, RelayError> {
        let path = self.file("authority.pem");
        Ok(Identity {
            authority: fs::read_to_string(&path).map_err(|why| RelayError::NoLab { path, why })?,
            certificate: read(&self.file("relay.pem"))?,
            key: read(&self.file("relay.key"))?,
        })
    }

    /// Returns all persons with a certificate.
    pub fn members(&self) -> Result<Members, RelayError> {
        let path = self.file("members.json");
        serde_json::from_str(&read(&path)?).map_err(|why| RelayError::Json { path, why })
    }

    fn keep(&self, members: &Members) -> Result<(), RelayError> {
        write_json(&self.file("members.json"), members)
    }

    /// Makes a member's key and certificate, and the code that opens the key. Names, like seats, are used once.
    pub fn invite(
        &self,
        name: &str,
        role: Role,
        server: &str,
        validity: Validity,
    ) -> Result<(Invitation, String), RelayError> {
        let mut members = self.members()?;
        if name.is_empty() || name.chars().count() > 40 || name.chars().any(char::is_control) {
            return Err(RelayError::Name);
        }
        if members.members.iter().any(|m| m.name == name && !m.revoked) {
            return Err(RelayError::NameTaken(name.to_owned()));
        }
        let seat = members.members.iter().map(|m| m.seat).max().unwrap_or(0) + 1;
        if seat > SEATS {
            return Err(RelayError::NoSeatLeft(SEATS));
        }
        let (authority, key) = (read(&self.file("authority.pem"))?, read(&self.file("authority.key"))?);
        let signer = Authority {
            certificate: authority,
            key,
        };
        let (certificate, key) = signer.sign(&Subject::Seat(seat), validity)?;
        let code = code::make()?;
        let sealed_key = code::seal(&key, &code)?;
        let until_s = validity.until_s();
        members.members.push(Member {
            seat,
            name: name.to_owned(),
            role,
            until_s,
            revoked: false,
        });
        self.keep(&members)?;
        let invitation = Invitation {
            server: server.to_owned(),
            name: name.to_owned(),
            role,
            seat,
            until_s,
            authority: signer.certificate,
            certificate,
            sealed_key,
        };
        Ok((invitation, code))
    }

    /// Revokes all members of that name; returns their number.
    pub fn revoke(&self, name: &str) -> Result<usize, RelayError> {
        let mut members = self.members()?;
        let mut count = 0;
        for member in members.members.iter_mut().filter(|m| m.name == name && !m.revoked) {
            (member.revoked, count) = (true, count + 1);
        }
        match count {
            0 => Err(RelayError::NoMember(name.to_owned())),
            _ => self.keep(&members).map(|()| count),
        }
    }
}

/// Writes an invitation readable only by its owner.
pub fn write_invitation(path: &Path, invitation: &Invitation) -> Result<(), RelayError> {
    write_json(path, invitation)
}

#[cfg(test)]
mod tests;
