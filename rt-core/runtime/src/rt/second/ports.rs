//! Every ring and triple buffer of the second device's loop; a run without a second device has none.

use super::response::ProbeResponse;
use super::tape::SecondTape;
use crate::rt::capacities::Capacities;
use crate::rt::exchange::{HapticOrder, Notice, Ticket};
use crate::rt::recorder::{Recorder, TapePort, recorder};
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use stylet_shm_schema::SecondRecord;

/// The newest pose of the second device, once in each tick of its loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SecondPose {
    /// When the pose was read, `CLOCK_MONOTONIC`, ns; 0 for no pose yet.
    pub time_ns: u64,
    /// Tip of the held tool, scene frame, m.
    pub tip_in_scene: Vector3<f64>,
    /// Orientation of the tool, which lies along its +z towards its tip.
    pub world_from_tool: UnitQuaternion<f64>,
    /// Filtered velocity of the tip.
    pub velocity_m_per_s: Vector3<f64>,
}

/// Ends of the second device's loop.
pub struct SecondPorts {
    /// Newest pose, to the tissue loop.
    pub pose: triple_buffer::Input<SecondPose>,
    /// Newest response of the tissue loop.
    pub response: triple_buffer::Output<ProbeResponse>,
    /// Orders of the control thread.
    pub orders: rtrb::Consumer<(Ticket, HapticOrder)>,
    /// Notices to the control thread.
    pub notices: rtrb::Producer<Notice>,
    /// One record for each tick, to the control thread.
    pub records: rtrb::Producer<SecondRecord>,
    /// Flight recording.
    pub flight: Recorder<SecondTape>,
}

/// Ends of the tissue loop.
pub struct SecondTissuePorts {
    /// Newest pose of the second device's loop.
    pub pose: triple_buffer::Output<SecondPose>,
    /// Newest response, to that loop.
    pub response: triple_buffer::Input<ProbeResponse>,
}

/// Ends of the control thread.
pub struct SecondControlPorts {
    /// Orders to the loop.
    pub orders: rtrb::Producer<(Ticket, HapticOrder)>,
    /// Notices of the loop.
    pub notices: rtrb::Consumer<Notice>,
    /// Records of the loop.
    pub records: rtrb::Consumer<SecondRecord>,
    /// Its tapes.
    pub tapes: TapePort<SecondTape>,
}

/// Connects the loop with the tissue loop and the control thread. A loop without a tape is not recorded.
// SYNC: every ring and triple buffer is single-producer single-consumer; their crates pair release with acquire.
pub fn wire(
    capacities: Capacities,
    tape: Option<Box<SecondTape>>,
) -> (SecondPorts, SecondTissuePorts, SecondControlPorts) {
    let (pose_in, pose) = triple_buffer::triple_buffer(&SecondPose::default());
    let (response_in, response) = triple_buffer::triple_buffer(&ProbeResponse::default());
    let (record_in, records) = rtrb::RingBuffer::new(capacities.records);
    let (orders, order_out) = rtrb::RingBuffer::new(capacities.orders);
    let (notice_in, notices) = rtrb::RingBuffer::new(capacities.notices);
    let (flight, tapes) = recorder(tape);
    let own = SecondPorts {
        pose: pose_in,
        response,
        orders: order_out,
        notices: notice_in,
        records: record_in,
        flight,
    };
    let tissue = SecondTissuePorts {
        pose,
        response: response_in,
    };
    let control = SecondControlPorts {
        orders,
        notices,
        records,
        tapes,
    };
    (own, tissue, control)
}
