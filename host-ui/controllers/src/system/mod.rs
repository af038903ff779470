//! Devices of the system, as the kernel of Linux lists and reads them.

mod abilities;
mod axis;
mod error;
mod found;
mod hub;
mod list;
mod reader;
mod state;

pub use axis::Axis;
pub use error::{ListError, OpenError};
pub use found::{Found, Places, find};
pub use hub::{DeviceHub, DeviceSource, OpenDevice};
pub use list::list;
pub use reader::{Controllers, System};
pub use state::DeviceState;
