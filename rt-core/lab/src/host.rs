//! The host of a measurement, at normal priority: it moves the hand, and records when it sees the tissue respond.
//!
//! The observer is a separate process, like every host: the force process maps no memory that a host could write.

use crate::sample::{Batched, PARTS};
use std::process::Child;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stylet_runtime::control;
use stylet_runtime::device::second_start;
use stylet_runtime::rt::clock;
use stylet_runtime::rt::timing::PoseTimes;
use stylet_shm_schema::{Event, EventKind, Fault, HandMove, Instance, ProbeMove, Request, VALID_RANGE_S};
use stylet_sim::probe::{PADS_APART_M, ProbeShape, Wall};
use stylet_sim::scene::Scene;
use stylet_wall::packet::{Kind, SeenRecords, SeenSnapshot, Socket};

/// One insertion and one retraction.
const CYCLE_NS: u64 = 4_000_000_000;
/// Mean tip speed of needle insertions (Podder 2006 and the U. Alberta data): 48 mm/s.
const SPEED_M_PER_S: f64 = 0.048;
/// The probe's path is longer.
const SECOND_SPEED_M_PER_S: f64 = 0.1;
const ACCELERATION_M_PER_S2: f64 = 1.0;
/// Seeds that the script drops in the gland; they move with it and add to the cost of a tissue tick.
const SEEDS: u64 = 32;
/// Polling interval of the host; part of its measured delay.
pub const LOOK: Duration = stylet_wall::packet::LOOK_EVERY;
/// Interval of the script's promises.
const RENEW_NS: u64 = 50_000_000;
/// Passes within which the core must be seen, 15 s on an idle PC. Passes, not time: if real-time threads use up the
/// only core, run and host are both still starting.
const PATIENCE_PASSES: u32 = 14_000;

/// Observations of the host.
pub struct HostReport {
    /// Tip read by the haptic loop to snapshot seen here.
    pub tip_to_host: Batched,
    /// Tissue tick woken to snapshot seen here.
    pub tissue_to_host: Batched,
    pub snapshots: u64,
    pub records: u64,
    /// Ticks without a record among those seen.
    pub records_missing: u64,
    /// Faults as text, with device and tick.
    pub faults: Vec<String>,
    pub insertions: u64,
}

/// Path on which the script takes the tip.
#[derive(Clone, Copy, Debug)]
pub struct Script {
    outside_m: [f64; 3],
    inside_m: [f64; 3],
    /// Tip of the other hand, likewise.
    second_outside_m: [f64; 3],
    second_inside_m: [f64; 3],
}

impl Script {
    /// Makes a path along the axis of the target, from 15 mm before the body to four fifths of the target. The other
    /// hand brings the probe into the rectum and presses it against the target; in a scene without one it moves behind
    /// the needle.
    pub fn of(scene: &Scene) -> Self {
        let (lowest, _) = scene.lattice.bounds_m();
        let (lower, upper) = scene.target_bounds_m();
        let at = |z: f64| [(lower[0] + upper[0]) / 2.0, (lower[1] + upper[1]) / 2.0, z];
        let (outside_m, inside_m) = (at(lowest[2] - 0.015), at(lower[2] + 0.8 * (upper[2] - lower[2])));
        let behind = |[x, y, z]: [f64; 3]| [x, y - BEHIND_M, z];
        let pressed = |wall: Wall| {
            let pose = wall.pose_below_target(scene, &ProbeShape::default(), PRESSED_M, BEYOND_TARGET_M);
            (second_start(scene).into(), pose.tip_m)
        };
        let second = Wall::of(scene, PADS_APART_M).map(pressed);
        let (second_outside_m, second_inside_m) = second.unwrap_or((behind(outside_m), behind(inside_m)));
        Self {
            outside_m,
            inside_m,
            second_outside_m,
            second_inside_m,
        }
    }
}

/// The observing process, and the connection to it; ended when dropped.
struct Eyes {
    process: Child,
    socket: Socket,
}

