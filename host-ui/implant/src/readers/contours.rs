//! Structures from a DICOM RT Structure Set as drawn: a structure inside another takes nothing from
//! it.

use std::path::Path;
use stylet_dose::{Region, Structure};
use stylet_files::dicom::structures::{Solid, StructureSet};
use stylet_files::{FileError, bytes, dicom, watched};

const PITCH_M: f64 = 0.5e-3;
const FEWEST_POINTS: f64 = 20_000.0;

struct Drawing<'a>(&'a Solid);

impl Region for Drawing<'_> {
    fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        (self.0.lower_m, self.0.upper_m)
    }

    fn contains(&self, point_m: [f64; 3]) -> bool {
        self.0.contains(point_m)
    }
}

/// Structures, and omissions of the file.
type Drawn = (Vec<Structure>, Vec<String>);

/// Returns the structures of an RT Structure Set, each of at most `most_points` points; `None` for
/// a file that holds labels.
pub fn structures(path: &Path, most_points: usize) -> Result<Option<Drawn>, FileError> {
    let refused = |why| FileError::of(path, why);
    let bytes = watched(path, |progress| bytes::whole(path, progress)).map_err(refused)?;
    let Some(object) = dicom::drawn(&bytes).map_err(refused)? else {
        return Ok(None);
    };
    let set = StructureSet::of(&object).map_err(refused)?;
    let solids = set.solids().map_err(refused)?;
    let structures = solids.iter().map(|s| of_solid(s, most_points)).collect::<Vec<_>>();
    Ok(Some((
        structures.into_iter().filter(|s| !s.points_m.is_empty()).collect(),
        set.notes,
    )))
}

/// Samples a body. A rounded one fills its box at most by half, and a finer pitch than wanted does
/// no harm.
fn of_solid(solid: &Solid, most_points: usize) -> Structure {
    let box_m3: f64 = (0..3).map(|a| (solid.upper_m[a] - solid.lower_m[a]).max(0.0)).product();
    let finest = (box_m3 / most_points as f64).cbrt();
    let pitch_m = PITCH_M.min((box_m3 / 2.0 / FEWEST_POINTS).cbrt()).max(finest).max(1e-5);
    Structure::of_region(&solid.name, &Drawing(solid), pitch_m)
}
