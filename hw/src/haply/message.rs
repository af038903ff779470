//! Messages of service 3.5 in JSON, read and written.
//!
//! Fields and units: docs.haply.co, "WebSocket Protocol" and "Control Commands" of 3.5, and the
//! maker's crate `haply` 1.3.1.

use core::fmt::Write;
use std::borrow::Cow;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;

/// A state of all devices.
#[derive(Deserialize, Default)]
#[serde(default)]
pub struct Frame<'a> {
    #[serde(borrow)]
    pub inverse3: Vec<Inverse<'a>>,
    #[serde(borrow)]
    pub wireless_verse_grip: Vec<Grip<'a>>,
    #[serde(borrow)]
    pub custom_verse_grip: Vec<Grip<'a>>,
    #[serde(borrow)]
    pub verse_grip: Vec<Grip<'a>>,
}

/// A device with motors.
#[derive(Deserialize)]
pub struct Inverse<'a> {
    #[serde(borrow)]
    pub device_id: Cow<'a, str>,
    #[serde(borrow)]
    pub config: Option<Config<'a>>,
    #[serde(default)]
    pub state: State,
    #[serde(default)]
    pub status: Status,
}

/// Type and frame of a device.
#[derive(Deserialize)]
pub struct Config<'a> {
    #[serde(borrow, rename = "type")]
    pub kind: Option<Cow<'a, str>>,
    pub device_info: Option<Versions>,
    #[serde(borrow)]
    pub basis: Option<Basis<'a>>,
    pub mount: Option<Scaled>,
}

/// Version of a device's firmware.
#[derive(Deserialize, Clone, Copy)]
pub struct Versions {
    pub major_version: Option<u32>,
    pub minor_version: Option<u32>,
}

/// Axes that a session uses.
#[derive(Deserialize)]
pub struct Basis<'a> {
    #[serde(borrow)]
    pub permutation: Cow<'a, str>,
}

/// A transform of the frame.
#[derive(Deserialize)]
pub struct Scaled {
    rotation: Option<Wxyz>,
    scale: Option<Xyz>,
}

/// Position and velocity of a device.
#[derive(Deserialize, Default)]
pub struct State {
    pub cursor_position: Option<Xyz>,
    pub cursor_velocity: Option<Xyz>,
    pub transform: Option<Scaled>,
}

/// Conditions that forbid a force; a field that the service omits forbids none.
#[derive(Deserialize, Default, Clone, Copy)]
pub struct Status {
    pub calibrated: Option<bool>,
    pub in_use: Option<bool>,
    pub power_supply: Option<bool>,
    pub ready: Option<bool>,
}

/// A handle.
#[derive(Deserialize)]
pub struct Grip<'a> {
    #[serde(borrow)]
    pub device_id: Cow<'a, str>,
    #[serde(default)]
    pub state: GripState,
}

/// Orientation of a handle.
#[derive(Deserialize, Default)]
pub struct GripState {
    pub orientation: Option<Wxyz>,
    #[serde(default)]
    buttons: Option<Buttons>,
    button: Option<bool>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Buttons {
    a: bool,
    b: bool,
    c: bool,
}

/// Vector; a missing number reads as NaN.
#[derive(Deserialize, Clone, Copy)]
pub struct Xyz {
    x: Option<f64>,
    y: Option<f64>,
    z: Option<f64>,
}

/// An orientation.
#[derive(Deserialize, Clone, Copy)]
pub struct Wxyz {
    w: Option<f64>,
    x: Option<f64>,
    y: Option<f64>,
    z: Option<f64>,
}

impl<'a> Frame<'a> {
    /// Parses the frame in `text`; `None` if it is not one.
    pub fn of(text: &'a str) -> Option<Self> {
        serde_json::from_str(text).ok()
    }

    /// Returns the device with this number.
    pub fn device(&self, id: &str) -> Option<&Inverse<'a>> {
        self.inverse3.iter().find(|d| d.device_id == id)
    }

    /// Returns the first handle; wireless handles precede those on a cable.
    pub fn grip(&self) -> Option<&Grip<'a>> {
        let wireless = self.wireless_verse_grip.iter().chain(&self.custom_verse_grip);
        wireless.chain(&self.verse_grip).next()
    }
}

impl Xyz {
    /// Returns the vector, with NaN for each missing number.
    pub fn vector(&self) -> Vector3<f64> {
        Vector3::new(self.x, self.y, self.z).map(|x| x.unwrap_or(f64::NAN))
    }
}

impl Wxyz {
    /// Returns the rotation, if it is one.
    pub fn rotation(&self) -> Option<UnitQuaternion<f64>> {
        let parts = Quaternion::new(self.w?, self.x?, self.y?, self.z?);
        let is_rotation = parts.norm().is_finite() && (parts.norm() - 1.0).abs() < 0.01;
        is_rotation.then(|| UnitQuaternion::from_quaternion(parts))
    }
}

impl Scaled {
    /// Returns whether lengths in this frame are those of the device.
    pub fn keeps_lengths(&self) -> bool {
        self.scale
            .is_none_or(|s| (s.vector() - Vector3::repeat(1.0)).amax() < 1e-6)
    }