impl Eyes {
    fn open(instance: &Instance) -> Result<Self, HostError> {
        let (socket, process) = control::watcher("host", instance).map_err(HostError::NotStarted)?;
        Ok(Self { process, socket })
    }
}

impl Drop for Eyes {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// One host; its thread ends the run after `duration_ns` of measurement.
pub struct Host {
    eyes: Eyes,
    script: Script,
    pose_times: Arc<PoseTimes>,
    sent: u64,
    last_tick: u64,
    warm_up_ticks: u64,
    /// Part of the run.
    part: usize,
    step: u64,
    renewed_ns: u64,
    /// The other hand moves as well.
    moves_second: bool,
    report: HostReport,
}

/// Distance behind the needle at which the other hand moves if there is no rectum, m.
const BEHIND_M: f64 = 0.04;
/// Depth to which the probe is pressed from contact with the wall, and distance of its tip beyond the target's centre,
/// m.
const PRESSED_M: f64 = 5e-3;
const BEYOND_TARGET_M: f64 = 35e-3;

/// Reason why the host of the measurement saw nothing.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The observing process was not started.
    #[error("stylet-bridge, which looks as a host does, cannot be started: {0}")]
    NotStarted(std::io::Error),
    /// The host ended unexpectedly.
    #[error("stylet-bridge, which looks as a host does, ended")]
    Ended,
    /// No tick within this many seconds.
    #[error("the loops published nothing for {0} s")]
    Silent(u64),
}

impl Host {
    pub fn new(
        instance: &Instance,
        script: Script,
        pose_times: Arc<PoseTimes>,
        warm_up_ticks: u64,
        moves_second: bool,
    ) -> Result<Self, HostError> {
        Ok(Self {
            warm_up_ticks,
            eyes: Eyes::open(instance)?,
            script,
            pose_times,
            sent: 0,
            last_tick: 0,
            part: 0,
            step: 0,
            renewed_ns: 0,
            moves_second,
            report: HostReport {
                tip_to_host: Batched::default(),
                tissue_to_host: Batched::default(),
                snapshots: 0,
                records: 0,
                records_missing: 0,
                faults: Vec::new(),
                insertions: 0,
            },
        })
    }

    /// Watches until `duration_ns` after the warm-up, or until `interrupted` or `stop`.
    pub fn run(
        mut self,
        duration_ns: u64,
        interrupted: impl Fn() -> bool,
        stop: &AtomicBool,
    ) -> Result<HostReport, HostError> {
        let began_ns = clock::now_ns();
        let mut passes = 0;
        let mut first_ns = 0;
        // SYNC: set by the run when it fails; nothing but the flag is carried.
        while !stop.load(Ordering::Acquire) && !interrupted() {
            let now_ns = clock::now_ns();
            self.look()?;
            if first_ns == 0 && self.last_tick >= self.warm_up_ticks {
                first_ns = now_ns;
            }
            passes += 1;
            if first_ns == 0 && passes > PATIENCE_PASSES {
                return Err(HostError::Silent((now_ns - began_ns) / 1_000_000_000));
            }
            if first_ns > 0 {
                self.part = ((now_ns - first_ns) * PARTS as u64 / duration_ns) as usize;
                self.follow_script(now_ns - first_ns);
                self.keep_moving(now_ns);
                if now_ns - first_ns >= duration_ns {
                    break;
                }
            }
            std::thread::sleep(LOOK);
        }
        Ok(self.report)
    }

    fn look(&mut self) -> Result<(), HostError> {
        while let Some(packet) = self.eyes.socket.receive().map_err(|_| HostError::Ended)? {
            match packet.kind {
                Kind::SeenSnapshots => packet.values().iter().for_each(|seen| self.take_snapshot(seen)),
                Kind::SeenRecords => packet.values().iter().for_each(|seen| self.take_records(seen)),
                Kind::Event => packet.value().iter().for_each(|event| self.take_event(event)),
                _ => {}
            }
        }
        Ok(())
    }

