//! Seeds that the needle leaves in the tissue.

use super::TissueLoop;
use crate::rt::exchange::Happened;
use crate::rt::seed::Seed;
use nalgebra::Vector3;
use stylet_shm_schema::{MAX_SEEDS, RefusalCode, SEED_LENGTH_M, SEED_RADIUS_M, TOUCHING_M};
use stylet_sim::line::{Line, push};
use stylet_sim::tissue::MaterialPoint;

/// Largest offset between two seeds of one needle, which also share a direction (cosine of 5 degrees).
const ON_NEEDLE_M: f64 = 2e-3;
const PARALLEL: f64 = 0.996;

/// Returns the first of these seeds, the shallowest first, that one at the tip would not pass: those that it would
/// overlap, and those that lie against them on the way to the entry.
fn not_passed(fronts_m: &[f64], tip_m: f64) -> usize {
    let overlapped = fronts_m.partition_point(|front_m| *front_m < tip_m - SEED_LENGTH_M);
    let mut first = overlapped;
    while let Some(deeper_m) = fronts_m.get(first)
        && let Some(next) = first.checked_sub(1)
        && deeper_m - fronts_m[next] < SEED_LENGTH_M + TOUCHING_M
    {
        first = next;
    }
    first
}

impl TissueLoop {
    pub(super) fn drop_seed(&mut self, strand_pitch_m: Option<f64>) -> Result<(), RefusalCode> {
        let tip_m = self.state.pose.tip_in_scene + self.deflection();
        let hint = self.state.held.map(|h| h.element);
        let has_room = self.seeds.len() < MAX_SEEDS;
        let strand_pitch_m = strand_pitch_m.filter(|pitch_m| self.is_behind_the_last(*pitch_m));
        let on_line = self.line_in_tissue().map(|line| match strand_pitch_m {
            None if has_room && self.world.seeds_take_room => (line, self.join_column(&line)),
            // Spacers keep it from the others, or it is a point.
            _ => (line, self.state.loads.tip_material_m),
        });
        let found = match on_line {
            Some((line, front_m)) => self.material_on_line(&line, front_m),
            None => self.locate(&tip_m, hint),
        };
        let tip = found.ok_or(RefusalCode::TipOutsideTissue)?;
        if !has_room {
            return Err(RefusalCode::NoSeedLeft);
        }
        let direction = self.state.pose.direction;
        let tail = match on_line {
            Some((line, front_m)) => self.material_on_line(&line, front_m - SEED_LENGTH_M),
            None => self.locate(&(tip_m - direction * SEED_LENGTH_M), Some(tip.element)),
        };
        self.removed.clear();
        // Room for MAX_SEEDS was reserved: this push does not allocate.
        self.seeds.push(Seed {
            tip,
            tail,
            axis: direction.into(),
            dropped_at_m: (tip_m - direction * (0.5 * SEED_LENGTH_M)).into(),
            strand_pitch_m,
            track_to_entry: on_line.map(|(line, _)| line.axes[0].map(|c| -c)),
        });
        self.state.response.seed_count = self.seeds.len() as u32;
        self.happened(Happened::Seed {
            index: self.state.response.seed_count - 1,
            position_m: tip_m,
        });
        Ok(())
    }

