//! Scene files (TOML): a volume, materials of its structures, needle, device and plan; all problems
//! are reported at once.

mod keys;

use super::bytes::{file_name, whole};
use super::error::FileError;
use super::open::read_voxels;
use super::progress::Progress;
use super::volume::{LabelVolume, Tissue, Voxels, role_and_material};
use crate::error::ContentError;
use keys::Keys;
use std::path::{Path, PathBuf};
use stylet_anatomy::{Beyond, Material, Role, Surroundings};

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
    pub structures: Vec<Part>,
    /// Speed of insertion, in m/s.
    pub insert_m_per_s: Option<f64>,
    /// Speed of retraction, in m/s.
    pub retract_m_per_s: Option<f64>,
    /// Name of the haptic device.
    pub device: Option<String>,
    /// Path of a plan, relative to the scene file.
    pub plan: Option<PathBuf>,
}

/// Selection of a structure in the volume.
#[derive(Clone, Debug, PartialEq)]
pub enum Pick {
    /// By its label.
    Label(u8),
    /// By its name.
    Name(String),
}

/// Structure of the scene; omitted fields are inferred from its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Selection in the volume.
    pub pick: Pick,
    /// Name in the scene instead of that in the volume.
    pub called: Option<String>,
    /// Role; an inner `None` leaves the structure out.
    pub role: Option<Option<Role>>,
    /// Young's modulus, in Pa.
    pub young_pa: Option<f64>,
    /// Poisson's ratio.
    pub poisson: Option<f64>,
    /// Limits of links along x, y, z: shortest and longest as a share of the rest length, and shear
    /// in rad.
    pub limits: Option<[[f64; 3]; 3]>,
    /// True if it never moves.
    pub fixed: Option<bool>,
    /// Support at the outside of the body.
    pub surroundings: Option<Surroundings>,
}

/// Returns whether a file is a scene file, the only format here that is recognised by its name.
pub fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
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
    let path_of_volume = path.with_file_name(&scene.volume);
    let voxels = read_voxels(&path_of_volume, progress)?;
    let name = scene.name.clone().unwrap_or_else(|| file_name(path));
    let refused = |why: ContentError| FileError::of(path, why);
    let tissues = scene.tissues(&voxels).map_err(refused)?;
    let volume = LabelVolume::from_tissues(&voxels, tissues, name, progress).map_err(refused)?;
    Ok((scene, volume))
}

/// Parses the text of a scene file.
pub fn parse(text: &str) -> Result<SceneFile, ContentError> {
    let root: toml::Table = text.parse().map_err(|e| format!("it is not TOML: {e}"))?;
    let mut problems = Vec::new();
    let mut top = Keys::new(&root, String::new(), &mut problems);
    top.only(&["name", "volume", "image", "structure", "needle", "device", "plan"]);
    let name = top.text("name");
    let volume = top.table("volume", |k| {
        k.only(&["file"]);
        k.path("file")
    });
    let image = top.table("image", |k| {
        k.only(&["file"]);
        k.path("file")
    });
    let needle = top.table("needle", |k| {
        k.only(&["insert_mm_per_s", "retract_mm_per_s"]);
        Some(["insert_mm_per_s", "retract_mm_per_s"].map(|key| k.number(key, 0.1, 500.0).map(|v| v * 1e-3)))
    });
    let device = top.table("device", |k| {
        k.only(&["name"]);
        k.text("name")
    });
    let plan = top.table("plan", |k| {
        k.only(&["file"]);
        k.path("file")
    });
    let structures = top.tables("structure", MAX_STRUCTURES, part);
    let absent = !root.contains_key("volume");
    if absent || (volume.is_none() && problems.is_empty()) {
        problems.push("[volume] file is missing: the label volume to run".to_owned());
    }
    ContentError::all(problems)?;
    let [insert_m_per_s, retract_m_per_s] = needle.unwrap_or_default();
    Ok(SceneFile {
        name,
        volume: volume.ok_or("[volume] file is missing")?,
        image,
        structures,
        insert_m_per_s,
        retract_m_per_s,
        device,
        plan,
    })
}

