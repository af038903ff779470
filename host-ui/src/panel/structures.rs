//! The table of a label volume: a person names its structures before it becomes the scene.

use crate::action::{Action, StructuresAction};
use crate::panel::field::path_ui;
use crate::shown::{LoadState, Note, Shown};
use crate::theme;
use egui::{Align2, Button, ComboBox, DragValue, RichText, ScrollArea, TextEdit};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stylet_anatomy::{Organ, Role};
use stylet_base::format;
use stylet_files::scene::to_text;
use stylet_files::{Tissue, Voxels, bytes::file_name, role_and_material, voxels_per_label};
use stylet_shm_schema::MAX_STRUCTURES;

/// Limits of the stiffness in a scene file, kPa.
const STIFFNESS_KPA: [f64; 2] = [0.01, 1e8];

const NAME_WIDTH: f32 = 200.0;

/// What a label is in the procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Target,
    Spared,
    Tissue,
    Fixed,
    LeftOut,
}

impl Part {
    const ALL: [Self; 5] = [Self::Target, Self::Spared, Self::Tissue, Self::Fixed, Self::LeftOut];

    fn name(self) -> &'static str {
        match self {
            Self::Target => "target",
            Self::Spared => "spared",
            Self::Tissue => "tissue",
            Self::Fixed => "fixed",
            Self::LeftOut => "left out",
        }
    }

    fn meaning(self) -> &'static str {
        match self {
            Self::Target => "Seeds are planned in it",
            Self::Spared => "Needles and dose are kept from it",
            Self::Tissue => "Moves, and is neither aimed at nor spared",
            Self::Fixed => "Never moves, like bone",
            Self::LeftOut => "Not part of the body",
        }
    }
}

/// One label of the volume.
struct Row {
    label: u8,
    voxels: u64,
    name: String,
    part: Part,
    young_kpa: f64,
}

impl Row {
    fn of(label: u8, voxels: u64, name: String) -> Self {
        let (part, young_kpa) = guess(&name);
        Self {
            label,
            voxels,
            name,
            part,
            young_kpa,
        }
    }

    /// Takes role and stiffness of a name that is known; of another name they stay.
    fn rename(&mut self) {
        if Organ::of_name(&self.name).is_some() {
            (self.part, self.young_kpa) = guess(&self.name);
        }
    }

    fn tissue(&self) -> Option<Tissue> {
        let role = match self.part {
            Part::Target => Role::Target,
            Part::Spared => Role::Spare,
            Part::Tissue | Part::Fixed => Role::Tissue,
            Part::LeftOut => return None,
        };
        let (_, mut material) = role_and_material(&self.name);
        (material.young_pa, material.fixed) = (self.young_kpa * 1e3, self.part == Part::Fixed);
        Some(Tissue {
            label: self.label,
            name: self.name.trim().to_owned(),
            role,
            material,
        })
    }
}

fn guess(name: &str) -> (Part, f64) {
    let (role, material) = role_and_material(name);
    let part = match role {
        _ if material.fixed => Part::Fixed,
        Role::Target => Part::Target,
        Role::Spare => Part::Spared,
        Role::Tissue => Part::Tissue,
    };
    (part, material.young_pa * 1e-3)
}

/// Labels of a file, as they were read and as a person names them.
pub struct StructureTable {
    /// File of the volume.
    pub path: PathBuf,
    pub voxels: Arc<Voxels>,
    /// Image to show with the scene.
    pub image: Option<PathBuf>,
    rows: Vec<Row>,
    scene_path: String,
    note: Option<Note>,
}

impl StructureTable {
    /// Guesses role and stiffness of each label by its name in the file.
    pub fn of(path: PathBuf, voxels: Arc<Voxels>, image: Option<PathBuf>) -> Self {
        let name = |label| voxels.names.get(&label).cloned();
        let row = |(label, count)| Row::of(label, count, name(label).unwrap_or_else(|| format!("label {label}")));
        let rows = voxels_per_label(&voxels).into_iter().map(row).collect();
        let stem = file_name(&path);
        let stem = stem.split('.').next().unwrap_or_default();
        let scene_path = path.with_file_name(format!("{stem}.toml")).display().to_string();
        Self {
            path,
            voxels,
            image,
            rows,
            scene_path,
            note: None,
        }
    }

    /// Returns the structures, without labels that are left out.
    pub fn structures(&self) -> Vec<Tissue> {
        self.rows.iter().filter_map(Row::tissue).collect()
    }

