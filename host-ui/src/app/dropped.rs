//! Recordings that are dropped onto the page. A browser hands over their bytes, never their paths, and not at once.

use super::App;
use super::watch::{Read, WatchError};
use crate::action::Action;
use egui::{Context, DroppedFileHandle};
use stylet_base::interrupt::Interrupt;
use stylet_base::job::Job;
use stylet_host::link::played_of;

impl App {
    /// Begins to read a dropped file; its recording is shown as any other.
    pub(super) fn dropped_file(&mut self, ctx: &Context) -> Option<Action> {
        let file = ctx.input(|i| i.raw.dropped_files.first().cloned())?;
        if self.run.is_some() || self.shown.is_engaged() && !self.watches() {
            self.refuse("Stop the needles and turn the force off first, then drop a recording.");
            return None;
        }
        let name = file.path().display().to_string();
        self.recording.begin(name.clone(), read(file, name, ctx.clone()));
        None
    }
}

/// Names the page after its recording, as the tab shows it.
pub(super) fn name_page(recording: &str) {
    if let Some(document) = web_sys::window().and_then(|window| window.document()) {
        document.set_title(&format!("{recording} - Stylet"));
    }
}

fn read(file: DroppedFileHandle, name: String, ctx: Context) -> Read {
    let (answer, job) = Job::elsewhere();
    wasm_bindgen_futures::spawn_local(async move {
        let read = match file.bytes_async().await {
            Ok(bytes) => played_of(&bytes, &Interrupt::default()).map_err(|why| why.to_string()),
            Err(why) => Err(why),
        };
        // Another file may have been dropped meanwhile; this one is then dropped.
        let _ = answer.send(read.map_err(|why| WatchError::Dropped(name, why)));
        ctx.request_repaint();
    });
    job
}