    fn take_snapshot(&mut self, seen: &SeenSnapshot) {
        self.report.snapshots += 1;
        let since = |time_ns: u64| seen.seen_ns.saturating_sub(time_ns);
        self.report.tissue_to_host.take(self.part, since(seen.time_ns));
        if let Some(pose_ns) = self.pose_times.of(seen.tissue_tick).filter(|&t| t > 0) {
            self.report.tip_to_host.take(self.part, since(pose_ns));
        }
    }

    fn take_records(&mut self, seen: &SeenRecords) {
        if self.last_tick > 0 {
            self.report.records_missing += seen.first.saturating_sub(self.last_tick + 1);
        }
        self.report.records_missing += (seen.last + 1 - seen.first).saturating_sub(seen.count);
        self.last_tick = seen.last;
        self.report.records += seen.count;
    }

    fn take_event(&mut self, event: &Event) {
        let whose = match event.kind {
            kind if kind == EventKind::FaultRaised as u32 => "needle",
            kind if kind == EventKind::SecondFaultRaised as u32 => "second device",
            _ => return,
        };
        let fault = Fault::from_number(event.code).map_or("unknown", Fault::message);
        self.report
            .faults
            .push(format!("{whose}, tick {}: {fault}", event.tick));
    }

    /// Follows the script, half a cycle in, half a cycle out; each engaging re-arms after a fault.
    fn follow_script(&mut self, time_ns: u64) {
        let due = time_ns / (CYCLE_NS / 2) + 1;
        if self.step >= due {
            return;
        }
        self.step += 1;
        if self.step % 2 == 1 {
            self.send(&Request::Engage);
            self.move_hands(self.script.inside_m, self.script.second_inside_m);
            self.report.insertions += 1;
        } else {
            if self.step / 2 <= SEEDS {
                self.send(&Request::DropSeed { strand_pitch_m: None });
            }
            self.move_hands(self.script.outside_m, self.script.second_outside_m);
        }
    }

    /// Renews the promise for the longest time allowed: a stopped hand would change the measurement.
    fn keep_moving(&mut self, now_ns: u64) {
        if now_ns - self.renewed_ns >= RENEW_NS {
            self.renewed_ns = now_ns;
            let [_, valid_s] = VALID_RANGE_S;
            self.send(&Request::KeepMoving { valid_s });
        }
    }

    fn move_hands(&mut self, tip_m: [f64; 3], second_tip_m: [f64; 3]) {
        let to = |tip_m, speed_m_per_s| HandMove {
            tip_m,
            direction: [0.0, 0.0, 1.0],
            speed_m_per_s,
            acceleration_m_per_s2: ACCELERATION_M_PER_S2,
        };
        self.renewed_ns = 0;
        self.send(&Request::MoveHand(to(tip_m, SPEED_M_PER_S)));
        if self.moves_second {
            let hand = to(second_tip_m, SECOND_SPEED_M_PER_S);
            self.send(&Request::MoveSecondHand(ProbeMove { hand, up: None }));
        }
    }

    fn send(&mut self, request: &Request) {
        self.sent += 1;
        if let Ok(command) = request.encode(1, self.sent) {
            // The next cycle sends the commands again.
            let _ = self.eyes.socket.send(Kind::Command, bytemuck::bytes_of(&command), None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Behind it, where the probe once was, its contact has no solution and the force goes off.
    #[test]
    fn the_probe_of_the_script_lies_in_the_rectum() {
        let scene = Scene::builtin("pelvis").expect("fits");
        let (low, high) = scene.target_bounds_m();
        let script = Script::of(&scene);
        let is_hollow = |[x, y, _]: [f64; 3]| {
            let mut along = (0..=20).map(|n| low[2] + (high[2] - low[2]) * f64::from(n) / 20.0);
            along.all(|z| scene.lattice.element_at_rest([x, y, z]).is_none())
        };
        assert!(is_hollow(script.second_inside_m), "{:?}", script.second_inside_m);
        let [x, y, z] = script.inside_m;
        assert!(!is_hollow([x, y - BEHIND_M, z]));
    }
}