    /// Returns whether the transform keeps the axes, wherever its origin is.
    pub fn keeps_axes(&self) -> bool {
        let turned = |r: &Wxyz| r.rotation().is_none_or(|r| r.angle() > 1e-3);
        self.keeps_lengths() && !self.rotation.as_ref().is_some_and(turned)
    }
}

impl GripState {
    /// Returns one bit per button.
    pub fn buttons(&self) -> u32 {
        let b = self.buttons.as_ref();
        let bits = [
            b.is_some_and(|b| b.a) || self.button == Some(true),
            b.is_some_and(|b| b.b),
            b.is_some_and(|b| b.c),
        ];
        bits.iter().rev().fold(0, |mask, bit| mask << 1 | u32::from(*bit))
    }
}

/// Returns the version in the answer to `GET /version`, with or without the envelope of 3.5.
pub fn version(answer: &str) -> Option<String> {
    let (_, json) = answer.split_at(answer.find('{')?);
    let value: serde_json::Value = serde_json::Deserializer::from_str(json).into_iter().next()?.ok()?;
    let field = value
        .get("project_version")
        .or_else(|| value.get("data")?.get("project_version"));
    field?
        .as_str()
        .map(|v| v.chars().filter(|c| !c.is_control()).take(32).collect())
}

/// Returns whether the number of a device can stand in a message without quoting.
pub fn is_plain(id: &str) -> bool {
    (1..=64).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_".contains(&b))
}

/// Returns the first message: name of the program, axes and origin, full-state answers, zero force.
pub fn hello(id: &str) -> String {
    format!(
        "{{\"session\":{{\"force_render_full_state\":{{}},\"configure\":{{\"profile\":{{\"name\":\"stylet\",\
         \"required_version\":\">=3.5\"}},\"basis\":{{\"permutation\":\"XYZ\"}}}}}},\"inverse3\":[{{\"device_id\":\"{id}\",\
         \"configure\":{{\"preset\":{{\"preset\":\"{PRESET}\"}}}},\"commands\":{{\"set_cursor_force\":{{\"vector\":\
         {{\"x\":0.0,\"y\":0.0,\"z\":0.0}}}}}}}}]}}"
    )
}

/// Preset with the arm forward and the origin in the centre of the workspace.
const PRESET: &str = "arm_front_centered";

/// Writes the message that sets a force, N, into `out`.
pub fn force(out: &mut String, id: &str, [x, y, z]: [f64; 3]) {
    out.clear();
    // Writing to a string does not fail.
    let _ = write!(
        out,
        "{{\"inverse3\":[{{\"device_id\":\"{id}\",\"commands\":{{\"set_cursor_force\":{{\"vector\":\
         {{\"x\":{x:.9},\"y\":{y:.9},\"z\":{z:.9}}}}}}}}}]}}"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_json_with_the_names_of_3_5() {
        let mut text = String::new();
        force(&mut text, "049D", [1.5, -0.25, 1e-12]);
        let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let vector = &value["inverse3"][0]["commands"]["set_cursor_force"]["vector"];
        assert_eq!(
            (vector["x"].as_f64(), vector["y"].as_f64(), vector["z"].as_f64()),
            (Some(1.5), Some(-0.25), Some(0.0))
        );
        assert_eq!(value["inverse3"][0]["device_id"], "049D");
        let value: serde_json::Value = serde_json::from_str(&hello("049D")).expect("JSON");
        assert_eq!(value["session"]["configure"]["basis"]["permutation"], "XYZ");
        assert_eq!(value["session"]["configure"]["profile"]["required_version"], ">=3.5");
        assert_eq!(value["inverse3"][0]["configure"]["preset"]["preset"], PRESET);
    }

    #[test]
    fn missing_numbers_and_invalid_rotations_are_refused() {
        let text = r#"{"session_id": 7, "inverse3": [{"device_id": "A", "state": {"cursor_position": {"x": 1, "y": null}}}],
            "verse_grip": [{"device_id": "G", "state": {"orientation": {"w": 2, "x": 0, "y": 0, "z": 0}, "button": true}}]}"#;
        let frame = Frame::of(text).expect("a frame");
        let position = frame
            .device("A")
            .and_then(|d| d.state.cursor_position)
            .expect("there")
            .vector();
        assert!(position.x == 1.0 && position.y.is_nan() && position.z.is_nan());
        let grip = frame.grip().expect("a handle");
        assert!(grip.state.orientation.expect("there").rotation().is_none() && grip.state.buttons() == 1);
        for wrong in [
            "",
            "{",
            "[1]",
            "NaN",
            r#"{"inverse3": 3}"#,
            r#"{"inverse3": [{"state": {}}]}"#,
        ] {
            assert!(Frame::of(wrong).is_none(), "{wrong}");
        }
    }

    #[test]
    fn both_forms_of_the_version_answer_are_read() {
        let bare = "HTTP/1.1 200 OK\r\n\r\n{\"project_version\": \"3.5.0.0\"}";
        let wrapped = "HTTP/1.1 200 OK\r\n\r\n{\"ok\": true, \"data\": {\"project_version\": \"3.5.1\"}}tail";
        assert_eq!(version(bare).as_deref(), Some("3.5.0.0"));
        assert_eq!(version(wrapped).as_deref(), Some("3.5.1"));
        assert_eq!(version("HTTP/1.1 404\r\n\r\n"), None);
    }
}
