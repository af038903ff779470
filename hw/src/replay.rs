//! A device that plays back recorded samples and ignores the written force.

use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};

/// Device that plays its samples once, at their recorded rate, then repeats the last one like a
/// silent device.
#[derive(Debug, Clone)]
pub struct ReplayDevice {
    info: DeviceInfo,
    samples: Vec<Sample>,
    period_s: f64,
    /// Place in the recording, in periods.
    position_periods: f64,
    started: bool,
}

impl ReplayDevice {
    /// Creates a device from `samples` taken `period_s` apart, whose sequence numbers are replaced.
    /// Returns `None` without a sample, if one is not finite, or if the period is not above zero.
    ///
    /// ```
    /// use stylet_hw::{Device, DeviceInfo, ReplayDevice, SimulatedPhantom, SimulatedPhantomConfig};
    /// let mut hand = SimulatedPhantom::new(SimulatedPhantomConfig::default());
    /// let recorded: Vec<_> = (0..3).map(|_| hand.read(1e-3).unwrap()).collect();
    /// let mut played = ReplayDevice::new(DeviceInfo::phantom_premium_1_5(), recorded.clone(), 1e-3).unwrap();
    /// assert_eq!(played.read(1e-3).unwrap().tip_in_world, recorded[0].tip_in_world);
    /// ```
    pub fn new(info: DeviceInfo, mut samples: Vec<Sample>, period_s: f64) -> Option<Self> {
        let valid =
            !samples.is_empty() && samples.iter().all(Sample::is_finite) && period_s.is_finite() && period_s > 0.0;
        for (sample, sequence) in samples.iter_mut().zip(1..) {
            sample.sequence = sequence;
        }
        valid.then_some(Self {
            info: DeviceInfo {
                name: "recorded hand",
                simulated: true,
                ..info
            },
            samples,
            period_s,
            position_periods: 0.0,
            started: false,
        })
    }

    fn index(&self) -> usize {
        (self.position_periods.round() as usize).min(self.samples.len() - 1)
    }
}

impl Device for ReplayDevice {
    fn info(&self) -> DeviceInfo {
        self.info
    }

    fn read(&mut self, dt_s: f64) -> Result<Sample, DeviceFault> {
        if !dt_s.is_finite() || dt_s < 0.0 {
            return Err(DeviceFault::InvalidPeriod);
        }
        if self.started {
            // Not past the end, where a long session would lose the fraction to rounding.
            let next = self.position_periods + dt_s / self.period_s;
            self.position_periods = next.min((self.samples.len() - 1) as f64);
        }
        self.started = true;
        Ok(self.samples[self.index()])
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        // No hand holds the device, so the force has no effect.
        if wrench.is_finite() {
            Ok(())
        } else {
            Err(DeviceFault::NonFiniteWrench)
        }
    }
}
