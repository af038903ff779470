//! The latest state of a loop that owns a device, on a blackboard of its own for each run.

use super::{Ipc, MAX_HOSTS, Node, ServiceError, core_failed, failed, host_failed, name};
use crate::{HapticState, SecondState};
use bytemuck::Zeroable;
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::prelude::{ServiceName, ZeroCopySend};
use iceoryx2::service::port_factory::blackboard::PortFactory;
use std::fmt::Debug;

/// The only key on the board.
const STATE_KEY: u64 = 0;

type Board = PortFactory<Ipc, u64>;

/// What stands on a board.
pub trait OnBoard: ZeroCopySend + Debug + Copy + Zeroable + 'static {
    /// Of the board, before the number of the run.
    const NAME: &'static str;
}

impl OnBoard for HapticState {
    const NAME: &'static str = "state";
}

impl OnBoard for SecondState {
    const NAME: &'static str = "second";
}

/// The board itself, created before the thread that writes it exists.
pub struct StateBoard<T = HapticState>(Box<dyn MakesWriter<T> + Send>);

/// Writes the board of one run.
pub struct StateWriter<T = HapticState>(Box<dyn Writes<T>>);

/// Reads the board of one run.
pub struct StateReader<T = HapticState>(Box<dyn Reads<T>>);

// As in `ports`: no other crate compiles what stands behind these.
trait MakesWriter<T> {
    fn writer(self: Box<Self>) -> Result<StateWriter<T>, ServiceError>;
}

trait Writes<T> {
    fn write(&self, state: &T);
}

trait Reads<T> {
    fn read(&self) -> T;
}

/// The entry goes first, then its port, then the board.
struct Port<E, P> {
    entry: E,
    _port: P,
    _board: Board,
}

impl<T: OnBoard> MakesWriter<T> for Board {
    fn writer(self: Box<Self>) -> Result<StateWriter<T>, ServiceError> {
        let port = self.writer_builder().create().map_err(|e| core_failed(T::NAME, e))?;
        let entry = port.entry::<T>(&STATE_KEY).map_err(|e| core_failed(T::NAME, e))?;
        Ok(StateWriter(Box::new(Port {
            entry,
            _port: port,
            _board: *self,
        })))
    }
}

impl<T: OnBoard> Writes<T> for Port<EntryHandleMut<Ipc, u64, T>, Writer<Ipc, u64>> {
    fn write(&self, state: &T) {
        self.entry.update_with_copy(*state);
    }
}

impl<T: OnBoard> Reads<T> for Port<EntryHandle<Ipc, u64, T>, Reader<Ipc, u64>> {
    fn read(&self) -> T {
        *self.entry.get()
    }
}

fn board_name<T: OnBoard>(session_id: u64) -> Result<ServiceName, ServiceError> {
    name(&format!("{}/{session_id:016x}", T::NAME))
}

impl<T: OnBoard> StateBoard<T> {
    /// A board named per run: a writer killed while it holds the entry would block its name for good (iceoryx2 issue 2008).
    pub fn create(node: &Node, session_id: u64) -> Result<Self, ServiceError> {
        let board = node
            .inner()
            .service_builder(&board_name::<T>(session_id)?)
            .blackboard_creator::<u64>()
            .add::<T>(STATE_KEY, T::zeroed())
            .max_readers(MAX_HOSTS + 2)
            .max_nodes(MAX_HOSTS + 4)
            .create()
            .map_err(|e| failed("state board", e))?;
        Ok(Self(Box::new(board)))
    }

    /// The one that writes. Made and used by one thread; making it allocates.
    pub fn writer(self) -> Result<StateWriter<T>, ServiceError> {
        self.0.writer()
    }
}

impl<T> StateWriter<T> {
    /// Shows a state to every host; neither waits nor allocates.
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
        let entry = port.entry::<T>(&STATE_KEY).map_err(|e| host_failed(T::NAME, e))?;
        Ok(Self(Box::new(Port {
            entry,
            _port: port,
            _board: board,
        })))
    }

    /// The latest state.
    pub fn read(&self) -> T {
        self.0.read()
    }
}
