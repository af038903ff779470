//! Writes the structures of a volume as a scene file.

use crate::error::ContentError;
use crate::volume::Tissue;
use serde::Serialize;
use std::path::Path;
use stylet_anatomy::Role;

#[derive(Serialize)]
struct Tables<'a> {
    volume: Referred<'a>,
    structure: Vec<Part<'a>>,
}

#[derive(Serialize)]
struct Referred<'a> {
    file: &'a Path,
}

#[derive(Serialize)]
struct Part<'a> {
    label: u8,
    called: &'a str,
    role: &'static str,
    young_kpa: f64,
    fixed: bool,
}

impl<'a> Part<'a> {
    fn of(tissue: &'a Tissue) -> Self {
        Self {
            label: tissue.label,
            called: &tissue.name,
            role: match tissue.role {
                Role::Target => "target",
                Role::Spare => "spare",
                Role::Tissue => "tissue",
            },
            young_kpa: tissue.material.young_pa * 1e-3,
            fixed: tissue.material.fixed,
        }
    }
}

/// Formats a scene file of a volume, by its path from there, and its structures; labels without one are left out.
///
/// # Errors
///
/// If the path is not UTF-8.
pub fn to_text(volume: &Path, structures: &[Tissue]) -> Result<String, ContentError> {
    let tables = Tables {
        volume: Referred { file: volume },
        structure: structures.iter().map(Part::of).collect(),
    };
    toml::to_string(&tables).map_err(|why| ContentError::Unwritable(why.to_string()))
}
