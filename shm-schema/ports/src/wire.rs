//! Wraps the contract's types for iceoryx2: neither its trait nor these types are local to this crate.

use bytemuck::{Pod, TransparentWrapper};
use iceoryx2::prelude::ZeroCopySend;
use std::fmt::Debug;

/// A value in shared memory.
#[derive(Clone, Copy, Debug, Default, TransparentWrapper)]
#[repr(transparent)]
pub struct Wire<T>(pub T);

// SAFETY: plain old data has no pointer and no destructor, and every program takes its layout from the contract, whose
// version is part of every service name.
unsafe impl<T: Pod + Debug> ZeroCopySend for Wire<T> {}
