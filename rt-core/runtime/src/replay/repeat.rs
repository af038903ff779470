//! Runs both loops again from a recording, and reports differences in their outputs.

use super::file::Flight;
use super::lines::{LinesAgain, hand_line};
use crate::lines::{NoLine, NoProbe};
use crate::rt::device_tape::DeviceEntry;
use crate::rt::exchange::{HapticOrder, Ticket, TissueOrder};
use crate::rt::hand::DeviceAnswer;
use crate::rt::haptic::HapticLoop;
use crate::rt::haptic_tape::{HapticEntry, HapticFlight, HapticTape};
use crate::rt::line_loads::AllLoads;
use crate::rt::probe_tape::{ProbeEntry, ProbeTape};
use crate::rt::response::TissueResponse;
use crate::rt::tissue::TissueLoop;
use crate::rt::tissue_tape::{TapedOrder, TissueEntry, TissueFlight, TissueMemory, TissueTape};
use crate::rt::wiring::{Capacities, Wiring};
use crate::rt::world::World;
use std::iter::Peekable;
use std::sync::Arc;
use stylet_hw::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use stylet_shm_schema::{DeadlineTotals, TickRecord};
use stylet_sim::line::LeftNeedles;
use stylet_sim::scene::SceneError;
use stylet_sim::tissue::{Held, TissueError};

/// The result of repeating one loop.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Repeated {
    /// Ticks repeated.
    pub ticks: usize,
    /// Ticks whose output differs in any bit.
    pub different: usize,
    /// First differing tick, counted from the start of the recording.
    pub first_different: Option<usize>,
    /// Positions compared: each element at each checkpoint and at the end.
    pub positions: usize,
    /// Number of `positions` that differ.
    pub different_positions: usize,
    /// Needle lines whose columns were solved again.
    pub lines: usize,
    /// Number of `lines` that differ from the recorded ones in any bit.
    pub different_lines: usize,
}

impl Repeated {
    /// True if something was repeated and every bit is the same.
    pub fn is_identical(&self) -> bool {
        self.ticks > 0 && self.different == 0 && self.different_positions == 0 && self.different_lines == 0
    }

    pub(super) fn count(&mut self, index: usize, same: bool) {
        self.ticks += 1;
        if !same {
            self.different += 1;
            self.first_different.get_or_insert(index);
        }
    }
}

/// A device that returns the recorded answers.
pub(super) struct RecordedDevice {
    info: DeviceInfo,
    answers: std::vec::IntoIter<DeviceAnswer>,
    write_failed: bool,
}

impl RecordedDevice {
    pub fn boxed<R, T>(info: DeviceInfo, ticks: &[DeviceEntry<R, T>]) -> Box<Self> {
        let answers: Vec<_> = ticks.iter().map(|tick| tick.answer).collect();
        Box::new(Self {
            info,
            answers: answers.into_iter(),
            write_failed: false,
        })
    }
}

impl Device for RecordedDevice {
    fn info(&self) -> DeviceInfo {
        self.info
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        let answer = self.answers.next().unwrap_or_default();
        self.write_failed = answer.write_failed;
        answer.read
    }

    fn write(&mut self, _wrench: &Wrench) -> Result<(), DeviceFault> {
        if self.write_failed {
            Err(DeviceFault::Driver)
        } else {
            Ok(())
        }
    }
}

/// Returns the record with the times of its tick cleared.
fn without_times(record: &TickRecord) -> TickRecord {
    TickRecord {
        force_written_ns: 0,
        work_ns: 0,
        ..*record
    }
}

