//! Settings of the window that persist between starts.

use crate::recent::{self, Recent};
use serde::{Deserialize, Serialize};

/// Key under which the settings are stored.
const KEY: &str = "stylet.settings";
/// Smallest and largest scale of text and widgets.
pub const SCALES: [f32; 2] = [0.8, 2.0];
/// Points of the window in which a scale of 1 is the size of text.
const MADE_FOR: [f32; 2] = [1280.0, 800.0];
/// Fewest points that hold all controls; a larger scale is not applied in full.
const LEAST: [f32; 2] = [640.0, 360.0];
/// Change of the scale by a key.
const STEP: f32 = 0.1;
/// Range of the air kerma strength of a seed (U).
pub const STRENGTHS_U: [f64; 2] = [0.05, 5.0];

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ThemeChoice {
    #[default]
    Dark,
    Light,
}

/// Content of the middle of the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Layout {
    /// The three slices and the three-dimensional picture.
    #[default]
    Quad,
    Solid,
    Slices,
    /// Both planes of the ultrasound probe.
    Probe,
    /// Screen of a C-arm, next to the probe's.
    Fluoroscopy,
}

impl Layout {
    pub const ALL: [Self; 5] = [Self::Quad, Self::Solid, Self::Slices, Self::Probe, Self::Fluoroscopy];

    /// Returns the layouts to choose from. A page cannot wait for the graphics card, which computes the last two.
    pub fn offered() -> &'static [Self] {
        match crate::IN_PAGE {
            true => &Self::ALL[..3],
            false => &Self::ALL,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Quad => "All views",
            Self::Solid => "3D",
            Self::Slices => "Slices",
            Self::Probe => "Probe",
            Self::Fluoroscopy => "Fluoroscopy",
        }
    }

    pub fn next(self) -> Self {
        let offered = Self::offered();
        offered[(self as usize + 1) % offered.len()]
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    pub theme: ThemeChoice,
    /// Scale of text, relative to that of the window's size.
    pub scale: f32,
    pub layout: Layout,
    /// Recent files, the newest first.
    pub recent: Vec<Recent>,
    /// Air kerma strength of each seed (U).
    pub seed_strength_u: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            theme: ThemeChoice::default(),
            scale: 1.0,
            layout: Layout::default(),
            recent: Vec::new(),
            seed_strength_u: 0.5,
        }
    }
}

impl Settings {
    /// Returns the stored settings, or the defaults if there are none or they are unusable.
    pub fn read(storage: Option<&dyn eframe::Storage>) -> Self {
        let kept: Option<Self> = storage.and_then(|s| eframe::get_value(s, KEY));
        kept.unwrap_or_default().checked()
    }

    pub fn write(&self, storage: &mut dyn eframe::Storage) {
        eframe::set_value(storage, KEY, self);
    }

    /// Corrects invalid values, because anyone may have edited the file.
    fn checked(mut self) -> Self {
        let default = Self::default();
        if !self.scale.is_finite() {
            self.scale = default.scale;
        }
        if !self.seed_strength_u.is_finite() {
            self.seed_strength_u = default.seed_strength_u;
        }
        self.scale = self.scale.clamp(SCALES[0], SCALES[1]);
        self.seed_strength_u = self.seed_strength_u.clamp(STRENGTHS_U[0], STRENGTHS_U[1]);
        self.recent = recent::checked(self.recent);
        self
    }

    /// Returns the volume that was loaded last.
    pub fn last_file(&self) -> &str {
        let scene = self.recent.iter().find(|one| !one.is_image);
        scene.map_or("", |one| &one.path)
    }

    /// Changes the scale by the usual keys.
    pub fn take_keys(&mut self, ctx: &egui::Context) {
        use egui::gui_zoom::kb_shortcuts::{ZOOM_IN, ZOOM_IN_SECONDARY, ZOOM_OUT, ZOOM_RESET};
        let pressed = |shortcut: &egui::KeyboardShortcut| ctx.input_mut(|i| i.consume_shortcut(shortcut));
        let changed = match () {
            () if pressed(&ZOOM_RESET) => 1.0,
            () if pressed(&ZOOM_IN) || pressed(&ZOOM_IN_SECONDARY) => self.scale + STEP,
            () if pressed(&ZOOM_OUT) => self.scale - STEP,
            () => return,
        };
        self.scale = ((changed / STEP).round() * STEP).clamp(SCALES[0], SCALES[1]);
    }