    /// Saves the table as a new scene file; returns its path if it was written.
    pub fn save(&mut self) -> Option<String> {
        let path = PathBuf::from(self.scene_path.trim());
        // Beside the scene file, the volume's name is enough, and both can be moved together.
        let volume = match path.parent() == self.path.parent() {
            true => PathBuf::from(file_name(&self.path)),
            false => std::path::absolute(&self.path).unwrap_or_else(|_| self.path.clone()),
        };
        let saved = write_new(&path, &volume, &self.structures());
        let is_saved = saved.is_ok();
        self.note = Some(match saved {
            Ok(()) => Note::done(format!("Saved as {}: next time, load that file.", path.display())),
            Err(why) => Note::refusal(format!("{}: {why}", path.display())),
        });
        is_saved.then(|| self.scene_path.trim().to_owned())
    }

    /// Returns why the structures make no scene yet.
    fn missing(&self) -> Option<String> {
        let count = self.rows.iter().filter(|row| row.part != Part::LeftOut).count();
        if count > MAX_STRUCTURES {
            return Some(format!("{count} structures, at most {MAX_STRUCTURES}: leave some out."));
        }
        if self.rows.iter().any(|row| row.name.trim().is_empty()) {
            return Some("A structure has no name.".to_owned());
        }
        let has_target = self.rows.iter().any(|row| row.part == Part::Target);
        (!has_target).then(|| "Choose the target: the structure that the seeds are planned in.".to_owned())
    }
}

/// Never replaces a file: another scene file may stand beside the volume.
fn write_new(path: &Path, volume: &Path, structures: &[Tissue]) -> Result<(), Box<dyn std::error::Error>> {
    let text = to_text(volume, structures)?;
    let mut file = File::create_new(path)?;
    Ok(file.write_all(text.as_bytes())?)
}

/// Draws the table, unless its file is being read or sent.
pub fn structures_ui(ctx: &egui::Context, shown: &Shown, table: &mut StructureTable) -> Option<Action> {
    if shown.load.is_busy() {
        return None;
    }
    let screen = ctx.content_rect().size();
    let mut action = None;
    egui::Window::new(format!("Structures of {}", file_name(&table.path)))
        .id(egui::Id::unique("structures of a file"))
        .anchor(Align2::CENTER_TOP, [0.0, (screen.y / 10.0).min(90.0)])
        .max_size(screen - egui::vec2(24.0, 24.0))
        .collapsible(false)
        .resizable(false)
        .show(ctx, |ui| {
            ui.set_min_width(560.0_f32.min(screen.x - 60.0));
            ui.label(theme::weak(
                "Name each label. Prostate, Urethra, Rectum, Bladder and other TG-263 names set role and stiffness.",
            ));
            let height = (screen.y - 330.0).clamp(80.0, 480.0);
            let scroll = ScrollArea::both().max_height(height).auto_shrink([false, true]);
            scroll.show(ui, |ui| rows_ui(ui, &mut table.rows));
            ui.separator();
            action = foot_ui(ui, shown, table);
        });
    action.map(Action::Structures)
}

fn rows_ui(ui: &mut egui::Ui, rows: &mut [Row]) {
    let grid = egui::Grid::new("labels").num_columns(5).striped(true);
    grid.spacing([14.0, 4.0]).show(ui, |ui| {
        theme::heads(ui, ["label", "voxels", "name", "role", "stiffness"]);
        for row in rows {
            let label = ui.label(row.label.to_string());
            ui.label(theme::small(format::count(row.voxels)));
            let name = ui.add_sized([NAME_WIDTH, 22.0], TextEdit::singleline(&mut row.name));
            if name.labelled_by(label.id).changed() {
                row.rename();
            }
            let role = ComboBox::from_id_salt(row.label)
                .selected_text(row.part.name())
                .width(84.0);
            let role = role.show_ui(ui, |ui| {
                for part in Part::ALL {
                    let choice = ui.selectable_value(&mut row.part, part, part.name());
                    choice.on_hover_text(part.meaning());
                }
            });
            role.response.labelled_by(label.id);
            let [least, most] = STIFFNESS_KPA;
            let stiffness = DragValue::new(&mut row.young_kpa)
                .range(least..=most)
                .speed(0.1)
                .max_decimals(2)
                .suffix(" kPa");
            ui.add_enabled(row.part != Part::LeftOut, stiffness)
                .on_hover_text("Young's modulus");
            ui.end_row();
        }
    });
}

