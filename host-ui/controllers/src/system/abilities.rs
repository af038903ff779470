//! Abilities of a device as the kernel reports them, which tell its kind, and the functions of its keys.

use crate::kind::{Button, Kind};
use evdev::{AbsoluteAxisCode, KeyCode, PropType, RelativeAxisCode};

/// Bitmap of the kernel, as sysfs writes it: words in hexadecimal, the most significant first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bits(Vec<u64>);

impl Bits {
    /// Reads a bitmap; a text that is not one gives an empty bitmap.
    pub fn read(text: &str) -> Self {
        let words = text.split_whitespace().rev();
        Self(words.map_while(|w| u64::from_str_radix(w, 16).ok()).collect())
    }

    /// Returns whether the bit is set.
    pub fn has(&self, bit: u16) -> bool {
        let word = self.0.get(usize::from(bit) / 64).copied().unwrap_or(0);
        word >> (bit % 64) & 1 == 1
    }
}

/// Abilities of a device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Abilities {
    /// Keys and buttons.
    pub keys: Bits,
    /// Absolute axes.
    pub absolute: Bits,
    /// Relative axes.
    pub relative: Bits,
    /// Properties, such as accelerometer.
    pub properties: Bits,
    /// USB number of the vendor.
    pub vendor: u16,
}

const VENDOR_3DCONNEXION: u16 = 0x256f;

impl Kind {
    /// Returns the kind of a device with these abilities; `None` for any other device.
    pub fn of(can: &Abilities) -> Option<Self> {
        let key = |key: KeyCode| can.keys.has(key.0);
        // The motion sensor of a gamepad appears as a separate device with six axes.
        if can.properties.has(PropType::ACCELEROMETER.0) {
            return None;
        }
        if key(KeyCode::BTN_SOUTH) {
            let has_stick = can.absolute.has(AbsoluteAxisCode::ABS_X.0) && can.absolute.has(AbsoluteAxisCode::ABS_Y.0);
            return has_stick.then_some(Self::Gamepad);
        }
        // X, Y, Z and the turns about them have successive numbers.
        let six = (AbsoluteAxisCode::ABS_X.0..=AbsoluteAxisCode::ABS_RZ.0).all(|a| can.absolute.has(a))
            || (RelativeAxisCode::REL_X.0..=RelativeAxisCode::REL_RZ.0).all(|a| can.relative.has(a));
        // Joysticks and wheels have six axes too, but lack the buttons of a 3D mouse.
        let is_cap = can.vendor == VENDOR_3DCONNEXION || key(KeyCode::BTN_0);
        (six && is_cap && !key(KeyCode::BTN_TRIGGER)).then_some(Self::Mouse3d)
    }

    /// Returns the function of a key by its place: drivers name the upper and the left one
    /// differently.
    pub fn button(self, key: KeyCode) -> Option<Button> {
        match (self, key) {
            (Self::Gamepad, KeyCode::BTN_SOUTH) | (Self::Mouse3d, KeyCode::BTN_0) => Some(Button::Drop),
            (Self::Gamepad, KeyCode::BTN_EAST) | (Self::Mouse3d, KeyCode::BTN_1) => Some(Button::Stop),
            (Self::Gamepad, KeyCode::BTN_SELECT) => Some(Button::Undo),
            (Self::Gamepad, KeyCode::BTN_START) => Some(Button::Engage),
            _ => None,
        }
    }

    /// Returns whether the key has a function.
    pub fn has_use_for(self, key: KeyCode) -> bool {
        self.button(key).is_some() || self.slows(key)
    }

    /// Returns whether the key slows the needle while it is held.
    pub fn slows(self, key: KeyCode) -> bool {
        self == Self::Gamepad && [KeyCode::BTN_TL, KeyCode::BTN_TR].contains(&key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns abilities as `/sys/class/input/eventN/device` shows them on a 64-bit machine.
    fn sysfs(keys: &str, absolute: &str, relative: &str, properties: &str, vendor: u16) -> Abilities {
        Abilities {
            keys: Bits::read(keys),
            absolute: Bits::read(absolute),
            relative: Bits::read(relative),
            properties: Bits::read(properties),
            vendor,
        }
    }

    #[test]
    fn bits_are_read_as_the_kernel_writes_them() {
        let bits = Bits::read("7cdb000000000000 0 0 0 0\n");
        // BTN_SOUTH is 0x130: word 4, bit 48.
        assert!(bits.has(0x130) && bits.has(0x131) && !bits.has(0x132) && !bits.has(0x12f));
        assert!(!bits.has(u16::MAX));
        assert_eq!(Bits::read("no bitmap"), Bits::default());
    }

    #[test]
    fn gamepads_and_3d_mice_are_told_from_other_devices() {
        let pad = sysfs("7cdb000000000000 0 0 0 0", "3003f", "0", "0", 0x045e);
        assert_eq!(Kind::of(&pad), Some(Kind::Gamepad));
        let cap = sysfs("3 0 0 0 0", "3f", "0", "0", 0x256f);
        assert_eq!(Kind::of(&cap), Some(Kind::Mouse3d));
        let old_cap = sysfs("3 0 0 0 0", "0", "3f", "0", 0x046d);
        assert_eq!(Kind::of(&old_cap), Some(Kind::Mouse3d));
        for (what, device) in [
            ("a mouse", sysfs("1f0000 0 0 0 0", "0", "903", "0", 0x046d)),
            (
                "a keyboard",
                sysfs(
                    "1000000000007 ff9f207ac14057ff febeffdfffefffff fffffffffffffffe",
                    "0",
                    "0",
                    "0",
                    1,
                ),
            ),
            ("the motion sensor of a gamepad", sysfs("0", "3f", "0", "40", 0x054c)),
            (
                "the touchpad of a gamepad",
                sysfs("2420 10000 0 0 0 0", "260800000000003", "0", "5", 0x054c),
            ),
            (
                "a joystick with six axes",
                sysfs("fff00000000 0 0 0 0", "3f", "0", "0", 0x046d),
            ),
            ("nothing", Abilities::default()),
        ] {
            assert_eq!(Kind::of(&device), None, "{what}");
        }
    }

    #[test]
    fn each_button_of_the_gamepad_can_be_pressed() {
        let keys = [
            KeyCode::BTN_SOUTH,
            KeyCode::BTN_EAST,
            KeyCode::BTN_SELECT,
            KeyCode::BTN_START,
        ];
        let does: Vec<Button> = keys.into_iter().filter_map(|k| Kind::Gamepad.button(k)).collect();
        assert!(Button::ALL.iter().all(|b| does.contains(b)));
        assert!(keys.into_iter().all(|k| !Kind::Gamepad.slows(k)));
    }
}
