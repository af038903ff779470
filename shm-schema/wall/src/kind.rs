//! Content of the packets between both processes.

#[cfg(doc)]
use stylet_shm_schema::*;

/// Content of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, num_enum::TryFromPrimitive)]
#[repr(u32)]
pub enum Kind {
    /// To the bridge: [`Start`] of the run; the first packet.
    Start = 1,
    /// To the bridge: [`Session`].
    Session,
    /// To the bridge: [`ParametersInForce`].
    Parameters,
    /// To the bridge: [`PlanInForce`].
    Plan,
    /// To the bridge: [`Event`].
    Event,
    /// To the bridge: [`Reply`].
    Reply,
    /// To the bridge: [`Rehearsal`].
    Rehearsal,
    /// To the bridge: [`TickRecord`]s.
    Records,
    /// To the bridge: [`SecondRecord`]s.
    SecondRecords,
    /// To the bridge: [`SceneHeader`], with memory that holds its words.
    Scene,
    /// To the bridge: a [`BoardSize`], with the board of snapshots.
    Snapshots,
    /// To the bridge, with the board of [`HapticState`].
    State,
    /// To the bridge, with the board of [`SecondState`].
    SecondState,
    /// From the host of a measurement: [`SeenSnapshot`]s.
    SeenSnapshots,
    /// From the host of a measurement: [`SeenRecords`].
    SeenRecords,
    /// From the bridge: its ports are open.
    Ready = 101,
    /// From the bridge: [`Alive`].
    Alive,
    /// From the bridge: why it cannot continue, as text.
    Failed,
    /// From the bridge: a [`Command`].
    Command,
    /// From the bridge: a [`Command`] of the queue of stops, which comes before all others.
    Stop,
    /// From the bridge: an [`UploadHeader`], with memory that holds its cells.
    Upload,
}

/// Data that a bridge needs before it makes its ports.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Start {
    /// The run of the core.
    pub session_id: u64,
    /// Vertices and nodes of a snapshot of the first scene.
    pub snapshot_len: u64,
    /// Words of the first scene.
    pub word_count: u64,
    /// 1 in a run with a second device.
    pub has_second: u64,
}

/// Scene and size of a board of snapshots.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct BoardSize {
    /// Vertices and nodes of each snapshot.
    pub len: u64,
}

/// The bridge's heartbeat.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Alive {
    /// A host takes snapshots.
    pub has_viewers: u64,
    /// Requests refused since it began.
    pub refused: u64,
}

/// A snapshot, as seen by the host of a measurement. Times of `CLOCK_MONOTONIC`, ns.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SeenSnapshot {
    /// Tick of the tissue loop that made it.
    pub tissue_tick: u64,
    /// Wake-up time of that tick.
    pub time_ns: u64,
    /// Time at which the host saw it.
    pub seen_ns: u64,
}

/// Records that the host of a measurement saw at once.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SeenRecords {
    /// The first tick.
    pub first: u64,
    /// The last tick.
    pub last: u64,
    /// Number of records.
    pub count: u64,
}
