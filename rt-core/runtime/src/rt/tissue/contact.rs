//! Contact of the needle with tissue: layers, and the element that the tip holds.

use super::TissueLoop;
use crate::rt::contact::Contact;
use crate::rt::exchange::Happened;
use crate::rt::pose::TipPose;
use nalgebra::Vector3;
use stylet_sim::needle::LayerKind;
use stylet_sim::tissue::{Held, MaterialPoint, element_ahead};

/// Smallest inward speed at which the needle meets a membrane.
const CONTACT_SPEED_M_PER_S: f64 = 1e-3;

impl TissueLoop {
    pub(super) fn locate(&self, place: &Vector3<f64>, hint: Option<u32>) -> Option<MaterialPoint> {
        MaterialPoint::locate(&self.world.tissue.deformed(), (*place).into(), hint)
    }

    pub(super) fn end_contact_if_released(&mut self) {
        if let Some(contact) = self.state.contact
            && self.state.pose.released_contact >= contact.number
        {
            self.end_contact();
            self.happened(Happened::LeftTissue);
        }
    }

    /// Begins contact if the tip's path since the last tick enters the deformed body.
    pub(super) fn begin_contact_if_met(&mut self, before: &TipPose) {
        if self.state.contact.is_some() || self.state.pose.time_ns == 0 {
            return;
        }
        if self.state.pose.hand_is_empty || self.has_no_answer_off_line() {
            self.state.clear = false;
            return;
        }
        let inside = self.locate(&self.state.pose.tip_in_scene, None);
        let Some(point) = inside else {
            self.state.clear = true;
            return;
        };
        if !self.state.clear || self.state.pose.speed_along_m_per_s < CONTACT_SPEED_M_PER_S {
            return;
        }
        let place = self.entry_between(before.tip_in_scene, self.state.pose.tip_in_scene, point.element, |_| {
            true
        });
        self.state.contacts += 1;
        self.state.contact = Some(Contact {
            number: self.state.contacts,
            place,
            direction: self.state.pose.direction,
        });
        let layer = self.world.layer(&point);
        let number = self.state.layers.begin(layer);
        self.take_hold_at(layer, number, place, point.element);
        self.happened(Happened::Contact(place));
    }

    /// Handles the tip's step into another layer: a new membrane and a new held element.
    pub(super) fn meet_next_layer(&mut self, before: &TipPose) {
        let (Some(_), Some(held)) = (self.state.contact, self.state.held) else {
            return;
        };
        let Some(point) = self.locate(&self.state.pose.tip_in_scene, Some(held.element)) else {
            return;
        };
        let layer = self.world.layer(&point);
        let inwards = self.state.pose.speed_along_m_per_s > CONTACT_SPEED_M_PER_S;
        if let Some(number) = self.state.layers.enter(layer, inwards, &self.state.pose) {
            let (from, to) = (before.tip_in_scene, self.state.pose.tip_in_scene);
            let place = self.entry_between(from, to, point.element, |p| self.world.layer(p) == layer);
            self.take_hold_at(layer, number, place, point.element);
        }
    }

    fn take_hold_at(&mut self, layer: LayerKind, number: u64, place: Vector3<f64>, element: u32) {
        self.state.response.layer = layer;
        self.state.response.layer_number = number;
        self.state.response.layer_in_scene = place;
        self.state.held = Some(Held {
            element,
            position_m: self.world.tissue.deformed().position_m(element),
            patch_m: self.world.spec.tip_patch_m,
        });
    }

    /// Bisects between a point outside and one inside; returns the inner one if even the start is inside.
    fn entry_between(
        &self,
        mut outside: Vector3<f64>,
        mut inside: Vector3<f64>,
        hint: u32,
        is_inside: impl Fn(&MaterialPoint) -> bool,
    ) -> Vector3<f64> {
        for _ in 0..8 {
            let middle = (outside + inside) / 2.0;
            if self.locate(&middle, Some(hint)).is_some_and(|point| is_inside(&point)) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }

    /// Holds the element at the tip, found by walking from the last one, and applies the eq. 6 step.
    pub(super) fn hold(&mut self, travel: Vector3<f64>) {
        let Some(held) = self.state.held else { return };
        let mut next = held;
        // Before puncture the membrane keeps its element; afterwards the tip passes from one to the next.
        if self.state.pose.punctured
            && let Some(at_tip) = self.locate(&self.state.pose.tip_in_scene, Some(held.element))
            && at_tip.element != held.element
        {
            let position_m = self.world.tissue.deformed().position_m(at_tip.element);
            next = Held {
                element: at_tip.element,
                position_m,
                patch_m: self.world.spec.tip_patch_m,
            };
        }
        for (coordinate, by) in next.position_m.iter_mut().zip(travel.iter()) {
            *coordinate += by;
        }
        self.state.held = Some(next);
    }

    /// Prepares the element that the tip holds next if the needle keeps its speed. Runs after the response has been
    /// sent.
    pub(super) fn look_ahead(&mut self, travel: Vector3<f64>) {
        if self.world.spec.prepares {
            let next = self.next_held(travel);
            self.world.tissue.prepare(next);
        }
    }

    fn next_held(&self, travel: Vector3<f64>) -> Option<Held> {
        let speed_m_per_s = self.state.pose.speed_along_m_per_s;
        if speed_m_per_s.abs() < CONTACT_SPEED_M_PER_S {
            return None;
        }
        let step_m = self.state.pose.direction * speed_m_per_s * self.period_s;
        let (body, held) = (self.world.tissue.deformed(), self.state.held);
        let element = element_ahead(
            &body,
            held.map(|h| h.element),
            self.state.pose.tip_in_scene.into(),
            step_m.into(),
        )?;
        // At the first contact no travel yet shows how the tissue follows.
        let by_m = if held.is_some() { travel } else { step_m };
        let now_m = Vector3::from(body.position_m(element));
        Some(Held {
            element,
            position_m: (now_m + by_m).into(),
            patch_m: self.world.spec.tip_patch_m,
        })
    }
}
