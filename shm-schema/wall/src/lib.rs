//! The wall between the process that owns the device and its bridge, the process that meets hosts in shared memory.
//!
//! The force process maps no memory that another process can write. What the bridge gets from it:
//!
//! - [`board`]: the newest state and the newest snapshots, in memory that the force process writes and that the kernel lets
//!   nobody else map writable (`F_SEAL_FUTURE_WRITE`);
//! - [`packet`]: everything else, in packets of a socket, with descriptors of sealed memory where it is large.
//!
//! What the force process gets from the bridge are packets alone. They are input from outside: a bridge may be damaged by
//! any host, so each is checked before it is used.

#![warn(missing_docs)]

pub mod board;
mod cells;
pub mod packet;
