//! The Force Dimension back end over the fake `libdrd.so`.

mod abi;
mod fake;
mod faults;
mod threads;
