//! A recording in the window instead of a core: everything is shown as it was, and nothing can be
//! moved.

use super::App;
use crate::action::WatchAction;
use crate::planner::Planner;
use crate::shown::{Note, Watched};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use stylet_base::job::{Job, JobUpdate};
use stylet_host::link::{Link, Played, RecordingError, ShowError, played, played_of};

/// Insertion of one needle through the gland of `paper`, recorded by `make example`.
pub(super) const EXAMPLE: &[u8] = include_bytes!("../../example/insertion.mcap");
const EXAMPLE_NAME: &str = "Example";
/// Speed of the example, whose insertion takes four seconds.
const EXAMPLE_SPEED: f64 = 0.25;

/// Reading of a recording; the text of an error follows the name of the file.
pub(super) type Read = Job<Result<Played, WatchError>>;

/// Reason why a recording is not shown.
#[derive(Debug, thiserror::Error)]
pub(super) enum WatchError {
    #[error(transparent)]
    File(#[from] RecordingError),
    #[error("the example: {0}")]
    Example(#[from] ShowError),
    #[cfg(target_family = "wasm")]
    #[error("{0}: {1}")]
    Dropped(String, String),
    #[error("the reader ended before the file was read")]
    Ended,
}

/// Recording that is being read or shown.
#[derive(Default)]
pub(super) struct Recording {
    reading: Option<(String, Read)>,
    name: String,
    /// Planner of the core, kept until the recording is closed.
    planner: Option<Planner>,
}

impl Recording {
    /// Creates a state whose file is read as soon as the window opens.
    pub(super) fn beginning_with(file: Option<PathBuf>) -> Self {
        let mut recording = Self::default();
        if let Some(path) = file {
            recording.read(&path);
        }
        recording
    }

    fn read(&mut self, path: &Path) {
        let name = path
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let path = path.to_owned();
        let job = Job::begin("recording", move |answer, interrupt| {
            // The window may have closed; the answer is then dropped. The same holds below.
            let _ = answer.send(played(&path, interrupt).map_err(WatchError::from));
        });
        self.reading = Some((name, job));
    }

    /// Shows what `reading` reads, once it is read.
    #[cfg(target_family = "wasm")]
    pub(super) fn begin(&mut self, name: String, reading: Read) {
        self.reading = Some((name, reading));
    }

    fn read_example(&mut self) {
        let job = Job::begin("example", |answer, interrupt| {
            let _ = answer.send(played_of(EXAMPLE, interrupt).map_err(WatchError::from));
        });
        self.reading = Some((EXAMPLE_NAME.to_owned(), job));
    }
}

impl App {
    /// Returns whether a recording is shown instead of a core.
    pub(super) fn watches(&self) -> bool {
        self.link.playback().is_some()
    }

    pub(super) fn act_on_recording(&mut self, action: WatchAction) {
        match action {
            WatchAction::Example | WatchAction::File(_) if self.run.is_some() => {
                self.refuse("Stop the needles first, then open a recording.");
            }
            // Its keys would no longer reach the core.
            WatchAction::Example | WatchAction::File(_) if self.shown.is_engaged() && !self.watches() => {
                let why = "Turn the force off first (key D), then open a recording.";
                self.refuse(why);
            }
            WatchAction::Example => self.recording.read_example(),
            WatchAction::File(path) => self.recording.read(&path),
            WatchAction::Hold(held) => self.link.playback().into_iter().for_each(|p| p.hold(held)),
            WatchAction::Jump(to_s) => self.link.playback().into_iter().for_each(|p| p.jump(to_s)),
            WatchAction::Speed(speed) => self.link.playback().into_iter().for_each(|p| p.play_at(speed)),
            WatchAction::Close => self.close_recording(),
        }
    }

    /// Takes the state of the recording, once it is read.
    pub(super) fn take_recording(&mut self) {
        let Some((name, job)) = &self.recording.reading else {
            return self.show_recording();
        };
        let (name, read) = match job.poll() {
            JobUpdate::Pending => return self.show_recording(),
            JobUpdate::Message(read) => (name.clone(), read),
            JobUpdate::Ended => (name.clone(), Err(WatchError::Ended)),
        };
        self.recording.reading = None;
        match read {
            Ok(played) => self.open_recording(name, played),
            Err(why) => self.refuse(why),
        }
        self.show_recording();
    }

    fn open_recording(&mut self, name: String, played: Played) {
        let cut_off = |why: &String| Note::done(format!("{name} is shown up to its first error: {why}"));
        self.shown.note = played.cut_off.as_ref().map(cut_off);
        self.change_link(|instance| Link::playing(instance, Arc::new(played)));
        if name == EXAMPLE_NAME {
            self.link.playback().into_iter().for_each(|p| p.play_at(EXAMPLE_SPEED));
        }
        #[cfg(target_family = "wasm")]
        super::dropped::name_page(&name);
        self.recording.name = name;
        let planner = std::mem::take(&mut self.planner);
        self.recording.planner.get_or_insert(planner);
    }

    fn close_recording(&mut self) {
        if !self.watches() {
            return;
        }
        let home = Rc::clone(&self.home);
        self.change_link(|instance| home(instance));
        if let Some(planner) = self.recording.planner.take() {
            self.planner = planner;
        }
    }

    /// Changes the link and discards everything that belongs to the previous core or recording.
    pub(super) fn change_link(&mut self, make: impl FnOnce(stylet_shm_schema::Instance) -> Link) {
        self.link = make(self.link.instance().clone());
        self.waiting.clear();
        self.parameters.forget();
        self.drive = Default::default();
        (self.shown.run_step, self.shown.run_needle) = (None, None);
    }

    fn show_recording(&mut self) {
        self.shown.reads_recording = self.recording.reading.is_some();
        self.shown.watched = self.link.playback().map(|playback| Watched {
            name: self.recording.name.clone(),
            at_s: playback.at_s(),
            length_s: playback.length_s(),
            is_held: playback.is_held(),
            speed: playback.speed(),
            marks: playback.marks(),
            has_ended: playback.has_ended(),
        });
    }
}
