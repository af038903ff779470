//! A program's node in shared memory: a host joins the epoch of a core; the program that makes the core's ports opens
//! its own.

use super::{Ipc, ServiceError, failed};
use iceoryx2::config::Config;
use iceoryx2::node;
use iceoryx2::node::NodeBuilder;
use iceoryx2::prelude::{FileName, LogLevel, Path, SemanticString, SignalHandlingMode, set_log_level};
use std::time::Duration;
use stylet_shm_schema::{Attendance, Epoch, Instance, Owned};

/// A program's node in the shared memory of an epoch; every port is made on one, and is dropped before it.
pub struct Node {
    inner: Box<dyn InnerNode + Send>,
    epoch: Epoch,
    is_again: bool,
    _attendance: Option<Attendance>,
}

trait InnerNode {
    fn inner(&self) -> &node::Node<Ipc>;
}

impl InnerNode for node::Node<Ipc> {
    fn inner(&self) -> &node::Node<Ipc> {
        self
    }
}

impl Node {
    /// Joins, as a host, the epoch announced by the owner of `instance`.
    pub fn join(instance: &Instance) -> Result<Self, ServiceError> {
        let epoch = instance.epoch().ok_or_else(|| ServiceError::absent(instance))?;
        let attendance = instance.attend()?;
        let mut node = Self::open(epoch)?;
        node._attendance = Some(attendance);
        Ok(node)
    }

    /// Joins again, as a host from an earlier epoch of the run: values that it may have missed are sent again.
    pub fn join_again(instance: &Instance) -> Result<Self, ServiceError> {
        Self::join(instance).map(|node| Self { is_again: true, ..node })
    }

    /// Opens a node for the program that makes the core's ports in `epoch`.
    pub fn open(epoch: Epoch) -> Result<Self, ServiceError> {
        set_log_level(LogLevel::Fatal);
        let free = free_bytes();
        if free < MIN_ROOM_BYTES {
            return Err(failed("shared memory is full", format!("{free} bytes left")));
        }
        let inner = NodeBuilder::new()
            .config(&config(&epoch)?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|e| failed("cannot use shared memory", e))?;
        Ok(Self {
            inner: Box::new(inner),
            epoch,
            is_again: false,
            _attendance: None,
        })
    }

    pub(super) fn inner(&self) -> &node::Node<Ipc> {
        self.inner.inner()
    }

    pub(super) fn is_again(&self) -> bool {
        self.is_again
    }

    /// Epoch of the node.
    pub fn epoch(&self) -> &Epoch {
        &self.epoch
    }

    /// True if hosts join its epoch now; otherwise everything sent on it is lost.
    pub fn is_current(&self) -> bool {
        self.epoch.instance().epoch().as_ref() == Some(&self.epoch)
    }

    /// Frees resources of dead programs.
    pub fn clean_up(&self) {
        // Resources that another program is cleaning at the same time are left to it.
        let _ = self.inner().try_cleanup_dead_nodes();
    }
}

/// The core's role in an instance, for a program that makes the core's ports itself: a relay, or a test.
pub struct Meeting {
    /// Node on which the ports are made.
    pub node: Node,
    owned: Owned,
}

impl Meeting {
    /// Makes this program the owner of `instance`; hosts cannot join yet.
    pub fn new(instance: &Instance) -> Result<Self, ServiceError> {
        let owned = instance.own()?;
        let node = Node::open(owned.begin()?)?;
        Ok(Self { node, owned })
    }

    /// Admits hosts, once every port of the core exists.
    pub fn open(&self) -> Result<(), ServiceError> {
        self.node.epoch.secure()?;
        Ok(self.owned.announce(&self.node.epoch)?)
    }
}

fn config(epoch: &Epoch) -> Result<Config, ServiceError> {
    let mut config = Config::default();
    let root = epoch.root();
    let root = Path::new(root.as_os_str().as_encoded_bytes()).map_err(|e| failed("root path", e))?;
    config.global.set_root_path(&root);
    config.global.prefix = FileName::new(epoch.prefix().as_bytes()).map_err(|e| failed("prefix", e))?;
    config.global.creation_timeout = Duration::from_millis(20);
    Ok(config)
}

/// Least free memory: with less, even the first objects of a program might not fit.
const MIN_ROOM_BYTES: u64 = 4 << 20;

/// Free memory in `/dev/shm`; the maximum if the kernel does not say.
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
