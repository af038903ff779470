//! The second hand, in a run with a second device.

use super::Shown;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use stylet_imaging::ultrasound::Pose;
use stylet_shm_schema::{Fault, flags};

/// Delay behind the needle's state at which the second loop counts as stopped; it writes its state
/// each tick.
const STANDS_STILL_NS: u64 = 250_000_000;

/// State of the second device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SecondHand {
    /// Unknown, because no data has arrived yet.
    Unknown,
    /// Force off because of a fault; `None` for one that this program does not know.
    Faulty(Option<Fault>),
    /// Force off.
    Off,
    /// Force on.
    On,
}

/// Stepper that drives the simulated hand with the probe.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stepper {
    /// Last setting, until a hand moves the probe.
    pub goal: Option<Pose>,
    /// True if its brake is on, so that no hand moves the probe.
    pub is_locked: bool,
}

impl Shown {
    /// Returns the state of the second hand; `None` in a run without a second device.
    pub fn second_hand(&self) -> Option<SecondHand> {
        self.session.filter(|session| session.has_second())?;
        let Some(second) = &self.second else {
            return Some(SecondHand::Unknown);
        };
        // A recording has every tick of this hand, but only some states of the needle's.
        let is_late = self.watched.is_none()
            && self
                .state
                .is_some_and(|state| state.time_ns.saturating_sub(second.time_ns) > STANDS_STILL_NS);
        Some(match Fault::from_number(second.fault) {
            _ if is_late => SecondHand::Faulty(Some(Fault::LoopStopped)),
            Some(Fault::None) if second.flags & flags::ENGAGED != 0 => SecondHand::On,
            Some(Fault::None) => SecondHand::Off,
            fault => SecondHand::Faulty(fault),
        })
    }

    /// Returns the tip of the tool in the second hand, m.
    pub fn second_tip_m(&self) -> Option<[f64; 3]> {
        self.second
            .filter(|second| second.tick > 0)
            .map(|second| second.tip_in_scene_m)
    }

    /// Returns the rotation from the frame of the second hand's tool, which lies along its +z.
    fn scene_from_second(&self) -> Option<UnitQuaternion<f64>> {
        let [i, j, k, w] = self.second.filter(|second| second.tick > 0)?.world_from_tool;
        UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-6)
    }

    /// Returns the unit vector along the second hand's tool, towards its tip.
    pub fn second_axis(&self) -> Option<[f64; 3]> {
        Some((self.scene_from_second()? * Vector3::z()).into())
    }

    /// Returns the pose of the ultrasound probe in the second hand; `None` without a second device,
    /// and before its first tick.
    pub fn probe_pose(&self) -> Option<Pose> {
        Pose::of_second(self.second.as_ref()?)
    }

    /// Returns whether the core moves the second hand on request: a simulated one, in a live run.
    pub fn is_second_simulated(&self) -> bool {
        let is_simulated = self.second.is_some_and(|s| s.flags & flags::SIMULATED_DEVICE != 0);
        is_simulated && self.is_live() && self.watched.is_none()
    }

    /// Returns the tip of the tool, and its end towards the hand at this length.
    pub fn second_tool_m(&self, length_m: f64) -> Option<[[f64; 3]; 2]> {
        let (tip, axis) = (self.second_tip_m()?, self.second_axis()?);
        Some([tip, [0, 1, 2].map(|a| tip[a] - axis[a] * length_m)])
    }

    /// Returns name, place, force and deadlines, for the tooltip of its badge.
    pub fn second_words(&self) -> Option<String> {
        let (session, second) = (self.session.as_ref()?, self.second.as_ref()?);
        let force_n = second.force_on_hand_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        let [x, y, z] = second.tip_in_scene_m.map(stylet_base::format::mm);
        Some(format!(
            "{}, {}\nat {x:.1}, {y:.1}, {z:.1} mm\nforce {force_n:.2} N of {:.1} N, peak {:.2} N\n{} deadlines missed",
            session.second_device.read(),
            stylet_base::format::rate(session.second_period_ns),
            second.device_limit_n,
            second.peak_force_n,
            second.missed_deadlines
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use stylet_imaging::ultrasound::Probe;
    use stylet_shm_schema::SecondState;

    #[test]
    fn the_probe_has_the_pose_of_its_tool() {
        let mut shown = Shown::empty("lab");
        assert_eq!(shown.probe_pose(), None);
        let mut second = SecondState::zeroed();
        // A third of a turn about (1, 1, 1): z goes to x, y to z.
        second.world_from_tool = [0.5, 0.5, 0.5, 0.5];
        second.tip_in_scene_m = [0.05, 0.02, 0.01];
        shown.second = Some(second);
        assert_eq!(shown.probe_pose(), None, "no tick yet");
        second.tick = 1;
        shown.second = Some(second);
        let pose = shown.probe_pose().expect("a pose");
        assert!((pose.axis - Vector3::x()).norm() < 1e-12 && (pose.up - Vector3::z()).norm() < 1e-12);
        let middle_m = Vector3::new(0.05 - Probe::default().behind_tip_m, 0.02, 0.01);
        assert!((pose.middle_m - middle_m).norm() < 1e-12, "{}", pose.middle_m);
    }
}
