//! State of the service and its device, its answers, and its faults.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde_json::{Value, json};

/// Time after which a force that is not renewed is dropped. The vendor says that the device then returns to idle,
/// without a time: this figure is the fake's own.
pub const IDLE_AFTER_MS: u64 = 100;

/// Fault of the service.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrong {
    /// No fault.
    #[default]
    Nothing,
    /// Each answer takes this many milliseconds.
    Late(u64),
    /// It neither reads nor answers.
    Hangs,
    /// It reads and obeys, but does not answer.
    Silent,
    /// It answers with an old state, and does nothing.
    Old,
    /// A number of the position is invalid, in one of five ways.
    NoNumber(u32),
    /// The position is a thousand kilometres away.
    Far,
    /// The answer is not a state, in one of six ways.
    Broken(u32),
    /// The device is missing from the list.
    Unplugged,
    /// Another device is in its place.
    Other,
    /// The device is not calibrated.
    NotCalibrated,
    /// The device is not ready.
    NotReady,
    /// The device has no power.
    NoPower,
    /// The connection is closed, and no other is accepted.
    Closes,
    /// The answer is not text.
    Binary,
    /// The answer is longer than the most accepted.
    Long,
    /// Each answer is sent twice.
    Twice,
    /// Each answer is sent twenty times.
    Floods,
    /// The frame was scaled by another program.
    Scaled,
    /// The orientation of the handle is invalid, in one of three ways.
    BadGrip(u32),
}

/// The service, shared by the test and the server.
#[derive(Clone)]
pub struct Service(Arc<Mutex<State>>);

/// Commands of the test, and reports of the fake.
pub struct State {
    // Commands of the test:
    /// Present fault.
    pub wrong: Wrong,
    /// Tip in the frame of the device, m.
    pub tip_m: [f64; 3],
    /// Device id in the service.
    pub id: String,
    /// Its type.
    pub kind: String,
    /// Another program uses the device.
    pub in_use: bool,
    /// Axes that the service uses, whatever was requested.
    pub axes: Option<String>,
    /// Version of the service; `None` if it does not report one.
    pub version: Option<String>,
    /// Orientation of a handle, w first.
    pub grip: Option<[f64; 4]>,
    /// The handle's first and third button.
    pub buttons: [bool; 2],
    /// Time in steps; `None` for the system's time.
    pub now_ms: Option<u64>,
    // Reports of the fake:
    /// The last force that arrived, N.
    pub force_n: [f64; 3],
    /// Time of its arrival.
    pub force_ms: u64,
    /// Largest force that arrived, N.
    pub peak_n: f64,
    /// Messages that violate the interface.
    pub wrong_messages: u32,
    /// Forces that arrived while an answer was owed.
    pub out_of_turn: u32,
    /// Messages that arrived.
    pub messages: u64,
    /// Connections that were opened.
    pub opens: u32,
    /// Force when the other side closed the connection.
    pub force_at_close_n: [f64; 3],
    /// Configuration of the session.
    pub session: Value,
    /// The preset of the device.
    pub preset: Value,
    owed: u32,
    last: Value,
    begun: Instant,
}

/// A message to the other side.
#[derive(Clone, Debug)]
pub enum Sent {
    /// Text.
    Text(String),
    /// Binary data.
    Binary,
}

impl Default for Service {
    fn default() -> Self {
        Self(Arc::new(Mutex::new(State {
            wrong: Wrong::Nothing,
            tip_m: [0.0; 3],
            id: "049D".to_owned(),
            kind: "inverse3".to_owned(),
            in_use: false,
            axes: None,
            version: Some("3.5.0.0".to_owned()),
            grip: None,
            buttons: [false; 2],
            now_ms: None,
            force_n: [0.0; 3],
            force_ms: 0,
            peak_n: 0.0,
            wrong_messages: 0,
            out_of_turn: 0,
            messages: 0,
            opens: 0,
            force_at_close_n: [0.0; 3],
            session: Value::Null,
            preset: Value::Null,
            owed: 0,
            last: Value::Null,
            begun: Instant::now(),
        })))
    }
}

impl Service {
    /// Locks commands and reports.
    pub fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Removes all faults, and restores the original device.
    pub fn heal(&mut self) {
        (self.wrong, self.in_use, self.axes) = (Wrong::Nothing, false, None);
        self.id = "049D".to_owned();
        self.kind = "inverse3".to_owned();
        self.version = Some("3.5.0.0".to_owned());
    }

    /// Returns the time of the service.
    pub fn now_ms(&self) -> u64 {
        self.now_ms.unwrap_or_else(|| self.begun.elapsed().as_millis() as u64)
    }

    /// Returns the force of the motors: the last one, unless it expired or the device has none.
    pub fn motors_n(&self) -> [f64; 3] {
        let renewed = self.now_ms() - self.force_ms <= IDLE_AFTER_MS;
        let is_there = !matches!(self.wrong, Wrong::Unplugged | Wrong::Other | Wrong::NoPower);
        if renewed && is_there { self.force_n } else { [0.0; 3] }
    }

    /// Returns the first message of a new connection.
    pub fn open(&mut self) -> String {
        self.opens += 1;
        self.owed = 0;
        self.snapshot().to_string()
    }

    /// Records a closed connection, which ends the force.
    pub fn closed(&mut self) {
        self.force_at_close_n = self.force_n;
        self.force_n = [0.0; 3];
    }

