//! Names, configuration and ports of every service.
//!
//! Each service has one constructor for its ports. Only this crate uses iceoryx2, so no other crate can make a port.

#![warn(missing_docs)]

use iceoryx2::prelude::{BackpressureStrategy, ServiceName};
use iceoryx2::service::ipc;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use stylet_shm_schema::*;
use wire::Wire;

mod board;
mod node;
mod ports;
mod wire;

pub use board::{OnBoard, StateReader, StateWriter};
pub use node::{Meeting, Node};
pub use ports::{Connected, Loan, Publisher, SendError, Slice, SlicePublisher, SliceSubscriber, Subscriber, Watch};

/// The form of service that all programs use.
type Ipc = ipc::Service;

/// Failure to use shared memory; the text says what to do.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// The folder of the instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// No core runs under that name.
    #[error("no rt-core is running (instance \"{0}\"). Start it in another terminal: rt-core{flag}", flag = flag(.0))]
    Absent(String),
    /// A port of a host cannot be made: the maximum number of programs is connected, or memory is full.
    #[error(
        "{service}: {why}. At most {MAX_HOSTS} hosts can watch one core; close another window, or check the room in /dev/shm"
    )]
    Full {
        /// Name of the service.
        service: String,
        /// Error of iceoryx2.
        why: String,
    },
    /// A port of the core, or of a relay in its role, cannot be made.
    #[error(
        "cannot use shared memory: {service}: {why}. Is another rt-core or relay running under this instance name? Choose another with \
         --instance"
    )]
    Core {
        /// Name of the service.
        service: String,
        /// Error of iceoryx2.
        why: String,
    },
    /// A service or its memory failed.
    #[error("{service}: {why}. Both programs must come from the same build, and /dev/shm needs room (df -h /dev/shm)")]
    Port {
        /// Name of the service.
        service: String,
        /// Error of iceoryx2.
        why: String,
    },
    /// A value cannot be sent.
    #[error("{service}: {why}")]
    Send {
        /// Name of the service.
        service: &'static str,
        /// Reason.
        why: SendError,
    },
}

impl ServiceError {
    fn absent(instance: &Instance) -> Self {
        Self::Absent(instance.name().to_owned())
    }
}

fn flag(name: &str) -> String {
    match name == Instance::default().name() {
        true => String::new(),
        false => format!(" --instance {name}"),
    }
}

fn failed(what: &str, why: impl std::fmt::Debug) -> ServiceError {
    ServiceError::Port {
        service: what.to_owned(),
        why: format!("{why:?}"),
    }
}

fn name(service: &str) -> Result<ServiceName, ServiceError> {
    ServiceName::new(&format!("stylet/{SCHEMA_VERSION}/{service}")).map_err(|e| failed(service, e))
}

/// Publisher of a service; everyone else subscribes.
#[derive(Clone, Copy)]
enum By {
    /// The core, or a relay in its role.
    Core,
    Hosts,
}

impl By {
    const fn publishers(self) -> usize {
        match self {
            Self::Core => 1,
            Self::Hosts => MAX_HOSTS,
        }
    }

    fn publisher_failed(self, service: &str, why: impl std::fmt::Debug) -> ServiceError {
        match self {
            Self::Core => core_failed(service, why),
            Self::Hosts => host_failed(service, why),
        }
    }

    fn subscriber_failed(self, service: &str, why: impl std::fmt::Debug) -> ServiceError {
        match self {
            Self::Core => host_failed(service, why),
            Self::Hosts => core_failed(service, why),
        }
    }
}

/// Error for a port of the core, or of a relay in its role.
fn core_failed(service: &str, why: impl std::fmt::Debug) -> ServiceError {
    ServiceError::Core {
        service: service.to_owned(),
        why: format!("{why:?}"),
    }
}

/// Error for a port of a host.
fn host_failed(service: &str, why: impl std::fmt::Debug) -> ServiceError {
    ServiceError::Full {
        service: service.to_owned(),
        why: format!("{why:?}"),
    }
}

