//! OpenIGTLink, the protocol of 3D Slicer and PLUS: a codec of six messages without I/O, and a server over TCP.

#![warn(missing_docs)]

pub mod codec;
mod frame;
pub mod hand;
mod image;
mod requests;
pub mod serve;
pub mod server;
