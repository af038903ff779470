//! The latest state of a loop that owns a device, on a separate blackboard for each run.

use super::wire::Wire;
use super::{Ipc, MAX_HOSTS, Node, ServiceError, core_failed, failed, host_failed, name};
use bytemuck::Pod;
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::prelude::ServiceName;
use iceoryx2::service::port_factory::blackboard::PortFactory;
use std::fmt::Debug;
use stylet_shm_schema::{HapticState, SecondState};

/// The only key on the board.
const STATE_KEY: u64 = 0;

type Board = PortFactory<Ipc, u64>;

/// State shown on a board.
pub trait OnBoard: Pod + Debug {
    /// Name of the board, before the number of the run.
    const NAME: &'static str;
}

impl OnBoard for HapticState {
    const NAME: &'static str = "state";
}

impl OnBoard for SecondState {
    const NAME: &'static str = "second";
}

/// Writes the board of one run.
pub struct StateWriter<T = HapticState>(Box<dyn Writes<T>>);

/// Reads the board of one run.
pub struct StateReader<T = HapticState>(Box<dyn Reads<T>>);

// As in `ports`: no other crate compiles the types behind these.
trait Writes<T> {
    fn write(&self, state: &T);
}

trait Reads<T> {
    fn read(&self) -> T;
}

/// Dropped in this order: entry, port, board.
struct Port<E, P> {
    entry: E,
    _port: P,
    _board: Board,
}

impl<T: OnBoard> Writes<T> for Port<EntryHandleMut<Ipc, u64, Wire<T>>, Writer<Ipc, u64>> {
    fn write(&self, state: &T) {
        self.entry.update_with_copy(Wire(*state));
    }
}

impl<T: OnBoard> Reads<T> for Port<EntryHandle<Ipc, u64, Wire<T>>, Reader<Ipc, u64>> {
    fn read(&self) -> T {
        self.entry.get().0
    }
}

fn board_name<T: OnBoard>(session_id: u64) -> Result<ServiceName, ServiceError> {
    name(&format!("{}/{session_id:016x}", T::NAME))
}

impl<T: OnBoard> StateWriter<T> {
    /// Creates the board of the run `session_id` and its only writer.
    pub fn create(node: &Node, session_id: u64) -> Result<Self, ServiceError> {
        let board = node
            .inner()
            .service_builder(&board_name::<T>(session_id)?)
            .blackboard_creator::<u64>()
            .add::<Wire<T>>(STATE_KEY, Wire(T::zeroed()))
            .max_readers(MAX_HOSTS + 2)
            .max_nodes(MAX_HOSTS + 4)
            .create()
            .map_err(|e| failed("state board", e))?;
        let port = board.writer_builder().create().map_err(|e| core_failed(T::NAME, e))?;
        let entry = port.entry::<Wire<T>>(&STATE_KEY).map_err(|e| core_failed(T::NAME, e))?;
        Ok(Self(Box::new(Port {
            entry,
            _port: port,
            _board: board,
        })))
    }
}

impl<T> StateWriter<T> {
    /// Shows a state to every host.
    pub fn write(&self, state: &T) {
        self.0.write(state);
    }
}

impl<T: OnBoard> StateReader<T> {
    /// Opens the board of the run `session_id`.
    pub fn open(node: &Node, session_id: u64) -> Result<Self, ServiceError> {
        let board = node
            .inner()
            .service_builder(&board_name::<T>(session_id)?)
            .blackboard_opener::<u64>()
            .open()
            .map_err(|e| failed("state board", e))?;
        let port = board.reader_builder().create().map_err(|e| host_failed(T::NAME, e))?;
        let entry = port.entry::<Wire<T>>(&STATE_KEY).map_err(|e| host_failed(T::NAME, e))?;
        Ok(Self(Box::new(Port {
            entry,
            _port: port,
            _board: board,
        })))
    }

    /// Returns the latest state.
    pub fn read(&self) -> T {
        self.0.read()
    }
}