fn foot_ui(ui: &mut egui::Ui, shown: &Shown, table: &mut StructureTable) -> Option<StructuresAction> {
    let tokens = theme::of(ui);
    let missing = table.missing();
    let is_whole = missing.is_none();
    ui.label(match &missing {
        Some(why) => RichText::new(why).color(tokens.warn),
        None => theme::weak("These structures make a scene."),
    });
    let mut action = None;
    ui.horizontal_wrapped(|ui| {
        let can = is_whole && shown.is_live() && !shown.running;
        if ui.add_enabled(can, Button::new("Use these structures")).clicked() {
            action = Some(StructuresAction::Use);
        }
        if ui.button("Cancel").clicked() {
            action = Some(StructuresAction::Close);
        }
    });
    ui.horizontal_wrapped(|ui| {
        let label = ui.label(theme::weak("Scene file"));
        let field = path_ui(ui, "new scene file", &mut table.scene_path, "a new .toml file", 260.0);
        field.labelled_by(label.id);
        let can = is_whole && !table.scene_path.trim().is_empty();
        if ui.add_enabled(can, Button::new("Save scene file")).clicked() {
            action = Some(StructuresAction::Save);
        }
    });
    let refused = match &shown.load {
        LoadState::Refused(why) => Some((true, why)),
        _ => None,
    };
    if let Some((refused, text)) = refused.or(table.note.as_ref().map(|note| (note.refused, &note.text))) {
        let color = if refused { tokens.bad } else { tokens.good };
        ui.label(RichText::new(text).color(color));
    }
    action
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use std::collections::BTreeMap;
    use stylet_files::{LabelVolume, Progress, VoxelFrame, scene};

    fn voxels() -> Voxels {
        Voxels {
            dims: [8, 8, 8],
            labels: (0..512_u16).map(|n| (n / 128) as u8).collect(),
            frame: VoxelFrame {
                directions: Matrix3::identity(),
                spacing_m: [1e-3; 3],
                origin_m: Vector3::zeros(),
                warning: None,
            },
            names: BTreeMap::from([(2, "Rectum".to_owned())]),
            also: Vec::new(),
            overlap: None,
        }
    }

    #[test]
    fn a_known_name_sets_role_and_stiffness_and_another_keeps_them() {
        let mut table = StructureTable::of("gland.nii.gz".into(), Arc::new(voxels()), None);
        let parts: Vec<Part> = table.rows.iter().map(|row| row.part).collect();
        assert_eq!(parts, [Part::Tissue, Part::Spared, Part::Tissue]);
        assert!(table.missing().is_some_and(|why| why.contains("target")));
        table.rows[0].name = "Prostate".to_owned();
        table.rows[0].rename();
        assert_eq!((table.rows[0].part, table.rows[0].young_kpa), (Part::Target, 17.0));
        assert_eq!(table.missing(), None);
        table.rows[0].young_kpa = 25.0;
        table.rows[0].name = "Gewebe 1".to_owned();
        table.rows[0].rename();
        assert_eq!((table.rows[0].part, table.rows[0].young_kpa), (Part::Target, 25.0));
        table.rows[0].name.clear();
        assert!(table.missing().is_some_and(|why| why.contains("no name")));
    }

    #[test]
    fn the_saved_scene_file_is_the_table_and_replaces_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("gland.nrrd");
        stylet_files::convert::write_labels(&voxels(), &path, None).expect("written");
        let mut table = StructureTable::of(path.clone(), Arc::new(voxels()), None);
        for (row, name) in table
            .rows
            .iter_mut()
            .zip(["Próstata \"links\"", "Rectum", "Pubic arch"])
        {
            row.name = name.to_owned();
            row.rename();
        }
        (table.rows[0].part, table.rows[0].young_kpa) = (Part::Target, 12.5);
        let saved = table.save().expect("written");
        let (_, loaded) = scene::load(Path::new(&saved), &Progress::default()).expect("read");
        let used = LabelVolume::from_tissues(&voxels(), table.structures(), String::new(), &Progress::default());
        assert_eq!(loaded.structures, used.expect("a volume").structures);
        assert_eq!(loaded.structures.len(), 3);
        assert!(loaded.structures[2].material.fixed);
        let before = std::fs::read(&saved).expect("read");
        table.rows[2].part = Part::LeftOut;
        assert_eq!(table.save(), None);
        assert_eq!(std::fs::read(&saved).expect("read"), before);
        table.scene_path = folder.path().join("two.toml").display().to_string();
        let saved = table.save().expect("written");
        let (_, loaded) = scene::load(Path::new(&saved), &Progress::default()).expect("read");
        assert_eq!(loaded.structures.len(), 2);
    }
}