    /// Applies colours and the size of text, in a window that enlarges it by `fit` up to `most`.
    pub fn apply(&self, ctx: &egui::Context, [fit, most]: [f32; 2]) {
        ctx.set_theme(match self.theme {
            ThemeChoice::Dark => egui::Theme::Dark,
            ThemeChoice::Light => egui::Theme::Light,
        });
        ctx.set_zoom_factor((self.scale * fit).clamp(SCALES[0], SCALES[1]).min(most));
    }
}

/// Returns how much the present window enlarges text, and the largest scale that it has room for.
pub fn fit_of(ctx: &egui::Context) -> [f32; 2] {
    // Without a screen, as in tests, the size does not follow the scale. A page does not know its screen.
    if crate::IN_PAGE || ctx.input(|i| i.viewport().monitor_size.is_some()) {
        let size = ctx.content_rect().size() * ctx.zoom_factor();
        [text_scale(size), largest_scale(size)]
    } else {
        [1.0, SCALES[1]]
    }
}

/// Returns the largest scale that a window of this size in points has room for, in eighths.
fn largest_scale(size: egui::Vec2) -> f32 {
    let times = (size.x / LEAST[0]).min(size.y / LEAST[1]);
    ((times * 8.0).floor() / 8.0).clamp(0.5, SCALES[1])
}

/// Returns how much a window of this size in points enlarges text: in eighths, so that text keeps
/// its size while an edge of the window moves a little.
pub fn text_scale(size: egui::Vec2) -> f32 {
    let times = (size.x / MADE_FOR[0]).min(size.y / MADE_FOR[1]);
    ((times * 8.0).floor() / 8.0).clamp(1.0, SCALES[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::Storage;
    use std::collections::BTreeMap;

    #[derive(Default)]
    struct Kept(BTreeMap<String, String>);

    impl Storage for Kept {
        fn get_string(&self, key: &str) -> Option<String> {
            self.0.get(key).cloned()
        }

        fn set_string(&mut self, key: &str, value: String) {
            self.0.insert(key.to_owned(), value);
        }

        fn remove_string(&mut self, key: &str) {
            self.0.remove(key);
        }

        fn flush(&mut self) {}
    }

    #[test]
    fn larger_windows_have_larger_text_up_to_twice_its_size() {
        for (size, times) in [
            ([960.0, 600.0], 1.0),
            ([1280.0, 720.0], 1.0),
            ([1366.0, 768.0], 1.0),
            ([1920.0, 1010.0], 1.25),
            ([1920.0, 1080.0], 1.25),
            ([3840.0, 2160.0], 2.0),
            ([3840.0, 800.0], 1.0),
        ] {
            assert_eq!(text_scale(size.into()), times, "{size:?}");
        }
    }

    #[test]
    fn text_grows_no_further_than_the_window_has_room_for() {
        for (size, times) in [
            ([480.0, 300.0], 0.75),
            ([960.0, 600.0], 1.5),
            ([1280.0, 720.0], 2.0),
            ([3840.0, 2160.0], 2.0),
            ([1.0, 1.0], 0.5),
        ] {
            assert_eq!(largest_scale(size.into()), times, "{size:?}");
        }
    }

    #[test]
    fn what_was_set_is_found_again() {
        let set = Settings {
            theme: ThemeChoice::Light,
            scale: 1.25,
            layout: Layout::Slices,
            recent: vec![Recent {
                path: "gland.nii.gz".to_owned(),
                is_image: false,
            }],
            seed_strength_u: 0.6,
        };
        let mut kept = Kept::default();
        set.write(&mut kept);
        assert_eq!(Settings::read(Some(&kept)), set);
    }

    #[test]
    fn a_damaged_settings_file_gives_usable_settings() {
        let mut kept = Kept::default();
        for text in [
            "",
            "garbage(",
            "(scale:1e30,seed_strength_u:-4.0)",
            "(scale:NaN)",
            "(theme:Dark,new:1)",
        ] {
            kept.set_string(KEY, text.to_owned());
            let read = Settings::read(Some(&kept));
            assert!((SCALES[0]..=SCALES[1]).contains(&read.scale), "{text}: {read:?}");
            assert!(
                (STRENGTHS_U[0]..=STRENGTHS_U[1]).contains(&read.seed_strength_u),
                "{text}"
            );
        }
        assert_eq!(Settings::read(None), Settings::default());
    }
}
