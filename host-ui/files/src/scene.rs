//! Scene files (TOML): a volume, materials of its structures, needle, device and plan. All wrong values are reported at
//! once.

mod write;

use super::bytes::{file_name, whole};
use super::error::FileError;
use super::open::read_voxels;
use super::progress::Progress;
use super::volume::{LabelVolume, Tissue, Voxels, role_and_material};
use crate::error::ContentError;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use stylet_anatomy::{Beyond, Layer, Material, Role, Surroundings};
use stylet_base::input::has_ending;
pub use write::to_text;

const MAX_BYTES: usize = 1 << 20;
const MAX_STRUCTURES: usize = 255;

/// Content of a scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// Name of the scene.
    pub name: Option<String>,
    /// Path of the volume, relative to the scene file.
    pub volume: PathBuf,
    /// Path of an image of the same patient, for the slices of the window, relative to the scene
    /// file.
    pub image: Option<PathBuf>,
    /// Structures; if empty, those named in the volume.
    structures: Vec<Part>,
    /// Layers around the body, the innermost first.
    pub layers: Vec<Layer>,
    /// Speed of insertion, in m/s.
    pub insert_m_per_s: Option<f64>,
    /// Speed of retraction, in m/s.
    pub retract_m_per_s: Option<f64>,
    /// Name of the haptic device.
    pub device: Option<String>,
    /// Path of a plan, relative to the scene file.
    pub plan: Option<PathBuf>,
}

/// Structure of the scene; omitted fields are inferred from its name.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Part {
    /// Label by which it is found in the volume.
    label: Option<u8>,
    /// Name by which it is found in the volume.
    name: Option<String>,
    /// Name in the scene instead of that in the volume.
    called: Option<String>,
    role: Option<Aim>,
    young_kpa: Option<f64>,
    poisson: Option<f64>,
    /// Shortest and longest link as a share of the length at rest.
    stretch: Option<[f64; 2]>,
    shear_deg: Option<f64>,
    /// True if it never moves.
    fixed: Option<bool>,
    surroundings: Option<Support>,
}

/// Role of a structure by its word in the file.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Aim {
    Target,
    Spare,
    Tissue,
    #[serde(rename = "leave out")]
    LeftOut,
}

/// Support at the outside of the body: one word for all faces, or six for those towards -x, +x, -y, +y, -z, +z.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "must be a word, or a list of six words")]
enum Support {
    All(String),
    Faces([String; 6]),
}

impl Support {
    fn surroundings(&self) -> Option<Surroundings> {
        let faces = match self {
            Self::All(word) => return Beyond::of_name(word).map(Surroundings::all),
            Self::Faces(words) => words.iter().map(|word| Beyond::of_name(word)),
        };
        let faces: Option<Vec<Beyond>> = faces.collect();
        faces.and_then(|faces| faces.try_into().ok()).map(Surroundings)
    }
}

/// Content of a scene file in its tables.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Tables {
    name: Option<String>,
    volume: Referred,
    image: Option<Referred>,
    #[serde(default)]
    structure: Vec<Part>,
    #[serde(default)]
    layer: Vec<Around>,
    #[serde(default)]
    needle: Speeds,
    device: Option<Device>,
    plan: Option<Referred>,
}

