//! The latest state of the force loop, on a blackboard of its own for each run.

use super::{Ipc, MAX_HOSTS, Node, ServiceError, core_failed, failed, host_failed, name};
use crate::HapticState;
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::prelude::ServiceName;
use iceoryx2::service::port_factory::blackboard::PortFactory;

/// The only key on the board.
const STATE_KEY: u64 = 0;

type Board = PortFactory<Ipc, u64>;

/// The board itself, created before the thread that writes it exists.
pub struct StateBoard(Box<dyn MakesWriter + Send>);

/// Writes the board of one run.
pub struct StateWriter(Box<dyn Writes>);

/// Reads the board of one run.
pub struct StateReader(Box<dyn Reads>);

// As in `ports`: no other crate compiles what stands behind these.
trait MakesWriter {
    fn writer(self: Box<Self>) -> Result<StateWriter, ServiceError>;
}

trait Writes {
    fn write(&self, state: &HapticState);
}

trait Reads {
    fn read(&self) -> HapticState;
}

/// The entry goes first, then its port, then the board.
struct Port<E, P> {
    entry: E,
    _port: P,
    _board: Board,
}

impl MakesWriter for Board {
    fn writer(self: Box<Self>) -> Result<StateWriter, ServiceError> {
        let port = self.writer_builder().create().map_err(|e| core_failed("state", e))?;
        let entry = port
            .entry::<HapticState>(&STATE_KEY)
            .map_err(|e| core_failed("state", e))?;
        Ok(StateWriter(Box::new(Port {
            entry,
            _port: port,
            _board: *self,
        })))
    }
}

impl Writes for Port<EntryHandleMut<Ipc, u64, HapticState>, Writer<Ipc, u64>> {
    fn write(&self, state: &HapticState) {
        self.entry.update_with_copy(*state);
    }
}

impl Reads for Port<EntryHandle<Ipc, u64, HapticState>, Reader<Ipc, u64>> {
    fn read(&self) -> HapticState {
        *self.entry.get()
    }
}

fn board_name(session_id: u64) -> Result<ServiceName, ServiceError> {
    name(&format!("state/{session_id:016x}"))
}

impl StateBoard {
    /// A board named per run: a writer killed while it holds the entry would block its name for good (iceoryx2 issue 2008).
    pub fn create(node: &Node, session_id: u64) -> Result<Self, ServiceError> {
        let board = node
            .inner()
            .service_builder(&board_name(session_id)?)
            .blackboard_creator::<u64>()
            .add::<HapticState>(STATE_KEY, bytemuck::Zeroable::zeroed())
            .max_readers(MAX_HOSTS + 2)
            .max_nodes(MAX_HOSTS + 4)
            .create()
            .map_err(|e| failed("state board", e))?;
        Ok(Self(Box::new(board)))
    }

    /// The one that writes. Made and used by one thread; making it allocates.
    pub fn writer(self) -> Result<StateWriter, ServiceError> {
        self.0.writer()
    }
}

impl StateWriter {
    /// Shows a state to every host; neither waits nor allocates.
    pub fn write(&self, state: &HapticState) {
        self.0.write(state);
    }
}

impl StateReader {
    /// Opens the board of the run `session_id`.
    pub fn open(node: &Node, session_id: u64) -> Result<Self, ServiceError> {
        let board = node
            .inner()
            .service_builder(&board_name(session_id)?)
            .blackboard_opener::<u64>()
            .open()
            .map_err(|e| failed("state board", e))?;
        let port = board.reader_builder().create().map_err(|e| host_failed("state", e))?;
        let entry = port
            .entry::<HapticState>(&STATE_KEY)
            .map_err(|e| host_failed("state", e))?;
        Ok(Self(Box::new(Port {
            entry,
            _port: port,
            _board: board,
        })))
    }

    /// The latest state.
    pub fn read(&self) -> HapticState {
        self.0.read()
    }
}