    /// Obeys a message; returns the answers.
    pub fn answer(&mut self, text: &str) -> Vec<Sent> {
        self.messages += 1;
        if self.take(text).is_none() {
            self.wrong_messages += 1;
        }
        self.owed += 1;
        if self.wrong != Wrong::Old || self.last.is_null() {
            self.last = self.snapshot();
        }
        let whole = self.last.to_string();
        match self.wrong {
            Wrong::Silent => vec![],
            Wrong::Binary => vec![Sent::Binary],
            Wrong::Long => vec![Sent::Text(format!("{whole}{}", " ".repeat(1 << 20)))],
            Wrong::Floods => vec![Sent::Text(whole); 20],
            Wrong::Twice => vec![Sent::Text(whole.clone()), Sent::Text(whole)],
            Wrong::Broken(kind) => {
                let broken = match kind % 6 {
                    0 => whole[..whole.len() / 2].to_owned(),
                    1 => String::new(),
                    2 => "<html>502 Bad Gateway</html>".to_owned(),
                    3 => "[".repeat(5000),
                    4 => json!({"inverse3": [{"device_id": self.id, "state": "none"}]}).to_string(),
                    _ => json!({"inverse3": [{"device_id": self.id}]}).to_string(),
                };
                vec![Sent::Text(broken)]
            }
            Wrong::NoNumber(kind) => {
                let number = ["null", "NaN", "1e999", "\"0.1\"", "-Infinity"][kind as usize % 5];
                vec![Sent::Text(whole.replacen("7777.25", number, 1))]
            }
            _ => vec![Sent::Text(whole)],
        }
    }

    /// Records that an answer has left.
    pub fn answered(&mut self) {
        self.owed = self.owed.saturating_sub(1);
    }

    /// Obeys a message; `None` if it violates the interface.
    fn take(&mut self, text: &str) -> Option<()> {
        let value: Value = serde_json::from_str(text).ok()?;
        if let Some(configure) = value.get("session").and_then(|s| s.get("configure")) {
            self.session = configure.clone();
        }
        let [device] = &value.get("inverse3")?.as_array()?[..] else {
            return None;
        };
        if let Some(preset) = device.get("configure").and_then(|c| c.get("preset")) {
            self.preset = preset.get("preset")?.clone();
        }
        let vector = device.get("commands")?.get("set_cursor_force")?.get("vector")?;
        let [x, y, z] = ["x", "y", "z"].map(|axis| vector.get(axis).and_then(Value::as_f64));
        let force_n = [x?, y?, z?];
        if device.get("device_id")?.as_str()? != self.id {
            return None;
        }
        if self.wrong == Wrong::Old {
            return Some(());
        }
        let size = force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        self.out_of_turn += u32::from(self.owed > 0 && size > 0.0);
        self.peak_n = self.peak_n.max(size);
        (self.force_n, self.force_ms) = (force_n, self.now_ms());
        Some(())
    }

    fn snapshot(&self) -> Value {
        let [x, mut y, z] = self.tip_m;
        // A number replaced in the text.
        if matches!(self.wrong, Wrong::NoNumber(_)) {
            y = 7777.25;
        }
        let x = if self.wrong == Wrong::Far { 1e6 } else { x };
        let id = if self.wrong == Wrong::Other { "0BAD" } else { &self.id };
        // Jitter of an encoder's last digit.
        let jitter = (self.messages % 7) as f64 * 1e-6;
        let scale = if self.wrong == Wrong::Scaled { 2.0 } else { 1.0 };
        let identity = json!({"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0});
        let device = json!({
            "device_id": id,
            "config": {
                "type": self.kind,
                "device_info": {"major_version": 7, "minor_version": 4, "id": id, "device_type": 4},
                "basis": {"permutation": self.axes.as_deref().unwrap_or("XYZ")},
                "mount": {"position": {"x": 0.0, "y": 0.1, "z": 0.0}, "rotation": identity, "scale": {"x": 1, "y": 1, "z": 1}},
            },
            "state": {
                "cursor_position": {"x": x, "y": y, "z": z},
                "cursor_velocity": {"x": jitter, "y": 0.0, "z": 0.0},
                "current_cursor_force": {"x": self.force_n[0], "y": self.force_n[1], "z": self.force_n[2]},
                "control_domain": "cartesian",
                "transform": {"position": {"x": 0, "y": 0, "z": 0}, "rotation": identity, "scale": {"x": scale, "y": 1, "z": 1}},
            },
            "status": {
                "calibrated": self.wrong != Wrong::NotCalibrated,
                "in_use": self.in_use,
                "power_supply": self.wrong != Wrong::NoPower,
                "ready": self.wrong != Wrong::NotReady,
                "started": true,
            },
        });
        let devices = if self.wrong == Wrong::Unplugged {
            vec![]
        } else {
            vec![device]
        };
        json!({"session_id": 7, "inverse3": devices, "verse_grip": [], "wireless_verse_grip": self.grips()})
    }

    fn grips(&self) -> Vec<Value> {
        let orientation = match self.wrong {
            Wrong::BadGrip(0) => Some([0.0; 4]),
            Wrong::BadGrip(1) => Some([1e300; 4]),
            Wrong::BadGrip(_) => Some([2.0, 0.0, 0.0, 0.0]),
            _ => self.grip,
        };
        let [a, c] = self.buttons;
        let of = |[w, x, y, z]: [f64; 4]| {
            let orientation = json!({"w": w, "x": x, "y": y, "z": z});
            let state = json!({"orientation": orientation, "buttons": {"a": a, "b": false, "c": c}, "hall": 16});
            json!({"device_id": "1102", "state": state, "status": {"connected": true, "awake": true, "ready": true}})
        };
        orientation.map(of).into_iter().collect()
    }
}
