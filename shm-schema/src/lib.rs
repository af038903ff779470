//! The contract between `rt-core` and `host-ui`: what may lie in shared memory, who writes it, who reads it.
//!
//! | service | form | written by | read by | holds |
//! |---|---|---|---|---|
//! | `session` | publish-subscribe, newest one kept | bridge | hosts | [`Session`]: which run this is, what the kernel granted |
//! | `state/<session>` | blackboard, one per run | bridge | hosts | [`HapticState`]: the latest tick |
//! | `records` | slices of [`TickRecord`] | bridge | hosts | every tick of the force loop |
//! | `second/<session>` | blackboard, in a run with a second device | bridge | hosts | [`SecondState`]: its latest tick |
//! | `second_records` | slices of [`SecondRecord`], likewise | bridge | hosts | every tick of the second device's loop |
//! | `snapshots` | slices of [`Vertex`] under a [`SnapshotHeader`] | tissue thread, sent by the bridge | hosts | the deformed surface, displacements inside, needle and seeds |
//! | `scene` | words under a [`SceneHeader`], newest one kept | bridge | hosts | rest surface, triangles, structures, labels of the cells |
//! | `events` | [`Event`], last 64 kept | bridge | hosts | what happened, once each |
//! | `parameters` | [`ParametersInForce`], newest one kept | bridge | hosts | the parameters that took effect, and when |
//! | `plan` | [`PlanInForce`], newest one kept | bridge | hosts | planned seeds and needle path |
//! | `commands` | [`Command`] | hosts | bridge | a [`Request`] as plain data |
//! | `stops` | [`Command`] that takes force or motion away | hosts | bridge | the same as in `commands`, past every flood |
//! | `replies` | [`Reply`] | bridge | hosts | accepted, or refused and why |
//! | `rehearsals` | [`Rehearsal`] | bridge | hosts | where the seeds of a needle would end |
//! | `relayed` | [`Relayed`], newest one kept | a relay in place of the core | hosts | server, role, round trip, age and losses |
//! | `class` | [`Class`], newest one kept | a relay | hosts | who is connected, who operates, who asks to |
//! | `lease` | [`LeaseOrder`] | hosts | a relay | a [`LeaseRequest`] as plain data |
//! | `uploads` | label cells under an [`UploadHeader`] | hosts | bridge | a segmented volume |
//!
//! Every type is plain old data, valid for every bit pattern: no `bool`, `enum` or `char`, no padding, no pointer.
//! A reader verifies everything: [`check`] before a value is used, [`Request::decode`] before a request is carried out.
//! Quantities are SI (m, s, N, rad) in the *scene frame*: origin at the corner of the lattice, axes along it, needle along +z by default.

#![warn(missing_docs)]

use std::time::Duration;

pub mod affinity;
pub mod check;
mod class;
mod command;
mod deadlines;
mod event;
mod exercise;
mod instance;
pub mod motion;
mod params;
mod plan;
mod record;
mod refusal;
mod rehearsal;
mod relayed;
mod request;
mod scene;
mod second;
mod session;
mod snapshot;
mod state;
mod text;

pub use class::{Class, ClassMember, LeaseOrder, LeaseRequest, MAX_CLASS};
pub use command::{COMMAND_BYTES, Command, MARK_BYTES, MAX_REASONS, Reply, ReplyStatus};
pub use deadlines::DeadlineTotals;
pub use event::{Event, EventKind};
pub use exercise::{EXERCISE_STIFFNESS_RANGE, Exercise, ExercisesInForce, MOST_MOVED_M};
pub use instance::{Attendance, Epoch, Instance, InstanceError, Owned};
pub use params::ParametersInForce;
pub use plan::{
    MAX_EARLIER_NEEDLES, MAX_SEEDS, MOST_PLANNED_NEEDLES, PRESCRIPTION_RANGE_GY, PlanInForce, PlannedNeedle,
    PlannedSeed, Prescribed, SEED_STRENGTH_RANGE_U, SOURCE_BYTES,
};
pub use record::TickRecord;
pub use refusal::{Reason, Refusal, RefusalCode};
pub use rehearsal::Rehearsal;
pub use relayed::Relayed;
pub use request::{
    ACCELERATION_RANGE_M_PER_S2, CommandKind, HandMove, LEFT_DEPTH_RANGE_M, MARK_BEFORE_RANGE_S, Mark, NeedleAxis,
    NeedleRehearsal, ParameterChange, ProbeMove, RETRACT_RANGE_M, Request, RequestError, RequestErrors,
    SPEED_RANGE_M_PER_S, STRAND_PITCH_RANGE_M, StabilisingNeedle, VALID_RANGE_S,
};
pub use scene::{SceneHeader, SceneId, StructureInfo, UploadHeader, UploadStructure, role};
pub use second::{SecondRecord, SecondState};
pub use session::{Session, ThreadReport};
pub use snapshot::{LeftNeedlePose, MAX_BEND_POINTS, SeedPose, SnapshotHeader, Vertex};
pub use state::{Fault, HapticState, Phase, flags};
pub use stylet_settings::{
    BUILTIN_SCENES, GridInfo, MAX_LABEL_CELLS, MAX_LEFT_NEEDLES, MAX_NODES, MAX_STRUCTURES, PARAMETER_COUNT,
    PARAMETERS, ParameterGroup, ParameterId, ParameterProblem, ParameterProblems, ParameterSet, ParameterSpec, folding,
};
pub use text::Text;

/// Both programs must agree on this; it is part of every service name.
pub const SCHEMA_VERSION: u32 = 17;

/// Records in one batch at most.
pub const MAX_BATCH: usize = 32;
/// A batch that is not full is sent after this time, so that the queue of batches holds a known time.
pub const BATCH_EVERY: Duration = Duration::from_millis(20);
/// Batches that a slow host may be behind before the oldest is dropped: 12 s. The memory for all hosts is 40 MB in `/dev/shm`.
pub const RECORD_BUFFER: usize = 600;
/// Hosts at once.
pub const MAX_HOSTS: usize = 6;