fn part(k: &mut Keys) -> Option<Part> {
    k.only(&[
        "label",
        "name",
        "called",
        "role",
        "young_kpa",
        "poisson",
        "stretch",
        "shear_deg",
        "fixed",
        "surroundings",
    ]);
    let label = k.number("label", 1.0, 255.0);
    if label.is_some_and(|l| l.fract() != 0.0) {
        k.problem("label", "must be a whole number");
    }
    let pick = match (label, k.text("name")) {
        (Some(label), None) => Some(Pick::Label(label as u8)),
        (None, Some(name)) => Some(Pick::Name(name)),
        (Some(_), Some(_)) => {
            k.problem(
                "label",
                "and name are both there; give the one by which the structure is found, and its name as \"called\"",
            );
            None
        }
        (None, None) => {
            k.problem(
                "label",
                "or name is missing: by which the structure is found in the volume",
            );
            None
        }
    };
    let role = match k.text("role").as_deref() {
        None => None,
        Some("target") => Some(Some(Role::Target)),
        Some("spare") => Some(Some(Role::Spare)),
        Some("tissue") => Some(Some(Role::Tissue)),
        Some("leave out") => Some(None),
        Some(_) => {
            k.problem("role", "must be \"target\", \"spare\", \"tissue\" or \"leave out\"");
            None
        }
    };
    let stretch = k.numbers::<2>("stretch", 0.01, 100.0);
    let shear_deg = k.number("shear_deg", 0.1, 89.0);
    if stretch.is_some() != shear_deg.is_some() {
        k.problem("stretch", "and shear_deg belong together: give both or none");
    }
    if stretch.is_some_and(|[short, long]| !(short < 1.0 && long > 1.0)) {
        k.problem(
            "stretch",
            "must be [below 1, above 1]: shortest and longest as a share of the length at rest",
        );
    }
    let limits = stretch
        .zip(shear_deg)
        .map(|([short, long], deg)| [[short, long, deg.to_radians()]; 3]);
    Some(Part {
        called: k.text("called"),
        role,
        young_pa: k.number("young_kpa", 0.01, 1e8).map(|v| v * 1e3),
        poisson: k.number("poisson", 0.0, Material::MAX_POISSON),
        limits,
        fixed: k.yes("fixed"),
        surroundings: surroundings(k),
        pick: pick?,
    })
}

/// Reads one word for all faces, or six for those towards -x, +x, -y, +y, -z, +z of the scene.
fn surroundings(k: &mut Keys) -> Option<Surroundings> {
    let words = k.words("surroundings")?;
    let beyond: Option<Vec<Beyond>> = words.iter().map(|word| Beyond::of_name(word)).collect();
    let found = beyond.and_then(|beyond| match beyond.as_slice() {
        [all] => Some(Surroundings::all(*all)),
        each => <[Beyond; 6]>::try_from(each).ok().map(Surroundings),
    });
    if found.is_none() {
        k.problem(
            "surroundings",
            "must be \"fat\", \"free\" or \"fixed\", or a list of six of them, for the faces towards -x, +x, -y, +y, -z, +z",
        );
    }
    found
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
            return Err(ContentError::Invalid("all structures are left out".to_owned()));
        }
        Ok(tissues)
    }
}

impl Part {
    fn find(&self, voxels: &Voxels) -> Result<u8, ContentError> {
        match &self.pick {
            Pick::Label(label) if voxels.labels.contains(label) => Ok(*label),
            Pick::Label(label) => Err(ContentError::Invalid(format!(
                "the volume has no voxel with label {label}"
            ))),
            Pick::Name(name) => {
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
        }
    }

    /// Returns the tissue of a label; `None` if it is left out.
    fn tissue(&self, label: u8, voxels: &Voxels) -> Option<Tissue> {
        let picked = match &self.pick {
            Pick::Name(name) => Some(name.clone()),
            Pick::Label(_) => voxels.names.get(&label).cloned(),
        };
        let name = self
            .called
            .clone()
            .or(picked)
            .unwrap_or_else(|| format!("label {label}"));
        let (role, material) = role_and_material(&name);
        let role = self.role.unwrap_or(Some(role))?;
        Some(Tissue {
            label,
            name,
            role,
            material: Material {
                young_pa: self.young_pa.unwrap_or(material.young_pa),
                poisson: self.poisson.unwrap_or(material.poisson),
                limits: self.limits.or(material.limits),
                fixed: self.fixed.unwrap_or(material.fixed),
                surroundings: self.surroundings.unwrap_or(material.surroundings),
            },
        })
    }
}

#[cfg(test)]
mod tests;
