//! Computations for each picture of the body: its surfaces, extracted from the labels, carried by
//! the tissue and cut by planes, and the field of displacements. No port, no window.

#![warn(missing_docs)]

pub mod bodies;
pub mod field;
pub mod mesh;
