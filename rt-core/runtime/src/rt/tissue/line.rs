//! The tissue tick on a prepared line: the body is the sum of the line's loads times its columns, or is carried by that
//! of a coarser body while the tip holds the element that it presses on.

use super::TissueLoop;
use crate::rt::exchange::Happened;
use crate::rt::line_loads::{BentTip, LineLoads};
use nalgebra::Vector3;
use stylet_sim::line::{BodyAnswer, BodyLine, Line};
use stylet_sim::tissue::{Carry, Held, MaterialPoint, Shift, StepReport};

impl TissueLoop {
    /// Takes the columns of a new line; the old ones are returned to be freed.
    pub(super) fn take_line(&mut self, line: Box<BodyLine>) {
        if self.state.in_by_line {
            // The force loop keeps the line that it is on; the control thread sends another when it sees that this one
            // is unused.
            self.free(line);
            return;
        }
        self.drop_line();
        self.state.response.line = line.generation;
        self.line = Some(line);
        // Its number may have belonged to another line.
        self.last_carry.forget();
    }

    /// Makes the next tick sum everything that carries the body.
    #[cfg(test)]
    pub fn forget_carry(&mut self) {
        self.last_carry.forget();
    }

    /// Drops the line: its body is replaced.
    pub(super) fn drop_line(&mut self) {
        self.state.response.line = 0;
        if let Some(old) = self.line.take() {
            self.free(old);
        }
    }

    /// Returns columns to the control thread, since a tick must not free. The control thread empties the ring before it
    /// sends another line.
    pub(super) fn free(&mut self, line: Box<BodyLine>) {
        if let Err(rtrb::PushError::Full(line)) = self.ports.old_lines.push(line) {
            std::mem::forget(line);
        }
    }

    /// Steps a tick on the line; `None` if the needle is on none that this loop has.
    pub(super) fn step_on_line(&mut self) -> Option<StepReport> {
        let loads = self.state.loads;
        // Taken out meanwhile, so that it can move the body.
        let line = self.line.take_if(|line| line.generation == loads.generation)?;
        let axis = line.line;
        let mut whole_m = axis.axes[0].map(|c| c * loads.whole_m);
        if let Some(bent) = loads.bent {
            add_bevel(&mut whole_m, &axis, &bent, line.part.m_per_n);
        }
        let shift = Shift {
            by_m: whole_m,
            elements: &line.part.elements,
        };
        let report = match &line.answer {
            BodyAnswer::Columns(columns) => {
                let alone = self.world.tissue.displace(columns, loads.loads_n(), shift);
                match self.besides() {
                    None => alone,
                    Some(_) => self.with_left(|this, fields| this.world.tissue.add(fields)),
                }
            }
            BodyAnswer::Carrying(columns) => {
                let held = self.held_on_line(&axis, &loads);
                // A tip that has come out on the far side is in no element: the remaining load at the line's end moves
                // nothing.
                let stations = loads.loads_n().len().saturating_sub(2 * loads.across) / 2;
                let loads_n = match held {
                    Some(_) => loads.loads_n(),
                    None => loads.loads_n().get(..stations).unwrap_or(&[]),
                };
                let by = Carry {
                    columns,
                    loads_n,
                    shift,
                    fields: &[],
                };
                // A resting hand loads the line in every tick as in the one before.
                if !self.last_carry.is_again(line.generation, loads_n, whole_m) {
                    match self.besides() {
                        None => self.world.tissue.carry(by),
                        Some(_) => self.with_left(|this, fields| this.world.tissue.carry(Carry { fields, ..by })),
                    }
                }
                Some(self.world.tissue.step(held, self.period_s))
            }
        };
        self.line = Some(line);
        let report = report?;
        let entry = Vector3::from(axis.entry_m);
        let direction = Vector3::from(axis.axes[0]);
        if self.state.contact.is_some() {
            self.end_contact();
        }
        self.meet_on_line(&loads, entry, direction);
        Some(report)
    }

    /// Returns the material at the tip, if it is on the line.
    fn held_on_line(&self, axis: &Line, loads: &LineLoads) -> Option<Held> {
        let along_m = loads.tip_material_m;
        if !loads.in_tissue || !along_m.is_finite() {
            return None;
        }
        let body = &self.world.scene.body;
        let (across_m, moved_m) = loads
            .bent
            .map_or(([0.0; 2], [0.0; 2]), |bent| (bent.material_m(), bent.displacement_m));
        let element = MaterialPoint::at_rest(body, axis.point_m(along_m.max(0.0), across_m))?.element;
        let rest_m = body.rest_m(element);
        let mut position_m = [0, 1, 2].map(|a| rest_m[a] + loads.tip_displacement_m * axis.axes[0][a]);
        for (side, moved_m) in moved_m.into_iter().enumerate().filter(|(_, m)| *m != 0.0) {
            for (place, direction) in position_m.iter_mut().zip(axis.axes[1 + side]) {
                *place += moved_m * direction;
            }
        }
        Some(Held {
            element,
            position_m,
            patch_m: self.world.spec.tip_patch_m,
        })
    }

    /// Takes the needle off its line: a reported contact ends.
    pub(super) fn leave_line(&mut self) {
        if std::mem::take(&mut self.state.in_by_line) {
            // Needles that stay in keep carrying the body, and so does the probe.
            if self.besides().is_none() {
                self.world.tissue.carry(Carry::NOT);
            }
            self.last_carry.forget();
            self.happened(Happened::LeftTissue);
        }
    }

    fn meet_on_line(&mut self, loads: &LineLoads, entry: Vector3<f64>, direction: Vector3<f64>) {
        if loads.in_tissue && !self.state.in_by_line {
            self.state.in_by_line = true;
            self.state.response.contact_in_scene = entry;
            self.state.response.path_direction = direction;
            self.happened(Happened::Contact(entry));
        } else if !loads.in_tissue {
            self.leave_line();
        }
    }

    /// Returns the line that the needle is in tissue on.
    pub(super) fn line_in_tissue(&self) -> Option<Line> {
        let loads = &self.state.loads;
        let line = self.line.as_ref().filter(|line| line.generation == loads.generation)?;
        loads.in_tissue.then_some(line.line)
    }

    /// Returns the material in the track of the needle on its line, so far from the entry.
    pub(super) fn material_on_line(&self, line: &Line, along_m: f64) -> Option<MaterialPoint> {
        let loads = &self.state.loads;
        let tip_m = loads.tip_material_m;
        let across_m = |behind_m: f64| {
            let (here, there) = (loads.deflection_m(0.0), loads.deflection_m(behind_m));
            loads.bent.map_or([0.0; 2], |bent| {
                let tip_m = bent.material_m();
                [0, 1].map(|side| tip_m[side] + there[side] - here[side])
            })
        };
        let place_m = line.point_m(along_m, across_m(tip_m - along_m));
        (along_m > 0.0)
            .then(|| MaterialPoint::at_rest(&self.world.scene.body, place_m))
            .flatten()
    }
}

/// Adds the reaction of the bevel to the displacement of the whole body.
fn add_bevel(whole_m: &mut [f64; 3], axis: &Line, bent: &BentTip, whole_m_per_n: f64) {
    for (side, tip_n) in bent.needle.tip_n.into_iter().enumerate() {
        for (sum, direction) in whole_m.iter_mut().zip(axis.axes[1 + side]) {
            *sum -= whole_m_per_n * tip_n * direction;
        }
    }
}
