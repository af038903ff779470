//! Structures from a label volume; a voxel belongs to its structure from wall to wall.

use nalgebra::Vector3;
use std::collections::BTreeMap;
use stylet_dose::Structure;
use stylet_dose::structure::Scatter;
use stylet_files::Voxels;

/// Smallest pitch, unless a structure is too small to have [`FEWEST_POINTS`] otherwise.
const PITCH_M: f64 = 0.5e-3;
const FEWEST_POINTS: f64 = 20_000.0;

/// Returns one structure for each label but 0, in the order of labels, whole even if structures
/// overlap; `names` are the user's.
pub fn structures(voxels: &Voxels, names: &BTreeMap<u8, String>, most_points: usize) -> Vec<Structure> {
    let of_label = |label: u8| {
        let name = names.get(&label).cloned().unwrap_or_else(|| format!("label {label}"));
        structure(voxels, name, &voxels.of_label(label), most_points)
    };
    voxels.present().into_iter().map(of_label).collect()
}

fn structure(v: &Voxels, name: String, indices: &[usize], most_points: usize) -> Structure {
    let voxel_m3: f64 = v.frame.spacing_m.iter().product();
    let volume_m3 = voxel_m3 * indices.len() as f64;
    let finest = (volume_m3 / most_points as f64).cbrt();
    let pitch_m = PITCH_M.min((volume_m3 / FEWEST_POINTS).cbrt()).max(finest);
    let parts = v.frame.spacing_m.map(|side| ((side / pitch_m).round() as usize).max(1));
    let count = parts.iter().product::<usize>();
    let mut points_m = Vec::with_capacity(indices.len() * count);
    for &index in indices {
        let at = [
            index % v.dims[0],
            index / v.dims[0] % v.dims[1],
            index / v.dims[0] / v.dims[1],
        ];
        let mut random = Scatter::of_cell(at);
        for part in 0..count {
            let part = [part % parts[0], part / parts[0] % parts[1], part / parts[0] / parts[1]];
            let within = random.point();
            // The index of a voxel is that of its centre.
            let place = Vector3::from([0, 1, 2].map(|a| {
                let share = (part[a] as f64 + within[a]) / parts[a] as f64;
                (at[a] as f64 + share - 0.5) * v.frame.spacing_m[a]
            }));
            points_m.push((v.frame.directions * place + v.frame.origin_m).into());
        }
    }
    let volumes_m3 = vec![voxel_m3 / count as f64; points_m.len()];
    Structure {
        name,
        points_m,
        volumes_m3,
    }
}
