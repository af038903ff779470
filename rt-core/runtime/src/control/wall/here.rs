//! The host in the same process: it asks, reads and sets the time between two steps.

use super::{Asked, Wall};
use crate::background::Work;
use crate::rt::shown::{Shown, SnapshotHere};
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::io;
use std::rc::Rc;
use std::time::Duration;
use stylet_shm_schema::*;
use stylet_wall::kind::Kind;

/// What the control thread tells its host.
#[derive(Clone, Debug)]
pub enum Told {
    /// The run, five times a second.
    Session(Box<Session>),
    /// Parameters in force.
    Parameters(Box<ParametersInForce>),
    /// The plan's needle in force.
    Plan(Box<PlanInForce>),
    /// An event.
    Event(Box<Event>),
    /// The answer to a request.
    Reply(Box<Reply>),
    /// The result of a rehearsal; it precedes the answer to its request.
    Rehearsal(Box<Rehearsal>),
    /// The next ticks of the force loop.
    Records(Vec<TickRecord>),
    /// A scene, and the words behind its header.
    Scene(Box<SceneHeader>, Vec<u32>),
    /// The newest snapshot: its vertices and nodes.
    Snapshot(Box<SnapshotHeader>, Vec<Vertex>),
}

/// What both sides reach.
#[derive(Default)]
pub struct Desk {
    /// Time of the last step, ns.
    pub now_ns: Cell<u64>,
    /// Requests not yet taken.
    pub asked: RefCell<VecDeque<Asked>>,
    /// What the host has not yet taken.
    told: RefCell<Vec<Told>>,
    snapshots: RefCell<Option<triple_buffer::Output<SnapshotHere>>>,
}

impl Desk {
    /// Returns what was told since the last call; a new snapshot comes last.
    pub fn take(&self) -> Vec<Told> {
        let mut told = self.told.take();
        let mut snapshots = self.snapshots.borrow_mut();
        if let Some(snapshots) = snapshots.as_mut().filter(|snapshots| snapshots.updated()) {
            let (header, values) = snapshots.read();
            told.push(Told::Snapshot(Box::new(*header), values.clone()));
        }
        told
    }
}

/// The control thread's side.
pub struct Here {
    desk: Rc<Desk>,
    newest: Option<TickRecord>,
    /// Board of the scene that is shown next.
    made: Option<triple_buffer::Output<SnapshotHere>>,
}

impl Here {
    /// Returns the control thread's side of this desk.
    pub fn at(desk: Rc<Desk>) -> Self {
        Self {
            desk,
            newest: None,
            made: None,
        }
    }

    fn tell(&self, told: Told) {
        self.desk.told.borrow_mut().push(told);
    }
}

impl Wall for Here {
    fn now_ns(&self) -> u64 {
        self.desk.now_ns.get()
    }

    /// The same step gives the same bytes on every machine.
    fn work(&self) -> Work {
        Work::AtOnce
    }

    fn is_open(&self) -> bool {
        true
    }

    fn wait(&self, _longest: Duration) {}

    fn pass(&mut self) {}

    fn take_lost(&mut self) -> Option<String> {
        None
    }

    fn take_asked(&mut self) -> Option<Asked> {
        self.desk.asked.borrow_mut().pop_front()
    }

    fn refused(&self) -> u64 {
        0
    }

    fn newest_record(&self) -> Option<&TickRecord> {
        self.newest.as_ref()
    }

    fn take_records(&mut self, records: &mut rtrb::Consumer<TickRecord>) {
        let mut told = self.desk.told.borrow_mut();
        while let Ok(record) = records.pop() {
            self.newest = Some(record);
            match told.last_mut() {
                Some(Told::Records(batch)) => batch.push(record),
                _ => told.push(Told::Records(vec![record])),
            }
        }
    }

    fn take_second_records(&mut self, records: &mut rtrb::Consumer<SecondRecord>) -> bool {
        std::iter::from_fn(|| records.pop().ok()).count() > 0
    }

    fn put(&mut self, kind: Kind, bytes: &[u8]) {
        self.tell(match kind {
            Kind::Session => Told::Session(value(bytes)),
            Kind::Parameters => Told::Parameters(value(bytes)),
            Kind::Plan => Told::Plan(value(bytes)),
            Kind::Event => Told::Event(value(bytes)),
            Kind::Reply => Told::Reply(value(bytes)),
            Kind::Rehearsal => Told::Rehearsal(value(bytes)),
            _ => return,
        });
    }

    fn make_board(&mut self, len: usize) -> io::Result<Shown> {
        let empty = (SnapshotHeader::default(), vec![Vertex::default(); len]);
        let (input, output) = triple_buffer::triple_buffer(&empty);
        self.made = Some(output);
        Ok(Shown::Here(input))
    }

    fn show_scene(&mut self, header: &SceneHeader, words: &[u32]) {
        if let Some(made) = self.made.take() {
            *self.desk.snapshots.borrow_mut() = Some(made);
        }
        self.tell(Told::Scene(Box::new(*header), words.to_vec()));
    }
}

/// Returns the value of these bytes, which are those of one.
fn value<T: bytemuck::AnyBitPattern>(bytes: &[u8]) -> Box<T> {
    Box::new(bytemuck::pod_read_unaligned(bytes))
}
