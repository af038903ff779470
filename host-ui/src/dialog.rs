//! Native file dialogs, through the desktop's portal, on a separate thread: a frame never waits
//! for one.

use std::path::{Path, PathBuf};
#[cfg(not(target_family = "wasm"))]
use std::time::{Duration, Instant};
use stylet_base::job::{Job, JobUpdate};

/// Shortest time in which a person can close a dialog; a faster end means that it never opened.
#[cfg(not(target_family = "wasm"))]
const OPENS_WITHIN: Duration = Duration::from_millis(400);

/// Purpose of a dialog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A segmentation or a scene file.
    Scene,
    /// An image of the patient of the scene.
    Image,
    /// A recording to play.
    Recording,
    /// A plan to read.
    ImportPlan,
    /// A plan to write, complete.
    SavePlan,
    /// The plan's seeds as a table.
    SaveTable,
    /// The plan's seeds as a DICOM RT Plan.
    SaveRtPlan,
}

impl Purpose {
    /// Purposes that save a plan.
    pub const SAVES: [Self; 3] = [Self::SavePlan, Self::SaveTable, Self::SaveRtPlan];

    /// Returns the title of the dialog, and of the menu entry that opens it.
    pub fn title(self) -> &'static str {
        match self {
            Self::Scene => "Open a scene",
            Self::Image => "Open an image",
            Self::Recording => "Open a recording",
            Self::ImportPlan => "Import a plan",
            Self::SavePlan => "Save as Stylet plan (.toml)",
            Self::SaveTable => "Save seeds as table (.csv)",
            Self::SaveRtPlan => "Save seeds as DICOM RT Plan (.dcm)",
        }
    }

    /// Returns the names of the formats, each with its file extensions.
    #[cfg(not(target_family = "wasm"))]
    fn formats(self) -> &'static [(&'static str, &'static [&'static str])] {
        match self {
            Self::Scene => &[
                (
                    "Scenes and segmentations",
                    &["toml", "nii", "gz", "nrrd", "nhdr", "mha", "mhd", "dcm"],
                ),
                ("All files", &["*"]),
            ],
            Self::Image => &[
                ("Images", &["nii", "gz", "nrrd", "nhdr", "mha", "mhd", "dcm"]),
                ("All files", &["*"]),
            ],
            Self::Recording => &[("Recordings (MCAP)", &["mcap"]), ("All files", &["*"])],
            Self::ImportPlan => &[("Plans", &["toml", "csv", "dcm"]), ("All files", &["*"])],
            Self::SavePlan => &[("Stylet plan", &["toml"])],
            Self::SaveTable => &[("Table of seeds", &["csv"])],
            Self::SaveRtPlan => &[("DICOM RT Plan", &["dcm"])],
        }
    }
}

/// Result of a dialog: a file, or none if it was closed.
type Picked = Result<Option<PathBuf>, DialogError>;

/// Error of a dialog that could not be opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DialogError {
    /// Neither a session bus nor zenity is present.
    #[cfg(not(target_family = "wasm"))]
    #[error(
        "this desktop has no file dialog (no session bus with a portal, no zenity): type the path into the field instead"
    )]
    NoDesktop,
    /// The portal did not answer, or refused.
    #[cfg(not(target_family = "wasm"))]
    #[error(
        "the desktop's file dialog did not open (is xdg-desktop-portal installed?): type the path into the field instead"
    )]
    NotOpened,
    /// The window is a web page.
    #[cfg(target_family = "wasm")]
    #[error("a web page opens no files by their paths: drop a recording onto it")]
    Page,
    /// Its thread ended without a result.
    #[error("the file dialog ended without an answer: type the path into the field instead")]
    Ended,
}

/// One dialog at a time.
#[derive(Default)]
pub struct Dialogs {
    open: Option<(Purpose, Job<Picked>)>,
}

impl Dialogs {
    /// Opens a dialog in the folder of a known file, unless one is open.
    pub fn begin(&mut self, purpose: Purpose, beside: &str) {
        if self.open.is_some() {
            return;
        }
        let folder = Path::new(beside.trim()).parent().map(Path::to_owned);
        let job = Job::begin("file dialog", move |answer, _| {
            // The window may have closed; the answer is then dropped.
            let _ = answer.send(pick(purpose, folder));
        });
        self.open = Some((purpose, job));
    }

