//! State common to all pictures in the middle: cut planes, measurements, visibility.

use super::orientation::Orientation;
use nalgebra::Vector3;

/// Distance between two places, set by two clicks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measure {
    pub active: bool,
    /// None, one or two places, scene frame.
    points_m: Vec<Vector3<f64>>,
}

impl Measure {
    pub fn toggle(&mut self) {
        self.active = !self.active;
        self.points_m.clear();
    }

    /// Takes a place; a third one begins a new distance.
    pub fn take(&mut self, point_m: Vector3<f64>) {
        if self.points_m.len() >= 2 {
            self.points_m.clear();
        }
        self.points_m.push(point_m);
    }

    pub fn points_m(&self) -> &[Vector3<f64>] {
        &self.points_m
    }

    pub fn length_m(&self) -> Option<f64> {
        match self.points_m.as_slice() {
            [a, b] => Some((b - a).norm()),
            _ => None,
        }
    }
}

/// Tool for clicks on the picture of the probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    /// Edge of the gland.
    Contour,
    /// Seeds that are visible.
    Seeds,
}

impl Tool {
    pub const ALL: [Self; 2] = [Self::Contour, Self::Seeds];

    pub fn name(self) -> &'static str {
        match self {
            Self::Contour => "Contour",
            Self::Seeds => "Seeds",
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct ViewState {
    /// Common point of the three slices, scene frame.
    pub cursor_m: Vector3<f64>,
    /// True if the slices go through the tip of the needle.
    pub follow_tip: bool,
    /// True in the frame in which the slices were moved off the tip by hand.
    pub has_left_tip: bool,
    pub measure: Measure,
    /// Tool on the picture of the probe.
    pub tool: Option<Tool>,
    /// Slice in front of which the body is cut away.
    pub section: Option<Orientation>,
    pub isodose: bool,
    /// True if the slices show the loaded image, if there is one.
    pub image: bool,
}

impl Default for ViewState {
    fn default() -> Self {
        Self {
            cursor_m: Vector3::repeat(0.03),
            follow_tip: true,
            has_left_tip: false,
            measure: Measure::default(),
            tool: None,
            section: None,
            isodose: true,
            image: true,
        }
    }
}

impl ViewState {
    /// Lets the operator move the slices, which then stay where they are.
    pub fn leave_tip(&mut self) {
        self.has_left_tip |= std::mem::replace(&mut self.follow_tip, false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_that_leave_the_tip_say_so_once() {
        let mut view = ViewState::default();
        view.leave_tip();
        assert!(!view.follow_tip && std::mem::take(&mut view.has_left_tip));
        view.leave_tip();
        assert!(!view.has_left_tip);
    }

    #[test]
    fn two_clicks_measure_and_a_third_begins_a_new_distance() {
        let mut measure = Measure::default();
        measure.toggle();
        measure.take(Vector3::zeros());
        assert_eq!(measure.length_m(), None);
        measure.take(Vector3::new(0.003, 0.004, 0.0));
        assert!((measure.length_m().expect("two places") - 0.005).abs() < 1e-12);
        measure.take(Vector3::zeros());
        assert_eq!(measure.points_m().len(), 1);
        measure.toggle();
        assert!(measure.points_m().is_empty() && !measure.active);
    }
}
