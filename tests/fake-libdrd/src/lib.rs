//! A `libdrd.so` for tests: the functions of the Force Dimension ABI that Stylet knows, over a device whose firmware drops a
//! force that is not renewed, with errors on command.
//!
//! Names and signatures are typed here a second time ([`table`]), which reveals a wrong one in the code under test. The test and
//! the fake share a [`Control`] block: in one process through `fake_control`, in two through the file that the variable
//! [`control::VARIABLE`] names.

#![warn(missing_docs)]

mod abi;
pub mod control;
mod firmware;
pub mod table;

pub use control::Control;
pub use fake_control::Block;
