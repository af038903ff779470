//! Reasons why the relay ended or did not begin.

use std::error::Error;
use std::io;
use std::path::PathBuf;
use stylet_manual::ManualError;
use stylet_ports::ServiceError;
use stylet_shm_schema::InstanceError;

/// Error of zenoh.
type NetError = Box<dyn Error + Send + Sync>;

/// Reason why the relay ended or did not begin; the text says what to do.
#[derive(Debug, thiserror::Error)]
pub enum RelayError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// A service of the core cannot be offered or read.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// The manual cannot be written.
    #[error(transparent)]
    Manual(#[from] ManualError),
    /// A file cannot be read or written.
    #[error("{}: {why}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        why: io::Error,
    },
    /// A file of the lab is damaged.
    #[error("{}: {why}", .path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Error of the reader.
        why: serde_json::Error,
    },
    /// The folder has no keys.
    #[error("{}: {why}. 'relay keys new --host ADDRESS' makes a lab's keys", .path.display())]
    NoLab {
        /// The first file of a lab.
        path: PathBuf,
        /// Error of the system.
        why: io::Error,
    },
    /// The folder has keys.
    #[error("{}: there is a lab here already; its members would be shut out. Choose another folder with --keys", .0.display())]
    LabExists(PathBuf),
    /// Not an invitation.
    #[error("{}: not an invitation of 'relay keys invite': {why}", .path.display())]
    NoInvitation {
        /// The file.
        path: PathBuf,
        /// Error of the reader.
        why: serde_json::Error,
    },
    /// An invitation to a seat that no lab has.
    #[error("{}: there is no seat {seat}", .path.display())]
    NoSeat {
        /// The file.
        path: PathBuf,
        /// Number of the seat.
        seat: u16,
    },
    /// An empty or too long name.
    #[error("a name has 1 to 40 characters")]
    Name,
    /// A member has that name.
    #[error("{0} has a certificate; revoke it first ('relay keys revoke'), or use another name")]
    NameTaken(String),
    /// No member has that name.
    #[error("nobody of the name {0} has a certificate: see 'relay keys list'")]
    NoMember(String),
    /// Every seat has been given.
    #[error("all {0} seats have been given: make a new lab")]
    NoSeatLeft(u16),
    /// No certificate could be made.
    #[error("no certificate could be made: {0}")]
    Certificate(#[from] rcgen::Error),
    /// The kernel gives no random numbers.
    #[error("this machine gives no random numbers")]
    NoRandom,
    /// Another code, or a damaged invitation.
    #[error("the code does not open this invitation: 'relay keys invite' printed it when it made the file")]
    WrongCode,
    /// The code cannot be read from the standard input.
    #[error("the code of the invitation cannot be read: {0}")]
    Code(io::Error),
    /// No relay of the instance takes orders.
    #[error("no relay answers for instance \"{instance}\" ({why}): start 'relay serve' or 'relay join' first")]
    NoRelay {
        /// Name of the instance.
        instance: String,
        /// Error of the system.
        why: io::Error,
    },
    /// The addresses cannot be listened on.
    #[error(
        "cannot listen on {addresses}: {why}. Is another relay running, or does 'relay keys new' still have to make this machine's certificate?"
    )]
    Listen {
        /// The addresses.
        addresses: String,
        /// Error of zenoh.
        why: NetError,
    },
    /// The session with the server cannot be opened.
    #[error("cannot connect to {server}: {why}")]
    Connect {
        /// Address of the server.
        server: String,
        /// Error of zenoh.
        why: NetError,
    },
    /// Messages cannot be received.
    #[error("cannot hear {key}: {why}")]
    Hear {
        /// Key of the messages.
        key: String,
        /// Error of zenoh.
        why: NetError,
    },
    /// The thread that opens a session panicked.
    #[error("the connection ended by itself")]
    ConnectionEnded,
    /// The process that serves cannot be started or observed.
    #[error("the server cannot be started: {0}")]
    Server(io::Error),
    /// The process that serves cannot serve.
    #[error("the server ended; what it printed says why")]
    ServerEnded,
    /// No thread could be started.
    #[error("no thread could be started: {0}")]
    Thread(io::Error),
    /// The signals that end a program cannot be received.
    #[error("signals: {0}")]
    Signals(io::Error),
}
