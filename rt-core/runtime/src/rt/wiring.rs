//! Every ring and triple buffer between the two loops and the control thread, all made here in one call.

pub use crate::rt::capacities::Capacities;
use crate::rt::exchange::{HapticOrder, Notice, Ticket, TissueOrder};
use crate::rt::haptic_tape::HapticTape;
use crate::rt::line_loads::AllLoads;
use crate::rt::outside::{Outside, OutsideTape};
use crate::rt::pose::TipPose;
use crate::rt::recorder::{Recorder, TapePort, recorder};
use crate::rt::response::TissueResponse;
use crate::rt::second::SecondTissuePorts;
use crate::rt::tissue_tape::TissueTape;
use crate::rt::world::World;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stylet_shm_schema::TickRecord;
use stylet_sim::line::{BodyLine, HandLine, LeftNeedles, MAX_LEFT};
use stylet_sim::probe::BodyProbe;

/// Lines in transit in each direction; the control thread frees returned lines before it sends another.
const LINES: usize = 2;
/// Lines on their way back: all needles that stay in may return at once.
const OLD_LINES: usize = LINES + 2 * MAX_LEFT;
/// Room for needles that stay in, sent once.
const ROOMS: usize = 2;
/// Probes on their way back, one per scene.
const OLD_PROBES: usize = 4;

/// Ends of the force loop.
pub struct HapticPorts {
    /// Newest pose, to the tissue loop.
    pub pose: triple_buffer::Input<TipPose>,
    /// Newest response of the tissue loop.
    pub response: triple_buffer::Output<TissueResponse>,
    /// The probe's displacement of the line.
    pub outside: triple_buffer::Output<Outside>,
    /// Room to record it.
    pub outside_rooms: rtrb::Consumer<Box<OutsideTape>>,
    /// Orders of the control thread.
    pub orders: rtrb::Consumer<(Ticket, HapticOrder)>,
    /// Notices to the control thread.
    pub notices: rtrb::Producer<Notice>,
    /// One record for each tick, to the control thread.
    pub records: rtrb::Producer<TickRecord>,
    /// Lines ready for the needle.
    pub lines: rtrb::Consumer<Box<HandLine>>,
    /// Replaced lines, to the control thread, which frees them.
    pub old_lines: rtrb::Producer<Box<HandLine>>,
    /// Room for needles that stay in.
    pub rooms: rtrb::Consumer<Box<LeftNeedles>>,
    /// Forces on the line, to the tissue loop.
    pub loads: triple_buffer::Input<AllLoads>,
    /// Flight recording.
    pub flight: Recorder<HapticTape>,
}

/// Ends of the tissue loop.
pub struct TissuePorts {
    /// Newest pose of the force loop.
    pub pose: triple_buffer::Output<TipPose>,
    /// Newest response, to the force loop.
    pub response: triple_buffer::Input<TissueResponse>,
    /// The probe's displacement of the line, to the force loop.
    pub outside: triple_buffer::Input<Outside>,
    /// Orders of the control thread.
    pub orders: rtrb::Consumer<TissueOrder>,
    /// Notices to the control thread.
    pub notices: rtrb::Producer<Notice>,
    /// Replaced scenes, to the control thread, which frees them.
    pub old_worlds: rtrb::Producer<Box<World>>,
    /// Replaced columns of a line, to the control thread, which frees them.
    pub old_lines: rtrb::Producer<Box<BodyLine>>,
    /// Probes of replaced scenes, to the control thread, which frees them.
    pub old_probes: rtrb::Producer<Box<BodyProbe>>,
    /// Forces on the line, of the force loop.
    pub loads: triple_buffer::Output<AllLoads>,
    /// A host takes snapshots; none is made otherwise.
    pub is_watched: Arc<AtomicBool>,
    /// Pose and contact of the second device, in a run that has one.
    pub second: Option<SecondTissuePorts>,
    /// Flight recording.
    pub flight: Recorder<TissueTape>,
}

