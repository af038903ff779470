//! A device that plays back recorded samples; what is written to it moves nothing.

use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};

/// Plays its samples once, in their own time, then repeats the last one as a device does that has gone silent.
#[derive(Debug, Clone)]
pub struct ReplayDevice {
    info: DeviceInfo,
    samples: Vec<Sample>,
    period_s: f64,
    /// How far into the recording, in periods.
    at: f64,
    begun: bool,
}

impl ReplayDevice {
    /// `samples` were taken `period_s` apart; their sequence numbers are made anew. `None` if there is no sample, one
    /// is not finite, or the period is not above zero.
    ///
    /// ```
    /// use stylet_hw::{Device, DeviceInfo, ReplayDevice, SimulatedPhantom, SimulatedPhantomConfig};
    /// let mut hand = SimulatedPhantom::new(SimulatedPhantomConfig::default());
    /// let taken: Vec<_> = (0..3).map(|_| hand.read(1e-3).unwrap()).collect();
    /// let mut played = ReplayDevice::new(DeviceInfo::phantom_premium_1_5(), taken.clone(), 1e-3).unwrap();
    /// assert_eq!(played.read(1e-3).unwrap().tip_in_world, taken[0].tip_in_world);
    /// ```
    pub fn new(info: DeviceInfo, mut samples: Vec<Sample>, period_s: f64) -> Option<Self> {
        let usable =
            !samples.is_empty() && samples.iter().all(Sample::is_finite) && period_s.is_finite() && period_s > 0.0;
        for (sample, sequence) in samples.iter_mut().zip(1..) {
            sample.sequence = sequence;
        }
        usable.then_some(Self {
            info: DeviceInfo {
                name: "recorded hand",
                simulated: true,
                ..info
            },
            samples,
            period_s,
            at: 0.0,
            begun: false,
        })
    }

    fn index(&self) -> usize {
        (self.at.round() as usize).min(self.samples.len() - 1)
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
        if self.begun {
            // Not past the end, where a long session would wear the fraction out.
            self.at = (self.at + dt_s / self.period_s).min((self.samples.len() - 1) as f64);
        }
        self.begun = true;
        Ok(self.samples[self.index()])
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        // No motors: nobody feels it.
        if wrench.is_finite() {
            Ok(())
        } else {
            Err(DeviceFault::NonFiniteWrench)
        }
    }
}
