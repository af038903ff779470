//! The wall between the process that owns the device and its bridge, the process that serves hosts in shared memory.
//!
//! The force process maps no memory that another process can write. The bridge gets from it:
//!
//! - [`board`]: the newest state and the newest snapshots, in memory that only the force process can write: the kernel
//!   refuses any other writable mapping (`F_SEAL_FUTURE_WRITE`);
//! - [`packet`]: everything else, in packets of a socket, with descriptors of sealed memory for large data.
//!
//! The force process gets only packets from the bridge. They are untrusted input: any host may damage a bridge, so each
//! packet is checked before it is used.

#![warn(missing_docs)]

#[cfg(not(target_family = "wasm"))]
pub mod board;
#[cfg(not(target_family = "wasm"))]
mod cells;
pub mod kind;
#[cfg(not(target_family = "wasm"))]
pub mod packet;