    /// Places a seed behind those that lie in the track at the tip, which the stylet may push on; returns its front,
    /// from the entry along the line.
    fn join_column(&mut self, line: &Line) -> f64 {
        let body = &self.world.scene.body;
        let (tip_m, [axis, first, second]) = (self.state.loads.tip_material_m, line.axes.map(Vector3::from));
        // Fronts of the seeds in this track, and their numbers, the shallowest first.
        let (mut fronts_m, mut numbers, mut count) = ([0.0; MAX_SEEDS], [0; MAX_SEEDS], 0);
        for (number, seed) in self.seeds.iter().enumerate() {
            let from_entry_m = Vector3::from(seed.tip.rest_m(body)) - Vector3::from(line.entry_m);
            let front_m = from_entry_m.dot(&axis);
            let beside_m = from_entry_m.dot(&first).hypot(from_entry_m.dot(&second));
            let is_along = seed
                .track_to_entry
                .is_some_and(|to_entry| -axis.dot(&Vector3::from(to_entry)) > PARALLEL);
            if !is_along || beside_m > 2.0 * SEED_RADIUS_M {
                continue;
            }
            let at = fronts_m[..count].iter().position(|f| *f > front_m).unwrap_or(count);
            fronts_m.copy_within(at..count, at + 1);
            numbers.copy_within(at..count, at + 1);
            (fronts_m[at], numbers[at]) = (front_m, number);
            count += 1;
        }
        let first = not_passed(&fronts_m[..count], tip_m);
        let before_m = fronts_m;
        let front_m = push(&mut fronts_m[first..count], tip_m, &self.state.loads.hold);
        for n in (first..count).filter(|&n| fronts_m[n] != before_m[n]) {
            self.shift_seed(numbers[n], (axis * (fronts_m[n] - before_m[n])).into());
        }
        front_m
    }

    /// Moves a seed in the tissue at rest; leaves it where the body ends.
    pub(super) fn shift_seed(&mut self, number: usize, by_m: [f64; 3]) {
        let body = &self.world.scene.body;
        let Some(seed) = self.seeds.get_mut(number) else {
            return;
        };
        let moved = |point: &MaterialPoint| {
            let place_m = point.rest_m(body);
            MaterialPoint::at_rest(body, [0, 1, 2].map(|a| place_m[a] + by_m[a]))
        };
        if let Some(tip) = moved(&seed.tip) {
            (seed.tip, seed.tail) = (tip, seed.tail.as_ref().and_then(moved));
        }
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
            let middle_m = self.state.pose.tip_in_scene + self.deflection() - direction * (0.5 * SEED_LENGTH_M);
            let back_m = Vector3::from(last.dropped_at_m) - middle_m;
            let along_m = back_m.dot(&direction);
            let is_on_needle = (back_m - direction * along_m).norm() < ON_NEEDLE_M;
            let is_parallel = Vector3::from(last.axis).dot(&direction) > PARALLEL;
            is_on_needle && is_parallel && (along_m - pitch_m).abs() < 0.5 * pitch_m
        })
    }

    /// Returns the deeper end of each seed.
    #[cfg(test)]
    pub fn deeper_ends_m(&self) -> Vec<[f64; 3]> {
        let body = self.world.tissue.deformed();
        self.seeds.iter().map(|seed| seed.tip.position_m(&body)).collect()
    }

    /// Removes the last seed; after a reset, restores those that it removed.
    pub(super) fn undo_seed(&mut self) -> Result<(), RefusalCode> {
        if self.seeds.pop().is_none() {
            std::mem::swap(&mut self.seeds, &mut self.removed);
            self.seeds.last().ok_or(RefusalCode::NoSeedToUndo)?;
        }
        self.state.response.seed_count = self.seeds.len() as u32;
        Ok(())
    }

    /// Removes all seeds; [`Self::undo_seed`] restores them until another is dropped.
    pub(super) fn remove_seeds(&mut self) {
        if !self.seeds.is_empty() {
            std::mem::swap(&mut self.seeds, &mut self.removed);
        }
        self.seeds.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const L: f64 = SEED_LENGTH_M;

    /// A second seed that rested against the first, just behind a tip that had not moved on, was passed by the third: in
    /// `pelvis` two seeds came to rest at one place.
    #[test]
    fn a_seed_passes_none_that_lies_against_those_at_the_tip() {
        let fronts_m = [0.01, 0.05 - 2.0 * L, 0.05 - L, 0.05];
        assert_eq!(not_passed(&fronts_m, 0.05), 1);
        assert_eq!(not_passed(&fronts_m, 0.05 + 1e-4), 1);
        assert_eq!(not_passed(&fronts_m, 0.06), 4);
        assert_eq!(not_passed(&fronts_m, 0.01), 0);
        assert_eq!(not_passed(&[], 0.05), 0);
    }
}
