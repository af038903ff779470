//! A `libHD.so` for tests: 22 functions of the driver's ABI over a simulated Phantom, with errors on command.
//!
//! Numbers and units are typed independently here ([`table`]), which reveals a wrong number in the code under test. The
//! test and the fake share a [`Control`] block: in one process through `fake_control`, in two through the file named by
//! the variable [`control::VARIABLE`].

#![warn(missing_docs)]

mod abi;
pub mod control;
mod driver;
mod scheduler;
pub mod table;

pub use control::Control;
pub use fake_control::Block;
