//! The contract between `rt-core` and `host-ui`: the contents of shared memory, their writers and their readers.
//!
//! | service | form | written by | read by | holds |
//! |---|---|---|---|---|
//! | `session` | newest kept | bridge | hosts | [`Session`]: the run, and the kernel's grants |
//! | `state/<session>` | blackboard, one per run | bridge | hosts | [`HapticState`]: the latest tick |
//! | `records` | slices of [`TickRecord`] | bridge | hosts | every tick of the force loop |
//! | `second/<session>` | blackboard, if the run has a second device | bridge | hosts | [`SecondState`]: latest tick |
//! | `second_records` | slices of [`SecondRecord`] | bridge | hosts | every tick of the second device's loop |
//! | `snapshots` | slices of [`Vertex`] under a [`SnapshotHeader`] | tissue thread | hosts | deformed surface and displacements |
//! | `scene` | words under a [`SceneHeader`], newest kept | bridge | hosts | rest surface, structures, labels |
//! | `events` | [`Event`], last 64 kept | bridge | hosts | events, once each |
//! | `parameters` | [`ParametersInForce`], newest kept | bridge | hosts | parameters in force |
//! | `plan` | [`PlanInForce`], newest kept | bridge | hosts | planned seeds and needle path |
//! | `commands` | [`Command`] | hosts | bridge | a [`Request`] as plain data |
//! | `stops` | [`Command`] that removes force or motion | hosts | bridge | as `commands`, past every flood |
//! | `replies` | [`Reply`] | bridge | hosts | acceptance, or reasons of refusal |
//! | `rehearsals` | [`Rehearsal`] | bridge | hosts | predicted seed positions |
//! | `relayed` | [`Relayed`], newest kept | a relay without a core | hosts | server, role, round trip, losses |
//! | `class` | [`Class`], newest kept | a relay | hosts | members, operator, applicant |
//! | `lease` | [`LeaseOrder`] | hosts | a relay | a [`LeaseRequest`] as plain data |
//! | `uploads` | label cells under an [`UploadHeader`] | hosts | bridge | a segmented volume |
//!
//! Every type is plain old data, valid for every bit pattern: no `bool`, `enum` or `char`, no padding, no pointer. A
//! reader verifies everything: [`check`] before a value is used, [`Request::decode`] before a request is carried out.
//! Quantities are SI (m, s, N, rad) in the *scene frame*: origin at the corner of the lattice, axes along it, needle
//! along +z by default.

#![warn(missing_docs)]

use std::time::Duration;

/// Makes an enum of stable numbers, each with its text for people.
macro_rules! coded {
    ($(#[$about:meta])* $name:ident: $($(#[$doc:meta])* $code:ident = $number:literal, $message:literal;)+) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, num_enum::TryFromPrimitive)]
        #[repr(u32)]
        pub enum $name {
            $($(#[$doc])* $code = $number,)+
        }

        numbered!($name);

        impl $name {
            /// Returns the text for people.
            pub fn message(self) -> &'static str {
                match self {
                    $(Self::$code => $message,)+
                }
            }
        }
    };
}

macro_rules! numbered {
    ($name:ty) => {
        impl $name {
            /// Returns the value of a number; `None` if this build does not know it.
            pub fn from_number(number: u32) -> Option<Self> {
                Self::try_from(number).ok()
            }
        }
    };
}

#[cfg(not(target_family = "wasm"))]
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
#[cfg(not(target_family = "wasm"))]
pub use instance::{Attendance, Epoch, Owned};
pub use instance::{Instance, InstanceError};
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
    NeedleRehearsal, ParameterChange, ProbeMove, RETRACT_RANGE_M, Request, SPEED_RANGE_M_PER_S, STRAND_PITCH_RANGE_M,
    StabilisingNeedle, VALID_RANGE_S,
};
pub use scene::{SceneHeader, SceneId, StructureInfo, UploadHeader, UploadStructure, role};
pub use second::{SecondRecord, SecondState};
pub use session::{Session, ThreadReport};
pub use snapshot::{LeftNeedlePose, MAX_BEND_POINTS, SeedPose, SnapshotHeader, Vertex, touching};
pub use state::{Fault, HapticState, flags};
pub use stylet_settings::{
    BUILTIN_SCENES, GridInfo, MAX_LABEL_CELLS, MAX_LEFT_NEEDLES, MAX_NODES, MAX_STRUCTURES, PARAMETER_COUNT,
    PARAMETERS, ParameterGroup, ParameterId, ParameterProblem, ParameterProblems, ParameterSet, ParameterSpec, Phase,
    ProblemList, SEED_LENGTH_M, SEED_RADIUS_M, TOUCHING_M, folding,
};
pub use text::Text;

/// Both programs must agree on this; it is part of every service name.
pub const SCHEMA_VERSION: u32 = 19;

const _: () = assert!(
    PARAMETER_COUNT == 57,
    "the table of parameters has another length: increase SCHEMA_VERSION, then correct this number"
);

/// Most records in one batch.
pub const MAX_BATCH: usize = 32;
/// A partial batch is sent after this time, so that the queue of batches spans a known time.
pub const BATCH_EVERY: Duration = Duration::from_millis(20);
/// Batches that a slow host may lag before the oldest is dropped: 12 s. The memory for all hosts is 40 MB in
/// `/dev/shm`.
pub const RECORD_BUFFER: usize = 600;
/// Most hosts at once.
pub const MAX_HOSTS: usize = 6;