/// Ends of the control thread, or of a stepper in its role.
pub struct ControlPorts {
    /// Records of the force loop.
    pub records: rtrb::Consumer<TickRecord>,
    /// Orders to the force loop.
    pub haptic_orders: rtrb::Producer<(Ticket, HapticOrder)>,
    /// Notices of the force loop.
    pub haptic_notices: rtrb::Consumer<Notice>,
    /// Orders to the tissue loop.
    pub tissue_orders: rtrb::Producer<TissueOrder>,
    /// Notices of the tissue loop.
    pub tissue_notices: rtrb::Consumer<Notice>,
    /// Scenes to free.
    pub old_worlds: rtrb::Consumer<Box<World>>,
    /// Finished lines, to the force loop; an order takes their columns to the tissue loop.
    pub lines: rtrb::Producer<Box<HandLine>>,
    /// Room for needles that stay in, to the force loop.
    pub rooms: rtrb::Producer<Box<LeftNeedles>>,
    /// Room to record the probe's displacement of the line, to the force loop.
    pub outside_rooms: rtrb::Producer<Box<OutsideTape>>,
    /// Lines to free.
    pub old_hand_lines: rtrb::Consumer<Box<HandLine>>,
    /// Columns to free.
    pub old_body_lines: rtrb::Consumer<Box<BodyLine>>,
    /// Probes to free.
    pub old_probes: rtrb::Consumer<Box<BodyProbe>>,
}

/// Ends for the tapes of the force loop and of the tissue loop, which the control thread owns too.
pub type TapePorts = (TapePort<HapticTape>, TapePort<TissueTape>);

/// All ends of one wiring; each side takes its own.
pub struct Wiring {
    /// For the force loop.
    pub haptic: HapticPorts,
    /// For the tissue loop.
    pub tissue: TissuePorts,
    /// For the control thread.
    pub control: ControlPorts,
    /// For what writes flight recordings.
    pub tapes: TapePorts,
}

impl Wiring {
    /// Connects two loops and a control thread. A loop without a tape is not recorded.
    // SYNC: every ring and triple buffer is single-producer single-consumer; their crates pair release with acquire.
    pub fn new(
        capacities: Capacities,
        haptic_tape: Option<Box<HapticTape>>,
        tissue_tape: Option<Box<TissueTape>>,
    ) -> Self {
        let (pose_in, pose_out) = triple_buffer::triple_buffer(&TipPose::default());
        let (response_in, response_out) = triple_buffer::triple_buffer(&TissueResponse::default());
        let (outside_in, outside_out) = triple_buffer::triple_buffer(&Outside::default());
        let (outside_rooms, outside_room_out) = rtrb::RingBuffer::new(ROOMS);
        let (record_in, records) = rtrb::RingBuffer::new(capacities.records);
        let (haptic_orders, haptic_order_out) = rtrb::RingBuffer::new(capacities.orders);
        let (haptic_notice_in, haptic_notices) = rtrb::RingBuffer::new(capacities.notices);
        let (tissue_orders, tissue_order_out) = rtrb::RingBuffer::new(capacities.orders);
        let (tissue_notice_in, tissue_notices) = rtrb::RingBuffer::new(capacities.notices);
        let (old_world_in, old_worlds) = rtrb::RingBuffer::new(capacities.old_worlds);
        let (lines, line_out) = rtrb::RingBuffer::new(LINES);
        let (rooms, room_out) = rtrb::RingBuffer::new(ROOMS);
        let (old_hand_line_in, old_hand_lines) = rtrb::RingBuffer::new(OLD_LINES);
        let (old_body_line_in, old_body_lines) = rtrb::RingBuffer::new(OLD_LINES);
        let (old_probe_in, old_probes) = rtrb::RingBuffer::new(OLD_PROBES);
        let (loads_in, loads_out) = triple_buffer::triple_buffer(&AllLoads::default());
        let (haptic_flight, haptic_tapes) = recorder(haptic_tape);
        let (tissue_flight, tissue_tapes) = recorder(tissue_tape);
        Self {
            haptic: HapticPorts {
                pose: pose_in,
                response: response_out,
                outside: outside_out,
                outside_rooms: outside_room_out,
                orders: haptic_order_out,
                notices: haptic_notice_in,
                records: record_in,
                lines: line_out,
                old_lines: old_hand_line_in,
                rooms: room_out,
                loads: loads_in,
                flight: haptic_flight,
            },
            tissue: TissuePorts {
                pose: pose_out,
                response: response_in,
                outside: outside_in,
                orders: tissue_order_out,
                notices: tissue_notice_in,
                old_worlds: old_world_in,
                old_lines: old_body_line_in,
                old_probes: old_probe_in,
                loads: loads_out,
                is_watched: Arc::default(),
                second: None,
                flight: tissue_flight,
            },
            control: ControlPorts {
                records,
                haptic_orders,
                haptic_notices,
                tissue_orders,
                tissue_notices,
                old_worlds,
                lines,
                rooms,
                outside_rooms,
                old_hand_lines,
                old_body_lines,
                old_probes,
            },
            tapes: (haptic_tapes, tissue_tapes),
        }
    }
}
