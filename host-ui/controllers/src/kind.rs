//! Kind of a device, and the functions of its axes and buttons.

use stylet_base::format;

/// Kind of a device that can control the needle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A gamepad with a stick.
    Gamepad,
    /// A 3D mouse with six axes.
    Mouse3d,
}

/// Function of a button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    /// Drops a seed.
    Drop,
    /// Undoes the last seed, or else the plan.
    Undo,
    /// Stops needle and script.
    Stop,
    /// Turns the force on.
    Engage,
}

impl Button {
    /// All functions, in the order of [`Latest::presses`](crate::Latest::presses).
    pub const ALL: [Self; 4] = [Self::Drop, Self::Undo, Self::Stop, Self::Engage];
}

impl Kind {
    /// Returns the display name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gamepad => "gamepad",
            Self::Mouse3d => "3D mouse",
        }
    }

    /// Returns a short description of its axes, for a line of the window.
    pub fn axes(self) -> &'static str {
        match self {
            Self::Gamepad => "left stick: forwards in, backwards out",
            Self::Mouse3d => "press: in, lift: out; slide: across",
        }
    }

    /// Returns every axis and button, for the help page and the manual.
    pub fn uses(self) -> Vec<(&'static str, String)> {
        let along = format::speed(super::ALONG_M_PER_S);
        let across = format::speed(super::ACROSS_M_PER_S);
        match self {
            Self::Gamepad => vec![
                ("Left stick", format!("away in, back out: up to {along}")),
                ("Shoulder buttons, Shift", "four times slower".to_owned()),
                ("Lower button (A, cross)", "drop a seed at the tip".to_owned()),
                ("Right button (B, circle)", "stop the needle, and the script".to_owned()),
                ("Back, Select", "undo the last seed, or else the plan".to_owned()),
                ("Start", "force on; after a fault: re-arm".to_owned()),
            ],
            Self::Mouse3d => vec![
                ("Press, lift the cap", format!("in, out: up to {along}")),
                ("Slide the cap", format!("outside: across, up to {across}")),
                ("Shift", "four times slower".to_owned()),
                ("First button", "drop a seed at the tip".to_owned()),
                ("Second button", "stop the needle, and the script".to_owned()),
            ],
        }
    }
}