/// Layer of soft tissue around the body.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Around {
    thickness_mm: f64,
    young_kpa: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Referred {
    file: PathBuf,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Speeds {
    insert_mm_per_s: Option<f64>,
    retract_mm_per_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Device {
    name: String,
}

/// Returns whether a file is a scene file, the only format here that is recognised by its name.
pub fn is_scene(path: &Path) -> bool {
    has_ending(path, "toml")
}

/// Reads a scene file.
pub fn read(path: &Path) -> Result<SceneFile, FileError> {
    let refused = |why: ContentError| FileError::of(path, why);
    let bytes = whole(path, &Progress::default()).map_err(refused)?;
    if bytes.len() > MAX_BYTES {
        return Err(refused(
            format!("it has {} bytes; a scene file has a few thousand", bytes.len()).into(),
        ));
    }
    let text = std::str::from_utf8(&bytes).map_err(|_| refused("it is not text (UTF-8)".into()))?;
    parse(text).map_err(refused)
}

/// Loads the volume of a scene file, with the structures that the file defines.
pub fn load(path: &Path, progress: &Progress) -> Result<(SceneFile, LabelVolume), FileError> {
    let scene = read(path)?;
    let layers = scene.layers.clone();
    let path_of_volume = path.with_file_name(&scene.volume);
    let voxels = read_voxels(&path_of_volume, progress)?;
    let name = scene.name.clone().unwrap_or_else(|| file_name(path));
    let refused = |why: ContentError| FileError::of(path, why);
    let tissues = scene.tissues(&voxels).map_err(refused)?;
    let volume = LabelVolume::from_tissues(&voxels, tissues, name, progress).map_err(refused)?;
    Ok((scene, LabelVolume { layers, ..volume }))
}

/// Parses the text of a scene file.
pub fn parse(text: &str) -> Result<SceneFile, ContentError> {
    let tables: Tables = toml::from_str(text).map_err(|e| format!("it is not a valid scene file: {e}"))?;
    let mut problems = Vec::new();
    let mut check = |name: &str, value: Option<f64>, least: f64, most: f64| {
        if value.is_some_and(|v| !(least..=most).contains(&v)) {
            problems.push(format!("{name} must be a number from {least} to {most}"));
        }
    };
    let Speeds {
        insert_mm_per_s,
        retract_mm_per_s,
    } = tables.needle;
    check("[needle] insert_mm_per_s", insert_mm_per_s, 0.1, 500.0);
    check("[needle] retract_mm_per_s", retract_mm_per_s, 0.1, 500.0);
    if tables.structure.len() > MAX_STRUCTURES {
        problems.push(format!("it has more than {MAX_STRUCTURES} structures"));
    }
    for (part, number) in tables.structure.iter().zip(1..) {
        problems.extend(part.problems().map(|why| format!("[[structure]] {number}: {why}")));
    }
    let [[thin, thick], [soft, stiff]] = [Layer::THICKNESS_M.map(|m| m * 1e3), Layer::YOUNG_PA.map(|pa| pa * 1e-3)];
    for (layer, number) in tables.layer.iter().zip(1..) {
        let mut check = |name: &str, value: f64, least: f64, most: f64| {
            if !(least..=most).contains(&value) {
                problems.push(format!(
                    "[[layer]] {number}: {name} must be a number from {least} to {most}"
                ));
            }
        };
        check("thickness_mm", layer.thickness_mm, thin, thick);
        check("young_kpa", layer.young_kpa, soft, stiff);
    }
    if tables.layer.len() > Layer::MOST {
        problems.push(format!("it has more than {} layers", Layer::MOST));
    }
    ContentError::all(problems)?;
    let layers: Vec<Layer> = tables.layer.iter().map(Around::layer).collect();
    Ok(SceneFile {
        layers: if layers.is_empty() { vec![Layer::FAT] } else { layers },
        name: tables.name,
        volume: tables.volume.file,
        image: tables.image.map(|image| image.file),
        structures: tables.structure,
        insert_m_per_s: insert_mm_per_s.map(|v| v * 1e-3),
        retract_m_per_s: retract_mm_per_s.map(|v| v * 1e-3),
        device: tables.device.map(|device| device.name),
        plan: tables.plan.map(|plan| plan.file),
    })
}

impl SceneFile {
    /// Returns the tissue of each label of the volume, without labels that no structure names.
    fn tissues(&self, voxels: &Voxels) -> Result<Vec<Tissue>, ContentError> {
        if self.structures.is_empty() {
            return Ok(super::volume::by_name(voxels));
        }
        let mut problems = Vec::new();
        let mut tissues: Vec<Tissue> = Vec::new();
        for (part, number) in self.structures.iter().zip(1..) {
            match part.find(voxels) {
                Err(why) => problems.push(format!("[[structure]] {number}: {why}")),
                Ok(label) if tissues.iter().any(|t| t.label == label) => {
                    problems.push(format!("[[structure]] {number}: label {label} has a structure already"));
                }
                Ok(label) => tissues.extend(part.tissue(label, voxels)),
            }
        }
        ContentError::all(problems)?;
        if tissues.is_empty() {
            return Err("all structures are left out".into());
        }
        Ok(tissues)
    }
}

impl Around {
    fn layer(&self) -> Layer {
        Layer {
            thickness_m: self.thickness_mm * 1e-3,
            young_pa: self.young_kpa * 1e3,
        }
    }
}

impl Part {
    /// Returns what is wrong with its values.
    fn problems(&self) -> impl Iterator<Item = &'static str> {
        let within = |value: Option<f64>, least: f64, most: f64| value.is_none_or(|v| (least..=most).contains(&v));
        let [short, long] = self.stretch.unwrap_or([0.5, 2.0]);
        let rules = [
            (
                self.label.is_some() != self.name.is_some(),
                "give either label or name: by which the structure is found in the volume; its own name is \"called\"",
            ),
            (self.label != Some(0), "label must be a number from 1 to 255"),
            (
                within(self.young_kpa, 0.01, 1e8),
                "young_kpa must be a number from 0.01 to 100000000",
            ),
            (
                within(self.poisson, 0.0, Material::MAX_POISSON),
                "poisson must be a number from 0 to just below 0.5",
            ),
            (
                self.stretch.is_some() == self.shear_deg.is_some(),
                "stretch and shear_deg belong together: give both or none",
            ),
            (
                (0.01..1.0).contains(&short) && long > 1.0 && long <= 100.0,
                "stretch must be [below 1, above 1]: shortest and longest as a share of the length at rest",
            ),
            (
                within(self.shear_deg, 0.1, 89.0),
                "shear_deg must be a number from 0.1 to 89",
            ),
            (
                self.surroundings
                    .as_ref()
                    .is_none_or(|words| words.surroundings().is_some()),
                "surroundings must be \"fat\", \"free\" or \"fixed\", or a list of six of them",
            ),
        ];
        rules.into_iter().filter(|(holds, _)| !holds).map(|(_, why)| why)
    }

    fn find(&self, voxels: &Voxels) -> Result<u8, ContentError> {
        if let Some(label) = self.label {
            let is_there = voxels.labels.contains(&label);
            return is_there
                .then_some(label)
                .ok_or_else(|| format!("the volume has no voxel with label {label}").into());
        }
        let name = self.name.as_deref().unwrap_or_default();
        let found = voxels.names.iter().find(|(_, n)| n.eq_ignore_ascii_case(name));
        found.map(|(label, _)| *label).ok_or_else(|| {
            let names: Vec<&str> = voxels.names.values().map(String::as_str).collect();
            let there = if names.is_empty() {
                "no names; give label = N".to_owned()
            } else {
                names.join(", ")
            };
            format!("the volume has no structure \"{name}\"; it has {there}").into()
        })
    }

    /// Returns the tissue of a label; `None` if it is left out.
    fn tissue(&self, label: u8, voxels: &Voxels) -> Option<Tissue> {
        let of_volume = || voxels.names.get(&label).cloned();
        let name = self.called.clone().or_else(|| self.name.clone()).or_else(of_volume);
        let name = name.unwrap_or_else(|| format!("label {label}"));
        let (role, material) = role_and_material(&name);
        let role = match self.role {
            None => role,
            Some(Aim::Target) => Role::Target,
            Some(Aim::Spare) => Role::Spare,
            Some(Aim::Tissue) => Role::Tissue,
            Some(Aim::LeftOut) => return None,
        };
        let limits = self.stretch.zip(self.shear_deg);
        let limits = limits.map(|([short, long], deg)| [[short, long, deg.to_radians()]; 3]);
        let surroundings = self.surroundings.as_ref().and_then(Support::surroundings);
        Some(Tissue {
            label,
            name,
            role,
            material: Material {
                young_pa: self.young_kpa.map_or(material.young_pa, |kpa| kpa * 1e3),
                poisson: self.poisson.unwrap_or(material.poisson),
                limits: limits.or(material.limits),
                fixed: self.fixed.unwrap_or(material.fixed),
                surroundings: surroundings.unwrap_or(material.surroundings),
            },
        })
    }
}

#[cfg(test)]
mod tests;