// `history`: number of past values that a joining host receives; `again`: the same for a host that rejoins after the
// ports were recreated.
macro_rules! service {
    (@receiver $receiver:ty, by $who:ident, history $history:expr, again $again:expr) => {
        /// Returns a receiver.
        pub fn subscriber(node: &Node) -> Result<$receiver, ServiceError> {
            open(node)?
                .subscriber_builder()
                .history_request(if node.is_again() { $again } else { $history })
                .create()
                .map(<$receiver>::new)
                .map_err(|e| By::$who.subscriber_failed(NAME, e))
        }

        /// Returns a monitor of connections.
        pub fn watch(node: &Node) -> Result<Watch, ServiceError> {
            let service = open(node)?;
            Ok(Watch::new(move || service.dynamic_config().into()))
        }
    };
    ($(#[$doc:meta])* $module:ident: $value:ty, by $who:ident, history $history:expr, again $again:expr, buffer $buffer:expr) => {
        $(#[$doc])*
        pub mod $module {
            use super::*;

            const NAME: &str = stringify!($module);

            fn open(node: &Node) -> Result<PortFactory<Ipc, Wire<$value>, ()>, ServiceError> {
                node.inner()
                    .service_builder(&name(NAME)?)
                    .publish_subscribe::<Wire<$value>>()
                    .max_publishers(By::$who.publishers())
                    .max_subscribers(MAX_HOSTS + 2)
                    .max_nodes(MAX_HOSTS + 4)
                    .history_size($again)
                    .subscriber_max_buffer_size($buffer)
                    .open_or_create()
                    .map_err(|e| failed(NAME, e))
            }

            /// Returns a sender; values are dropped when a queue is full.
            pub fn publisher(node: &Node) -> Result<Publisher<$value>, ServiceError> {
                open(node)?
                    .publisher_builder()
                    .backpressure_strategy(BackpressureStrategy::DiscardData)
                    .create()
                    .map(Publisher::new)
                    .map_err(|e| By::$who.publisher_failed(NAME, e))
            }

            service!(@receiver Subscriber<$value>, by $who, history $history, again $again);
        }
    };
    (
        $(#[$doc:meta])*
        $module:ident: [$value:ty] under $header:ty, by $who:ident, history $history:expr, again $again:expr,
        buffer $buffer:expr, loans $loans:expr, kept $kept:expr
    ) => {
        $(#[$doc])*
        pub mod $module {
            use super::*;

            const NAME: &str = stringify!($module);

            fn open(node: &Node) -> Result<PortFactory<Ipc, [Wire<$value>], Wire<$header>>, ServiceError> {
                node.inner()
                    .service_builder(&name(NAME)?)
                    .publish_subscribe::<[Wire<$value>]>()
                    .user_header::<Wire<$header>>()
                    // One more, for a publisher that replaces another.
                    .max_publishers(By::$who.publishers() + 1)
                    .max_subscribers(MAX_HOSTS + 2)
                    .max_nodes(MAX_HOSTS + 4)
                    .history_size($again)
                    .subscriber_max_buffer_size($buffer)
                    .open_or_create()
                    .map_err(|e| failed(NAME, e))
            }

            /// Returns a sender of slices, of at most `length` values without allocating more memory; slices are
            /// dropped when a queue is full.
            pub fn publisher(node: &Node, length: usize) -> Result<SlicePublisher<$value, $header>, ServiceError> {
                let service = open(node)?;
                SlicePublisher::new(length, move |length| {
                    service
                        .publisher_builder()
                        .backpressure_strategy(BackpressureStrategy::DiscardData)
                        .initial_max_slice_len(length)
                        .max_loaned_samples($loans)
                        .override_sample_preallocation($kept)
                        .create()
                })
                .map_err(|e| By::$who.publisher_failed(NAME, e))
            }

            service!(@receiver SliceSubscriber<$value, $header>, by $who, history $history, again $again);
        }
    };
}

service!(
    /// Description of the run: [`Session`].
    session: Session, by Core, history 1, again 1, buffer 2);
service!(
    /// Events of the run: [`Event`].
    events: Event, by Core, history 64, again 64, buffer 512);
service!(
    /// Parameters that took effect: [`ParametersInForce`].
    parameters: ParametersInForce, by Core, history 1, again 1, buffer 2);
service!(
    /// Plan in force: [`PlanInForce`].
    plan: PlanInForce, by Core, history 1, again 1, buffer 2);
service!(
    /// Requests of hosts: [`Command`].
    commands: Command, by Hosts, history 0, again 0, buffer 64);
service!(
    /// Requests that remove force or motion, in addition to `commands`: a flood there cannot delay them.
    stops: Command, by Hosts, history 0, again 0, buffer 8);
service!(
    /// Answers to requests: [`Reply`].
    replies: Reply, by Core, history 0, again 128, buffer 128);
service!(
    /// Results of rehearsals: [`Rehearsal`].
    rehearsals: Rehearsal, by Core, history 0, again 8, buffer 8);
service!(
    /// Connection to a core on another machine: [`Relayed`].
    relayed: Relayed, by Core, history 1, again 1, buffer 2);
service!(
    /// Members connected through a relay: [`Class`].
    class: Class, by Core, history 1, again 1, buffer 2);
service!(
    /// Requests of hosts for the needle's lease: [`LeaseOrder`].
    lease: LeaseOrder, by Hosts, history 0, again 0, buffer 8);
service!(
    /// Every tick of the force loop; the header is the run of the core.
    records: [TickRecord] under u64, by Core, history 0, again RECORD_BUFFER, buffer RECORD_BUFFER,
    loans 2, kept |all| all);
service!(
    /// Every tick of the second device's loop, in a run that has one; the header is the run of the core.
    second_records: [SecondRecord] under u64, by Core, history 0, again RECORD_BUFFER, buffer RECORD_BUFFER,
    loans 2, kept |all| all);

// Number of slices with memory: by default iceoryx2 would allocate for every host to hold its maximum, hundreds of MB
// of locked memory for a large scene. Two wait in the queues; one is being filled, and each host may hold one that it
// stopped reading. When all are held, nothing is sent until one returns.
service!(
    /// The deformed surface and displacements inside.
    snapshots: [Vertex] under SnapshotHeader, by Core, history 1, again 1, buffer 2,
    loans 2, kept |_| 4 + MAX_HOSTS);
service!(
    /// Rest surface, structures and labels; sent again under a new generation when the scene changes.
    scene: [u32] under SceneHeader, by Core, history 1, again 1, buffer 2, loans 2, kept |_| 6);
service!(
    /// Volumes that hosts send, each through a separate port: its memory is as large as the volume, and the core maps
    /// all of it.
    uploads: [u8] under UploadHeader, by Hosts, history 0, again 0, buffer 2, loans 2, kept |_| 2);

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// A port that grew ended the core when a host had stopped while reading: more slices were held than it began with.
    #[test]
    fn slices_that_nobody_returns_are_refused_and_longer_ones_find_room() {
        let instance = Instance::new(&format!("held-{}", std::process::id())).unwrap();
        let meeting = Meeting::new(&instance).unwrap();
        let node = &meeting.node;
        let sends = scene::publisher(node, 4).unwrap();
        let takes: Vec<_> = (0..4).map(|_| scene::subscriber(node).unwrap()).collect();
        sends.connect();
        let header = SceneHeader::default();
        let mut held = Vec::new();
        let mut refused = 0;
        for n in 0..20 {
            refused += u32::from(sends.send(&header, &[n; 4]).is_err());
            held.extend(takes[n as usize % 4].receive());
        }
        assert!(refused > 0 && !held.is_empty(), "{refused} refused");
        held.clear();
        for take in &takes {
            while take.receive().is_some() {}
        }
        for length in [4, 100, 3000] {
            sends.send(&header, &vec![7; length]).unwrap();
            for take in &takes {
                assert_eq!(take.receive().unwrap().values(), vec![7; length]);
            }
        }
    }

    /// Each pass of the bridge sent a batch: the queue held 0.13 s of them, and a recorder that stalled for longer lost
    /// ticks.
    #[test]
    fn a_host_that_stalls_for_ten_seconds_loses_no_record() {
        let held = BATCH_EVERY * RECORD_BUFFER as u32;
        assert!(held >= Duration::from_secs(10), "{held:?}");
        // Full batches, sent without a pause, last at least as long at 1 kHz.
        assert!(Duration::from_millis(MAX_BATCH as u64) >= BATCH_EVERY);
        let bytes = ((MAX_HOSTS + 2) * (RECORD_BUFFER + 4) + RECORD_BUFFER) * MAX_BATCH * size_of::<TickRecord>();
        assert!(bytes < 43_000_000, "{bytes} bytes in /dev/shm");
    }
}