/// A repeated output, beside which the recording has its own.
#[derive(Clone, Copy, Debug)]
pub enum Again<'a> {
    /// Record of a tick of the force loop, counted from the start of the recording.
    Record(usize, &'a TickRecord),
    /// Response of a tick of the tissue loop.
    Response(usize, &'a TissueResponse),
    /// Displacement of an element, m: recorded and repeated.
    Displacement([f64; 3], [f64; 3]),
}

/// Repeats the haptic chain: forces, phases, faults and flags of each tick, on needle lines as well.
pub fn haptic(flight: &Flight, recorded: &HapticFlight) -> Result<Repeated, RepeatError> {
    haptic_seen(flight, recorded, &mut |_| {})
}

/// As [`haptic`]; `see` gets each record.
pub fn haptic_seen(
    flight: &Flight,
    recorded: &HapticFlight,
    see: &mut dyn FnMut(Again),
) -> Result<Repeated, RepeatError> {
    let tape = Box::new(HapticTape::new(&recorded.memory));
    let Wiring {
        haptic: ports,
        mut tissue,
        mut control,
        ..
    } = Wiring::new(capacities(recorded.orders.len()), Some(tape), None);
    let device = RecordedDevice::boxed(flight.device, &recorded.ticks);
    let (session_id, period_s) = (flight.session_id, flight.haptic_period_s);
    let mut again = HapticLoop::new(session_id, device, ports, &recorded.memory, period_s);
    if let Some(state) = &recorded.line_state {
        let generation = recorded.memory.line;
        let mut line = hand_line(flight, generation)?;
        if !line.take_state(state) {
            return Err(RepeatError::OtherLine(generation));
        }
        again.resume_line(line);
    }
    if recorded.left.line_numbers().next().is_some()
        && !again.resume_left(&recorded.left, |generation| hand_line(flight, generation).ok())
    {
        return Err(RepeatError::OtherLeft);
    }
    let _ = control.rooms.push(LeftNeedles::with_room());
    let mut found = Repeated::default();
    let mut orders = recorded.orders.iter().peekable();
    let mut lines = recorded.lines.iter().peekable();
    let mut outside = recorded.outside.iter().peekable();
    for (index, entry) in recorded.ticks.iter().enumerate() {
        for line in at(&mut lines, index) {
            let _ = control.lines.push(hand_line(flight, *line)?);
        }
        at(&mut orders, index).for_each(|order| push_order(&mut control.haptic_orders, *order));
        // Without a probe on a line, the loop must find no input here rather than that of an older tick.
        let of_lines = tissue.outside.input_buffer_mut();
        of_lines.clear();
        for of_line in at(&mut outside, index) {
            if let Some(line) = of_lines.add() {
                *line = *of_line;
            }
        }
        tissue.outside.publish();
        tissue.response.write(entry.response);
        again.tick(entry.record.due_ns, entry.woke_ns, entry.record.missed);
        while control.haptic_notices.pop().is_ok() {}
        while control.old_hand_lines.pop().is_ok() {}
        let record = control.records.pop();
        if let Ok(record) = &record {
            see(Again::Record(index, record));
        }
        found.count(index, record.is_ok_and(|record| is_same(&record, entry)));
    }
    Ok(found)
}

/// Returns the values of that tick.
pub(super) fn at<'a, T: 'a>(
    values: &mut Peekable<impl Iterator<Item = &'a (u64, T)>>,
    index: usize,
) -> impl Iterator<Item = &'a T> {
    std::iter::from_fn(move || {
        values
            .next_if(|(tick, _)| *tick == index as u64)
            .map(|(_, value)| value)
    })
}

/// Handing over a tape does not affect the loop.
pub(super) fn push_order(orders: &mut rtrb::Producer<(Ticket, HapticOrder)>, order: HapticOrder) {
    if order != HapticOrder::HandOverTape {
        let _ = orders.push((0, order));
    }
}

/// Returns capacities with room for all orders of the recording in one tick.
pub(super) fn capacities(orders: usize) -> Capacities {
    Capacities {
        orders: orders.max(1),
        notices: 1024,
        ..Capacities::STEPPED
    }
}

fn is_same(record: &TickRecord, entry: &HapticEntry) -> bool {
    bytemuck::bytes_of(&without_times(record)) == bytemuck::bytes_of(&without_times(&entry.record))
}

