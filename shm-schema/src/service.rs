//! Names and configuration of every service, so that both programs meet without reading a foreign file.

use crate::*;
use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder, NodeState, NodeView};
use iceoryx2::prelude::{
    CallbackProgression, FileName, LogLevel, Path, SemanticString, ServiceName, SignalHandlingMode, set_log_level,
};
use iceoryx2::service::ipc;
use iceoryx2::service::port_factory::{blackboard, publish_subscribe};
use std::time::Duration;

/// The form of service that both programs use.
pub type Ipc = ipc::Service;
/// A service of single values.
pub type Plain<T> = publish_subscribe::PortFactory<Ipc, T, ()>;
/// A service of slices under a header.
pub type Slices<T, H> = publish_subscribe::PortFactory<Ipc, [T], H>;
/// The board that holds the latest state.
pub type StateBoard = blackboard::PortFactory<Ipc, u64>;

/// The only key on the board.
pub const STATE_KEY: u64 = 0;

/// Records in one batch at most.
pub const MAX_BATCH: usize = 32;
/// A batch that is not full is sent after this time, so that the queue of batches holds a known time.
pub const BATCH_EVERY: Duration = Duration::from_millis(20);
/// Batches that a slow host may be behind before the oldest is dropped: 12 s. The memory for all hosts is 35 MB in `/dev/shm`.
pub const RECORD_BUFFER: usize = 600;
/// Snapshots that the bridge loans ahead.
pub const SNAPSHOTS_AHEAD: usize = 4;
/// Hosts at once.
pub const MAX_HOSTS: usize = 6;

/// Why shared memory could not be used; the text says what to do.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ServiceError(pub String);

fn failed(what: &str, why: impl std::fmt::Debug) -> ServiceError {
    ServiceError(format!(
        "{what}: {why:?}. Both programs must run as the same user and come from the same build, and /dev/shm needs room (df -h /dev/shm)"
    ))
}

/// Where two programs meet: the same user and the same instance name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance(String);

impl Instance {
    /// Letters, digits and `-`, 1 to 24 of them.
    pub fn new(name: &str) -> Result<Self, ServiceError> {
        let fits = (1..=24).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-');
        if fits {
            Ok(Self(name.to_owned()))
        } else {
            Err(ServiceError(format!(
                "instance name {name:?}: use 1 to 24 letters, digits or '-'"
            )))
        }
    }

    /// The name as typed.
    pub fn name(&self) -> &str {
        &self.0
    }

    /// Folder of the management files, on tmpfs because iceoryx2 syncs them.
    pub fn root(&self) -> String {
        format!("/dev/shm/{}", self.prefix().trim_end_matches('_'))
    }

    /// Begins the name of every shared-memory object.
    pub fn prefix(&self) -> String {
        // SAFETY: getuid has no preconditions.
        let user = unsafe { libc::getuid() };
        format!("stylet_{user}_{}_", self.0)
    }

    fn config(&self) -> Result<Config, ServiceError> {
        let mut config = Config::default();
        config
            .global
            .set_root_path(&Path::new(self.root().as_bytes()).map_err(|e| failed("root path", e))?);
        config.global.prefix = FileName::new(self.prefix().as_bytes()).map_err(|e| failed("prefix", e))?;
        config.global.creation_timeout = Duration::from_millis(20);
        Ok(config)
    }

    /// A node of this instance; removes what dead programs left.
    pub fn node(&self) -> Result<Node<Ipc>, ServiceError> {
        set_log_level(LogLevel::Fatal);
        let free = free_bytes();
        if free < MIN_ROOM_BYTES {
            return Err(failed("shared memory is full", format!("{free} bytes left")));
        }
        NodeBuilder::new()
            .config(&self.config()?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|e| failed("cannot use shared memory", e))
    }

