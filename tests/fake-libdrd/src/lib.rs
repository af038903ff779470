//! A `libdrd.so` for tests: the functions of the Force Dimension ABI that Stylet uses, over a device whose firmware
//! drops a force that is not renewed, with errors on command.
//!
//! Names and signatures are typed independently here ([`table`]), which reveals a wrong one in the code under test. The
//! test and the fake share a [`Control`] block: in one process through `fake_control`, in two through the file named by
//! the variable [`control::VARIABLE`].

#![warn(missing_docs)]

mod abi;
pub mod control;
mod firmware;
pub mod table;

pub use control::Control;
pub use fake_control::Block;
