//! Files of the scene, and those that are chosen in a dialog.

use super::App;
use crate::action::{Action, PlanAction, StructuresAction, WatchAction};
use crate::dialog::Purpose;
use crate::panel::structures::StructureTable;
use crate::panel::workflow::Progress;
use crate::recent;
use crate::shown::LoadState;
use std::path::PathBuf;
use std::sync::Arc;
use stylet_files::{Image, Voxels};
use stylet_host::core_args::SceneChoice;
use stylet_shm_schema::{SceneHeader, SceneId};

/// Files of the scene, from their names to the core.
#[derive(Default)]
pub(super) struct SceneFiles {
    pub label: Option<u8>,
    /// Scene from the command line, until it is read.
    pub first_scene: Option<SceneChoice>,
    pub first_image: Option<PathBuf>,
    pub uploading: Option<(u64, String)>,
    /// True from the sending of a scene until it runs: its needle begins outside.
    pub begins_outside: bool,
    pub going_outside: Going,
    /// Table of the structures of the file that was read last, until the core has them.
    pub structures: Option<StructureTable>,
    /// File that is being read or sent as the next scene, and file of the present scene if this
    /// window sent it.
    pub scene_to_come: Option<SentScene>,
    pub scene_file: Option<SentScene>,
    /// Image to show once the scene of this name is loaded.
    pub image_to_come: Option<(Image, String)>,
}

/// Way of the needle out of a scene that was loaded, until the operator does something.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Going {
    #[default]
    No,
    Due,
    Sent,
}

/// File that this window reads and sends as a scene.
#[derive(Clone)]
pub(super) struct SentScene {
    pub path: PathBuf,
    /// Name of the scene, once it is read.
    pub name: String,
    /// Scene that the core had when this one was sent.
    pub after: Option<SceneId>,
}

impl SentScene {
    /// Returns whether a scene of the core is this one: of its name, and the next after the one before.
    ///
    /// The name alone does not tell: files of two patients are often called alike.
    pub fn is(&self, scene: &SceneHeader) -> bool {
        let next = self.after.is_some_and(|after| {
            let generation = after.generation + 1;
            scene.id() == SceneId { generation, ..after }
        });
        next && scene.name.read() == self.name
    }
}

impl App {
    pub(super) fn pick_file(&mut self, purpose: Purpose) {
        let beside = match purpose {
            Purpose::Scene | Purpose::Image | Purpose::Recording => &self.workflow.scene_path,
            _ => &self.workflow.plan.path,
        };
        self.dialogs.begin(purpose, beside);
    }

    /// Returns the action for the file of a dialog that was closed.
    pub(super) fn picked_file(&mut self) -> Option<Action> {
        let (purpose, picked) = self.dialogs.poll()?;
        let path = match picked {
            Ok(path) => path?,
            Err(why) => {
                self.refuse(format!("{}: {why}", purpose.title()));
                return None;
            }
        };
        let typed = path.display().to_string();
        Some(match purpose {
            Purpose::Scene => {
                self.workflow.scene_path = typed;
                Action::LoadScene(path)
            }
            Purpose::Image => Action::LoadImage(path),
            Purpose::Recording => Action::Watch(WatchAction::File(path)),
            Purpose::ImportPlan => {
                self.workflow.plan.path = typed;
                Action::Plan(PlanAction::Import(path))
            }
            Purpose::SavePlan | Purpose::SaveTable | Purpose::SaveRtPlan => {
                self.workflow.plan.path = typed;
                // The desktop's dialog asked.
                self.workflow.plan.own_file = Some(path.clone());
                Action::Plan(PlanAction::Export(path))
            }
        })
    }

    /// Shows the labels of the file that was read as a table.
    pub(super) fn name_structures(&mut self, voxels: Arc<Voxels>, image: Option<PathBuf>) {
        self.shown.load = LoadState::Idle;
        let file = self.files.scene_to_come.as_ref();
        self.files.structures = file.map(|file| StructureTable::of(file.path.clone(), voxels, image));
    }

    pub(super) fn act_on_structures(&mut self, action: StructuresAction) {
        let Some(table) = &mut self.files.structures else {
            return;
        };
        match action {
            StructuresAction::Use => {
                self.files.scene_to_come = Some(SentScene {
                    path: table.path.clone(),
                    name: String::new(),
                    after: None,
                });
                let (voxels, image) = (table.voxels.clone(), table.image.clone());
                self.loader
                    .begin_structures(&table.path, voxels, table.structures(), image);
            }
            StructuresAction::Save => {
                if let Some(path) = table.save() {
                    recent::remember(&mut self.settings.recent, path, false);
                }
            }
            StructuresAction::Close => self.files.structures = None,
        }
    }

    /// Returns the action for a dropped file. A folder is an image series; while the plan's step is
    /// open, a file that is not a volume is a plan.
    pub(super) fn dropped_file(&self, ctx: &egui::Context) -> Option<Action> {
        let path = ctx.input(|i| {
            i.raw
                .dropped_files
                .iter()
                .map(|f| f.path().to_owned())
                .find(|p| !p.as_os_str().is_empty())
        })?;
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")) {
            return Some(Action::Watch(WatchAction::File(path)));
        }
        if path.is_dir() {
            return Some(Action::LoadImage(path));
        }
        let is_plan = ["toml", "csv", "dcm"]
            .iter()
            .any(|ending| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending)));
        Some(match is_plan && self.workflow.is_open(Progress::Plan) {
            true => Action::Plan(PlanAction::Import(path)),
            false => Action::LoadScene(path),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_shm_schema::Text;

    /// The file of a scene used to be known by its name: after another window had loaded `rs.dcm` of another patient,
    /// plans and studies were written with the patient and the contours of the own `rs.dcm`.
    #[test]
    fn a_scene_of_the_same_name_is_not_the_own_one() {
        let mut scene = SceneHeader {
            session_id: 7,
            generation: 3,
            name: Text::new("rs.dcm"),
            ..SceneHeader::default()
        };
        let own = SentScene {
            path: "p1/rs.dcm".into(),
            name: "rs.dcm".to_owned(),
            after: Some(SceneId {
                session_id: 7,
                generation: 2,
            }),
        };
        assert!(own.is(&scene));
        scene.generation = 4;
        assert!(!own.is(&scene), "loaded by another window");
        (scene.session_id, scene.generation) = (8, 3);
        assert!(!own.is(&scene), "of another core");
        (scene.session_id, scene.name) = (7, Text::new("other.dcm"));
        assert!(!own.is(&scene));
        assert!(!SentScene { after: None, ..own }.is(&scene));
    }
}
