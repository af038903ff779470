//! Builds scenes on a separate thread; the running scene stays until the next one is ready.

use crate::background;
use crate::rt::exchange::Ticket;
use std::sync::mpsc;
use stylet_anatomy::PatientFrame;
use stylet_shm_schema::{Refusal, RefusalCode};
use stylet_sim::scene::{Scene, SceneSource};

/// A requested scene.
pub struct Wanted {
    pub ticket: Ticket,
    pub name: String,
    pub patient: PatientFrame,
}

/// A scene that the thread has built, or the error.
pub struct Loaded {
    pub wanted: Wanted,
    pub scene: Result<(Box<Scene>, SceneSource), Refusal>,
}

/// Builds one scene at a time.
pub struct SceneLoader {
    busy: bool,
    sender: mpsc::Sender<Loaded>,
    loaded: mpsc::Receiver<Loaded>,
}

impl Default for SceneLoader {
    fn default() -> Self {
        let (sender, loaded) = mpsc::channel();
        Self {
            busy: false,
            sender,
            loaded,
        }
    }
}

impl SceneLoader {
    /// Starts to build `wanted`, unless another scene is being built.
    pub fn begin(
        &mut self,
        wanted: Wanted,
        build: impl FnOnce() -> Result<(Scene, SceneSource), Refusal> + Send + 'static,
    ) -> Result<(), Refusal> {
        if self.busy {
            return Err(RefusalCode::SceneLoading.into());
        }
        let sender = self.sender.clone();
        let work = move || {
            let scene = build().map(|(scene, source)| (Box::new(scene), source));
            let _ = sender.send(Loaded { wanted, scene });
        };
        let thread = background::spawn("scene-loader", work);
        thread.map_err(|_| Refusal::new(RefusalCode::Internal, "no thread could be started to load the scene"))?;
        self.busy = true;
        Ok(())
    }

    /// Returns a scene finished since the last call.
    pub fn take(&mut self) -> Option<Loaded> {
        let loaded = self.loaded.try_recv().ok()?;
        self.busy = false;
        Some(loaded)
    }
}
