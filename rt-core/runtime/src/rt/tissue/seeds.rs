//! Seeds that the needle leaves in the tissue.

use super::TissueLoop;
use crate::rt::exchange::Happened;
use crate::rt::seed::Seed;
use nalgebra::Vector3;
use stylet_shm_schema::{MAX_SEEDS, RefusalCode};

/// Length of a seed; its tail shows where its axis points.
const SEED_LENGTH_M: f64 = 4.5e-3;
/// Largest offset between two seeds of one needle, which also share a direction (cosine of 5 degrees).
const ON_NEEDLE_M: f64 = 2e-3;
const PARALLEL: f64 = 0.996;

impl TissueLoop {
    pub(super) fn drop_seed(&mut self, strand_pitch_m: Option<f64>) -> Result<(), RefusalCode> {
        let tip_m = self.state.pose.tip_in_scene + self.deflection();
        let hint = self.state.held.map(|h| h.element);
        let on_line = self.material_on_line(SEED_LENGTH_M);
        let found = on_line.map_or_else(|| self.locate(&tip_m, hint), |[tip, _]| tip);
        let tip = found.ok_or(RefusalCode::TipOutsideTissue)?;
        if self.seeds.len() >= MAX_SEEDS {
            return Err(RefusalCode::NoSeedLeft);
        }
        let direction = self.state.pose.direction;
        let tail_m = tip_m - direction * SEED_LENGTH_M;
        let tail = on_line.map_or_else(|| self.locate(&tail_m, Some(tip.element)), |[_, tail]| tail);
        let on = self.line.as_ref().filter(|_| on_line.is_some());
        let track_to_entry = on.map(|line| line.line.axes[0].map(|c| -c));
        let strand_pitch_m = strand_pitch_m.filter(|pitch_m| self.is_behind_the_last(*pitch_m));
        // Room for MAX_SEEDS was reserved: this push does not allocate.
        self.seeds.push(Seed {
            tip,
            tail,
            axis: direction.into(),
            dropped_at_m: tip_m.into(),
            strand_pitch_m,
            track_to_entry,
        });
        self.state.response.seed_count = self.seeds.len() as u32;
        self.happened(Happened::Seed {
            index: self.state.response.seed_count - 1,
            position_m: tip_m,
        });
        Ok(())
    }

    /// Displacement of the needle's tip from a rigid one's.
    fn deflection(&self) -> Vector3<f64> {
        let Some(line) = self.line.as_ref().filter(|_| self.state.loads.bent.is_some()) else {
            return Vector3::zeros();
        };
        let [_, first, second] = line.line.axes.map(Vector3::from);
        let off_m = self.state.loads.deflection_m(0.0);
        first * off_m[0] + second * off_m[1]
    }

    /// True if the tip is where the next seed of the last strand leaves the needle, within half a pitch.
    fn is_behind_the_last(&self, pitch_m: f64) -> bool {
        let direction = self.state.pose.direction;
        self.seeds.last().is_some_and(|last| {
            let back_m = Vector3::from(last.dropped_at_m) - self.state.pose.tip_in_scene - self.deflection();
            let along_m = back_m.dot(&direction);
            let is_on_needle = (back_m - direction * along_m).norm() < ON_NEEDLE_M;
            let is_parallel = Vector3::from(last.axis).dot(&direction) > PARALLEL;
            is_on_needle && is_parallel && (along_m - pitch_m).abs() < 0.5 * pitch_m
        })
    }

    pub(super) fn undo_seed(&mut self) -> Result<(), RefusalCode> {
        self.seeds.pop().ok_or(RefusalCode::NoSeedToUndo)?;
        self.state.response.seed_count = self.seeds.len() as u32;
        Ok(())
    }
}
