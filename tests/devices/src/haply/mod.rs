//! The Inverse3 back end over the fake Inverse service.

mod faults;
mod opening;
mod threads;
