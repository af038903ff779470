//! Cost of the ultrasound probe in a tissue tick, in a scene with a rectum for it.

use super::{CostError, TICK_S, TICKS};
use std::time::Instant;
use stylet_sim::probe::{BodyProbe, PADS_APART_M, ProbePose, ProbeQueue, ProbeShape, Wall};
use stylet_sim::scene::{Scene, TissueKind};
use stylet_sim::tissue::FemTissue;
use stylet_sim::tissue::fem::batch::BatchModel;

const PRESSED_M: f64 = 10e-3;
const BEYOND_TARGET_M: f64 = 35e-3;
/// Number of ticks between jumps of the hand.
const JUMP_EVERY: usize = 40;
const JUMP_M: f64 = 5e-3;

/// A probe and its path: pressed 10 mm into the wall and back, with jumps of 5 mm.
pub struct Pressed {
    at_rest: BodyProbe,
    poses: Vec<ProbePose>,
}

impl Pressed {
    /// Makes the part; `None` in a scene without room for a probe.
    pub fn of(scene: &Scene) -> Result<Option<Self>, CostError> {
        let Some(scene) = scene.clone().for_lines(TissueKind::ChainMail) else {
            return Ok(None);
        };
        let Ok(wall) = Wall::of(&scene, PADS_APART_M) else {
            return Ok(None);
        };
        let fem = FemTissue::<f32>::new(&scene)?;
        let body = BatchModel::new(&fem.model);
        let pressed_m = |tick: usize| {
            let jump_m = if tick % JUMP_EVERY == JUMP_EVERY / 2 {
                JUMP_M
            } else {
                0.0
            };
            2.0 * PRESSED_M * tick.min(TICKS - tick) as f64 / TICKS as f64 - jump_m
        };
        let shape = ProbeShape::default();
        let at = |tick| wall.pose_below_target(&scene, &shape, pressed_m(tick), BEYOND_TARGET_M);
        let poses = (0..TICKS).map(at).collect();
        let ready =
            ProbeQueue::new(&body, &scene.body, wall, shape).and_then(|queue| queue.prepare(&body, &mut |_| true));
        Ok(ready.ok().map(|ready| Pressed {
            at_rest: BodyProbe::new(ready),
            poses,
        }))
    }

    /// Returns its name in the table.
    pub fn name(&self) -> String {
        let pads = self.at_rest.ready().wall.pads.len();
        format!("ultrasound probe, pressed by 10 mm and back ({pads} pads)")
    }

    /// Seconds of a tissue tick.
    pub const PERIOD_S: f64 = TICK_S;

    /// Microseconds of each tick.
    pub fn play(&self, micros: &mut Vec<f64>) {
        let mut probe = self.at_rest.clone();
        if let Some(first) = self.poses.first() {
            // It lies there when the ticks begin.
            probe.follow(first);
        }
        for pose in &self.poses {
            let start = Instant::now();
            std::hint::black_box(probe.follow(pose));
            micros.push(start.elapsed().as_secs_f64() * 1e6);
        }
    }
}