    /// Returns each result once.
    pub fn poll(&mut self) -> Option<(Purpose, Picked)> {
        let (purpose, job) = self.open.as_ref()?;
        let (purpose, picked) = match job.poll() {
            JobUpdate::Pending => return None,
            JobUpdate::Message(picked) => (*purpose, picked),
            JobUpdate::Ended => (*purpose, Err(DialogError::Ended)),
        };
        self.open = None;
        Some((purpose, picked))
    }
}

#[cfg(target_family = "wasm")]
fn pick(_purpose: Purpose, _folder: Option<PathBuf>) -> Picked {
    Err(DialogError::Page)
}

#[cfg(not(target_family = "wasm"))]
fn pick(purpose: Purpose, folder: Option<PathBuf>) -> Picked {
    if !is_possible(|name| std::env::var_os(name).map(PathBuf::from)) {
        return Err(DialogError::NoDesktop);
    }
    let mut dialog = rfd::FileDialog::new().set_title(purpose.title());
    for (name, endings) in purpose.formats() {
        dialog = dialog.add_filter(*name, endings);
    }
    if let Some(folder) = folder.filter(|folder| folder.is_dir()) {
        dialog = dialog.set_directory(folder);
    }
    let begun = Instant::now();
    let picked = if Purpose::SAVES.contains(&purpose) {
        dialog.save_file()
    } else {
        dialog.pick_file()
    };
    match picked {
        Some(path) => Ok(Some(with_ending(purpose, path))),
        None if begun.elapsed() < OPENS_WITHIN => Err(DialogError::NotOpened),
        None => Ok(None),
    }
}

/// Returns whether a dialog is possible: a session bus that may have a portal, or zenity.
#[cfg(not(target_family = "wasm"))]
fn is_possible(variable: impl Fn(&str) -> Option<PathBuf>) -> bool {
    let has_bus = variable("DBUS_SESSION_BUS_ADDRESS").is_some_and(|address| !address.as_os_str().is_empty())
        || variable("XDG_RUNTIME_DIR").is_some_and(|folder| folder.join("bus").exists());
    let has_display = ["DISPLAY", "WAYLAND_DISPLAY"]
        .iter()
        .any(|name| variable(name).is_some());
    let paths = variable("PATH").unwrap_or_default();
    has_bus || (has_display && std::env::split_paths(&paths).any(|folder| folder.join("zenity").exists()))
}

/// Adds the extension that selects a plan's format.
#[cfg(not(target_family = "wasm"))]
fn with_ending(purpose: Purpose, path: PathBuf) -> PathBuf {
    let [(_, [ending])] = purpose.formats() else {
        return path;
    };
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending)) {
        return path;
    }
    let mut named = path.into_os_string();
    named.push(".");
    named.push(ending);
    named.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_desktop_no_dialog_is_tried() {
        assert!(!is_possible(|_| None));
        assert!(!is_possible(|name| (name == "DISPLAY").then(|| PathBuf::from(":99"))));
        assert!(is_possible(
            |name| (name == "DBUS_SESSION_BUS_ADDRESS").then(|| "unix:path=/x".into())
        ));
        for error in [DialogError::NoDesktop, DialogError::NotOpened, DialogError::Ended] {
            assert!(error.to_string().contains("type the path into the field"), "{error}");
        }
    }

    /// Guards against a format that is read and not offered.
    #[test]
    fn every_format_of_label_volumes_is_offered() {
        let names = stylet_files::open::FORMATS.split(['(', ')', ',', ' ']);
        let endings: Vec<_> = names
            .filter(|name| name.starts_with('.'))
            .filter_map(|name| name.rsplit('.').next())
            .collect();
        assert!(endings.len() > 5, "{endings:?}");
        let (_, offered) = Purpose::Scene.formats()[0];
        assert!(endings.iter().all(|ending| offered.contains(ending)), "{endings:?}");
    }

    #[test]
    fn a_plan_is_saved_in_the_format_that_was_chosen() {
        let named = |purpose, path: &str| with_ending(purpose, PathBuf::from(path));
        assert_eq!(named(Purpose::SaveTable, "a/plan.v2"), Path::new("a/plan.v2.csv"));
        assert_eq!(named(Purpose::SaveRtPlan, "a/PLAN.DCM"), Path::new("a/PLAN.DCM"));
        assert_eq!(named(Purpose::Scene, "a/gland"), Path::new("a/gland"));
    }
}
