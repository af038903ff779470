//! A device behind a servo thread, as the force loop sees it: two wait-free ends.

use std::sync::Arc;

use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use crate::driver_thread::ends::{self, ForceLoopEnd, ServoEnd};
use crate::driver_thread::keeper::{self, Connect, KeeperThread, Report};
use crate::driver_thread::open::{self, OpenError};
use crate::driver_thread::shared::Shared;

/// Description of a connected device.
pub trait Described: Send + 'static {
    /// Limits of the device.
    fn info(&self) -> DeviceInfo;
}

/// Device that a servo thread serves and a keeper connects. Dropping it leaves zero force and a
/// closed connection.
pub struct Served<D> {
    description: D,
    shared: Arc<Shared>,
    end: ForceLoopEnd,
    _keeper: KeeperThread,
}

impl<D: Described> Served<D> {
    /// Starts the keeper that `connector` makes, under the given name, and waits for its first
    /// result.
    pub(crate) fn start<C>(
        name: &str,
        report: Report,
        connector: impl FnOnce(Arc<Shared>, ServoEnd) -> C,
    ) -> Result<Self, OpenError<C::Error>>
    where
        C: Connect<Description = D>,
        C::Error: core::error::Error,
    {
        let (end, servo_end) = ends::pair();
        let shared = Arc::<Shared>::default();
        let connector = connector(Arc::clone(&shared), servo_end);
        let (keeper, opened) = keeper::spawn(name, connector, report);
        let description = open::first(&opened)?;
        Ok(Self {
            description,
            shared,
            end,
            _keeper: keeper,
        })
    }

    /// Properties of the device at the first connection.
    pub fn description(&self) -> &D {
        &self.description
    }

    /// Returns how many errors the driver has reported.
    pub fn error_count(&self) -> u64 {
        self.shared.errors.count()
    }
}

impl<D: Described> Device for Served<D> {
    fn info(&self) -> DeviceInfo {
        self.description.info()
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        self.end.read(self.shared.fault.get())
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        self.end.write(&self.description.info(), wrench)
    }
}
