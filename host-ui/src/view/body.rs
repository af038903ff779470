//! Present positions of the scene's drawn surfaces and displacements of its tissue, once a frame for all pictures.

use std::sync::Arc;
use stylet_base::job::spawn;
use stylet_host::link::{SceneModel, Snapshot};
use stylet_shm_schema::SceneId;
use stylet_surfaces::bodies::Bodies;
use stylet_surfaces::field::Field;

/// Surfaces of the scene at the last snapshot.
#[derive(Default)]
pub struct ShownBody {
    /// Scene that is shown; `None` before the first one.
    pub model: Option<Arc<SceneModel>>,
    scene: Option<SceneId>,
    /// Scene whose surfaces a thread makes, or has made.
    making: Option<SceneId>,
    snapshot: Option<(u64, u64)>,
    /// Positions of the elements at the surface of the lattice.
    elements_m: Vec<[f32; 3]>,
    /// Present positions of the vertices, and a number that grows whenever they move.
    pub positions_m: Vec<[f32; 3]>,
    pub moved: u64,
    /// Displacements in the last snapshot, and a number that grows whenever they change.
    pub field: Field,
    pub stirred: u64,
}

impl ShownBody {
    /// Takes the data that arrived since the last frame. A new scene is shown once a thread has
    /// made its surfaces.
    pub fn take(&mut self, model: Option<&Arc<SceneModel>>, snapshot: Option<&Snapshot>) {
        let Some(model) = model else { return };
        let Some(bodies) = model.bodies_made() else {
            return self.make(model);
        };
        if self.scene != Some(model.header.id()) {
            self.scene = Some(model.header.id());
            self.model = Some(model.clone());
            self.snapshot = None;
            self.elements_m.clone_from(&model.rest_m);
            self.positions_m.clone_from(&bodies.rest_m);
            self.moved += 1;
            self.field = Field::rest(model.header.nodes);
            self.stirred += 1;
        }
        let Some(snapshot) = snapshot else { return };
        let key = (snapshot.header.session_id, snapshot.header.tissue_tick);
        if self.snapshot == Some(key) || snapshot.positions_m.len() != model.rest_m.len() {
            return;
        }
        self.snapshot = Some(key);
        if let Some(field) = Field::of(model.header.nodes, &snapshot.displacements_m)
            && field != self.field
        {
            self.field = field;
            self.stirred += 1;
        }
        // Tissue at rest is also sent 200 times a second.
        if self.elements_m != snapshot.positions_m {
            self.elements_m.clone_from(&snapshot.positions_m);
            bodies.deformed(&model.rest_m, &self.elements_m, &mut self.positions_m);
            self.moved += 1;
        }
    }

    fn make(&mut self, model: &Arc<SceneModel>) {
        if self.making == Some(model.header.id()) {
            return;
        }
        self.making = Some(model.header.id());
        let made = Arc::clone(model);
        let making = spawn("surfaces", move || {
            made.bodies();
        });
        if making.is_err() {
            // Without a thread a frame must wait.
            model.bodies();
        }
    }

    /// Returns the surfaces at rest; `None` before the first scene.
    pub fn bodies(&self) -> Option<&Bodies> {
        self.model.as_ref().map(|model| model.bodies())
    }
}