/// Reason why a recording cannot be repeated.
#[derive(Debug, thiserror::Error)]
pub enum RepeatError {
    /// The scene of the recording cannot be built again.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its tissue cannot be set up.
    #[error(transparent)]
    World(#[from] TissueError),
    /// The recorded body has another size than the scene gives.
    #[error("the recorded tissue is not that of its scene: another version recorded it")]
    OtherBody,
    /// A loop had a line that is not among those of the recording.
    #[error("the recording lacks needle line {0}, which a loop had: it cannot be repeated")]
    NoLine(u64),
    /// The recorded state has another size than the line.
    #[error("the recorded state of needle line {0} is not one of that line: the file was changed")]
    OtherLine(u64),
    /// The needles that stayed in are not those of the recorded lines.
    #[error("the recorded needles that stay in the tissue do not fit their lines: the file was changed")]
    OtherLeft,
    /// A line cannot be used, or its columns cannot be solved again.
    #[error(transparent)]
    Line(#[from] NoLine),
    /// The answers of its probe cannot be solved again.
    #[error("the recording has an ultrasound probe, which its scene does not give: {0}")]
    NoProbe(#[from] NoProbe),
    /// The wall of the recorded probe is not that of the scene.
    #[error("the recorded ultrasound probe does not fit its scene: another version recorded it")]
    OtherProbe,
}

/// Repeats the tissue chain: response and held element of each tick, and every element's position at each checkpoint.
/// `lines` comes from [`solve_again`](super::lines::solve_again).
pub fn tissue(flight: &Flight, recorded: &TissueFlight, lines: LinesAgain) -> Result<Repeated, RepeatError> {
    tissue_seen(flight, recorded, lines, &mut |_| {})
}

/// As [`tissue`]; `see` gets each response, and each displacement at the checkpoints.
pub fn tissue_seen(
    flight: &Flight,
    recorded: &TissueFlight,
    mut lines: LinesAgain,
    see: &mut dyn FnMut(Again),
) -> Result<Repeated, RepeatError> {
    let scene = recorded.scene.build()?;
    let world = || World::new(scene.clone(), recorded.tissue, recorded.memory.limits.clone(), 1).map(Box::new);
    let reference = world()?;
    if reference.tissue.memory_len() != recorded.memory.body.len() {
        return Err(RepeatError::OtherBody);
    }
    let tape = Box::new(TissueTape::new(&reference, Arc::new(recorded.scene.clone())));
    let Wiring {
        mut haptic,
        tissue: ports,
        mut control,
        ..
    } = Wiring::new(capacities(recorded.orders.len()), None, Some(tape));
    let mut again = TissueLoop::new(flight.session_id, ports, world()?, flight.tissue_period_s);
    let before = match recorded.memory.state.response.line {
        0 => None,
        line => Some(lines.take(line).ok_or(RepeatError::NoLine(line))?),
    };
    let left = recorded.memory.left.iter().map(|left| {
        let generation = left.generation;
        lines.take(generation).ok_or(RepeatError::NoLine(generation))
    });
    let left = left.collect::<Result<Vec<_>, _>>()?;
    again.remember(&recorded.memory, before, left);
    if recorded.memory.probe.is_there {
        let probe = lines.probe.clone().ok_or(RepeatError::OtherProbe)?;
        if !again.resume_probe(Box::new(probe), &recorded.memory) {
            return Err(RepeatError::OtherProbe);
        }
    }
    let mut all = AllLoads::default();
    let mut compare = Bodies {
        reference,
        found: Repeated {
            lines: lines.solved,
            different_lines: lines.different,
            ..Repeated::default()
        },
    };
    let mut left = recorded.left.iter().peekable();
    let mut orders = recorded.orders.iter().peekable();
    let mut probe = recorded.probe.iter().peekable();
    for (index, entry) in recorded.ticks.iter().enumerate() {
        if let Some((_, memory)) = recorded.middle.as_ref().filter(|(tick, _)| *tick == index as u64) {
            compare.positions(&again, memory, see);
        }
        for order in at(&mut orders, index) {
            let _ = control.tissue_orders.push(order_of(order, &mut lines)?);
        }
        all.line = entry.loads;
        at(&mut left, index).for_each(|left| all.left = *left);
        haptic.loads.write(all);
        let pressed = at(&mut probe, index).last();
        if let Some(entry) = pressed {
            again.move_probe(entry.pose);
        }
        haptic.pose.write(entry.pose);
        again.tick(entry.woke_ns);
        while control.tissue_notices.pop().is_ok() {}
        while control.old_body_lines.pop().is_ok() {}
        see(Again::Response(index, again.response()));
        compare
            .found
            .count(index, same_step(&again, entry) && is_pressed_so(&again, pressed));
    }
    compare.positions(&again, &recorded.end, see);
    Ok(compare.found)
}

fn order_of(order: &TapedOrder, lines: &mut LinesAgain) -> Result<TissueOrder, RepeatError> {
    Ok(match order {
        TapedOrder::Step(step) => TissueOrder::Step(0, step.clone()),
        TapedOrder::Line { generation } => {
            TissueOrder::Line(lines.take(*generation).ok_or(RepeatError::NoLine(*generation))?)
        }
        TapedOrder::Probe { .. } => {
            let probe = Box::new(lines.probe.clone().ok_or(RepeatError::OtherProbe)?);
            TissueOrder::Probe {
                generation: 1,
                room: ProbeTape::new(&probe),
                probe,
            }
        }
    })
}

/// True if every bit is the same, except what depends on the clock.
fn same_step(again: &TissueLoop, entry: &TissueEntry) -> bool {
    let bits = |response: &TissueResponse, held: Option<Held>, residual: f64| {
        let without_times = TissueResponse {
            worst_work_ns: 0,
            worst_wake_ns: 0,
            missed: 0,
            since_start: DeadlineTotals::default(),
            since_armed: DeadlineTotals::default(),
            ..*response
        };
        postcard::to_stdvec(&(without_times, held, residual)).ok()
    };
    let (held, residual) = again.last_step();
    bits(again.response(), held, residual) == bits(&entry.response, entry.held, entry.residual)
}

/// True if the probe pushes the hand with the same bits.
fn is_pressed_so(again: &TissueLoop, entry: Option<&ProbeEntry>) -> bool {
    let bits = |wrench: &[f64; 6]| wrench.map(f64::to_bits);
    let now = again.probe_response().map(|response| bits(&response.wrench.0));
    entry.is_none_or(|entry| now == Some(bits(&entry.wrench)))
}

/// Compares whole bodies.
struct Bodies {
    /// Loads the recorded bodies.
    reference: Box<World>,
    found: Repeated,
}

impl Bodies {
    fn positions(&mut self, again: &TissueLoop, recorded: &TissueMemory, see: &mut dyn FnMut(Again)) {
        if recorded.probe.is_there && again.probe_memory() != recorded.probe {
            self.found.different_positions += 1;
        }
        self.reference.tissue.load(&recorded.body);
        let (then, now) = (self.reference.tissue.deformed(), again.body());
        let bits = |u: [f64; 3]| u.map(f64::to_bits);
        for element in 0..then.lattice.element_count() as u32 {
            self.found.positions += 1;
            let [then_m, now_m] = [&then, &now].map(|body| body.displacement(element));
            see(Again::Displacement(then_m, now_m));
            if bits(then_m) != bits(now_m) {
                self.found.different_positions += 1;
            }
        }
    }
}