    /// Has the kernel give all memory that this instance's objects may use: writing to an object that finds none left
    /// would end the program by a signal.
    pub fn secure_room(&self) -> Result<(), ServiceError> {
        use std::os::fd::AsRawFd;
        let prefix = self.prefix();
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            let ours = entry.file_name().to_string_lossy().starts_with(&prefix);
            let Some(size) = entry
                .metadata()
                .ok()
                .filter(|m| ours && m.is_file() && m.len() > 0)
                .map(|m| m.len())
            else {
                continue;
            };
            // One that was removed meanwhile needs no memory.
            let Ok(file) = std::fs::File::options().write(true).open(entry.path()) else {
                continue;
            };
            // SAFETY: the file is open; allocating within its size changes nothing that it holds.
            let code = unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, size as libc::off_t) };
            if code == libc::ENOSPC {
                return Err(failed("shared memory is full", format!("no room for {size} bytes")));
            }
        }
        Ok(())
    }

    /// Removes every file of this instance, unless a program still uses it. For the program that ends last.
    pub fn sweep(&self) {
        self.sweep_unless(|_| true);
    }

    /// The same for a program that ends although a thread of its own may keep its node from being dropped.
    pub fn sweep_at_end(&self) {
        let me = std::process::id();
        self.sweep_unless(|pid| pid != Some(me));
    }

    /// `counts` says whether a node of that process is in use.
    fn sweep_unless(&self, counts: impl Fn(Option<u32>) -> bool) {
        let Ok(config) = self.config() else { return };
        let mut used = false;
        let listed = Node::<Ipc>::list(&config, |state| {
            used |= match &state {
                NodeState::Dead(_) => false,
                NodeState::Alive(view) => counts(view.id().pid::<Ipc>().ok().map(|pid| pid.value() as u32)),
                // An unknown state is taken as alive.
                _ => true,
            };
            CallbackProgression::Continue
        });
        if used || listed.is_err() {
            return;
        }
        // Another program may remove the same files at the same time.
        let _ = std::fs::remove_dir_all(self.root());
        let prefix = self.prefix();
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// Less than this, and even the first objects of a program might not fit.
const MIN_ROOM_BYTES: u64 = 4 << 20;

/// Free memory in `/dev/shm`; all there could be when the kernel does not say.
fn free_bytes() -> u64 {
    // SAFETY: an all-zero statvfs is valid.
    let mut stat: libc::statvfs = unsafe { std::mem::zeroed() };
    // SAFETY: the path ends in a zero byte and `stat` is valid for writes.
    let failed = unsafe { libc::statvfs(c"/dev/shm".as_ptr(), &mut stat) };
    if failed == 0 {
        stat.f_bavail * stat.f_frsize
    } else {
        u64::MAX
    }
}

impl Default for Instance {
    fn default() -> Self {
        Self("main".to_owned())
    }
}

fn name(service: &str) -> Result<ServiceName, ServiceError> {
    ServiceName::new(&format!("stylet/{SCHEMA_VERSION}/{service}")).map_err(|e| failed(service, e))
}

macro_rules! plain {
    ($(#[$doc:meta])* $function:ident, $type:ty, $service:literal, publishers $publishers:expr, history $history:expr, buffer $buffer:expr) => {
        $(#[$doc])*
        pub fn $function(node: &Node<Ipc>) -> Result<Plain<$type>, ServiceError> {
            node.service_builder(&name($service)?)
                .publish_subscribe::<$type>()
                .max_publishers($publishers)
                .max_subscribers(MAX_HOSTS + 2)
                .max_nodes(MAX_HOSTS + 4)
                .history_size($history)
                .subscriber_max_buffer_size($buffer)
                .open_or_create()
                .map_err(|e| failed(concat!("service ", $service), e))
        }
    };
}

macro_rules! slices {
    ($(#[$doc:meta])* $function:ident, $type:ty, $header:ty, $service:literal, publishers $publishers:expr, history $history:expr, buffer $buffer:expr) => {
        $(#[$doc])*
        pub fn $function(node: &Node<Ipc>) -> Result<Slices<$type, $header>, ServiceError> {
            node.service_builder(&name($service)?)
                .publish_subscribe::<[$type]>()
                .user_header::<$header>()
                .max_publishers($publishers)
                .max_subscribers(MAX_HOSTS + 2)
                .max_nodes(MAX_HOSTS + 4)
                .history_size($history)
                .subscriber_max_buffer_size($buffer)
                .open_or_create()
                .map_err(|e| failed(concat!("service ", $service), e))
        }
    };
}

plain!(
    /// Which run this is: [`Session`].
    session, Session, "session", publishers 1, history 1, buffer 2);
plain!(
    /// What happened: [`Event`].
    events, Event, "events", publishers 1, history 64, buffer 512);
plain!(
    /// Parameters that took effect: [`ParametersInForce`].
    parameters, ParametersInForce, "parameters", publishers 1, history 1, buffer 2);
plain!(
    /// The plan: [`PlanInForce`].
    plan, PlanInForce, "plan", publishers 1, history 1, buffer 2);
plain!(
    /// Requests of hosts: [`Command`].
    commands, Command, "commands", publishers MAX_HOSTS, history 0, buffer 64);
plain!(
    /// Answers to them: [`Reply`].
    replies, Reply, "replies", publishers 1, history 0, buffer 64);
plain!(
    /// Results of rehearsals: [`Rehearsal`].
    rehearsals, Rehearsal, "rehearsals", publishers 1, history 0, buffer 8);
slices!(
    /// Every tick of the force loop; the header is the run of the core.
    records, TickRecord, u64, "records", publishers 1, history 0, buffer RECORD_BUFFER);
slices!(
    /// The deformed surface and displacements inside.
    snapshots, Vertex, SnapshotHeader, "snapshots", publishers 1, history 1, buffer 2);
slices!(
    /// Rest surface, structures and labels; sent again under a new generation when the scene changes.
    scene, u32, SceneHeader, "scene", publishers 1, history 1, buffer 2);
slices!(
    /// Volumes that hosts send.
    uploads, u8, UploadHeader, "uploads", publishers MAX_HOSTS, history 0, buffer 2);

fn board_name(session_id: u64) -> Result<ServiceName, ServiceError> {
    name(&format!("state/{session_id:016x}"))
}

/// A board named per run: a writer killed while it holds the entry would block its name for good (iceoryx2 issue 2008).
pub fn create_state_board(node: &Node<Ipc>, session_id: u64) -> Result<StateBoard, ServiceError> {
    node.service_builder(&board_name(session_id)?)
        .blackboard_creator::<u64>()
        .add::<HapticState>(STATE_KEY, bytemuck::Zeroable::zeroed())
        .max_readers(MAX_HOSTS + 2)
        .max_nodes(MAX_HOSTS + 4)
        .create()
        .map_err(|e| failed("state board", e))
}

/// Opens the board of the run `session_id`, read-only.
pub fn open_state_board(node: &Node<Ipc>, session_id: u64) -> Result<StateBoard, ServiceError> {
    node.service_builder(&board_name(session_id)?)
        .blackboard_opener::<u64>()
        .open()
        .map_err(|e| failed("state board", e))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each pass of the bridge sent a batch: the queue held 0.13 s of them, and a recorder that stalled for longer lost ticks.
    #[test]
    fn a_host_that_stalls_for_ten_seconds_loses_no_record() {
        let held = BATCH_EVERY * RECORD_BUFFER as u32;
        assert!(held >= Duration::from_secs(10), "{held:?}");
        // Full batches, sent without a pause, hold at least as much at 1 kHz.
        assert!(Duration::from_millis(MAX_BATCH as u64) >= BATCH_EVERY);
        let bytes = (MAX_HOSTS + 2) * (RECORD_BUFFER + 4) * MAX_BATCH * size_of::<TickRecord>();
        assert!(bytes < 38_000_000, "{bytes} bytes in /dev/shm");
    }

    #[test]
    fn instance_names_are_file_names() {
        assert!(Instance::new("lab-2").is_ok());
        for bad in ["", "../x", "a b", "a_b", "0123456789012345678901234"] {
            assert!(Instance::new(bad).is_err(), "{bad}");
        }
    }
}
