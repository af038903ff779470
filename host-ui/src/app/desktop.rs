//! What a window does in a desktop alone: it leaves a processor core to the force loop, and saves pictures.

use super::App;
use crate::shown::Note;

impl App {
    /// Takes what the started core, and the pictures, have come to.
    pub(super) fn take_desktop(&mut self) {
        self.leave_core();
        self.take_core();
        self.take_pictures();
    }

    /// Leaves the force loop's processor core to it.
    fn leave_core(&mut self) {
        if self.watches() {
            return;
        }
        if let Some(session) = &self.shown.session {
            self.left_core.leave(session);
        }
    }

    fn take_pictures(&mut self) {
        match self.pictures.poll() {
            None => {}
            Some(Ok(path)) => self.shown.note = Some(Note::done(format!("Picture saved as {}", path.display()))),
            Some(Err(why)) => self.refuse(why),
        }
    }
}
