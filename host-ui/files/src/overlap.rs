//! Overlapping structures as one label a voxel: the smaller structure wins.

use super::volume::Voxels;
use std::collections::BTreeMap;

/// Labels of the voxels, further labels of voxels, and the resulting losses in words.
pub type Settled = (Vec<u8>, Vec<(u8, u32)>, Option<String>);

/// Gives each voxel to its smallest structure. `of_voxel` adds every label of a voxel; voxels of
/// `voxel_m3` each.
pub fn smallest_wins(
    count: usize,
    voxel_m3: f64,
    names: &BTreeMap<u8, String>,
    of_voxel: impl Fn(usize, &mut Vec<u8>),
) -> Settled {
    let mut sizes = [0_usize; 256];
    let mut found = Vec::new();
    for voxel in 0..count {
        found.clear();
        of_voxel(voxel, &mut found);
        found.iter().for_each(|&l| sizes[usize::from(l)] += 1);
    }
    let mut taken = [0_usize; 256];
    let mut labels = vec![0_u8; count];
    let mut also = Vec::new();
    for (voxel, label) in labels.iter_mut().enumerate() {
        found.clear();
        of_voxel(voxel, &mut found);
        // The lower label if sizes are equal.
        let Some(&smallest) = found.iter().min_by_key(|&&l| (sizes[usize::from(l)], l)) else {
            continue;
        };
        *label = smallest;
        found.iter().filter(|&&l| l != smallest).for_each(|&l| {
            taken[usize::from(l)] += 1;
            also.push((l, voxel as u32));
        });
    }
    let each = names.iter().map(|(label, name)| {
        let label = usize::from(*label);
        (name.clone(), taken[label], sizes[label])
    });
    let warning = lost(each, voxel_m3);
    (labels, also, warning)
}

/// Returns what structures lost to smaller ones, in words: name, voxels taken and voxels of each.
pub fn lost(structures: impl Iterator<Item = (String, usize, usize)>, voxel_m3: f64) -> Option<String> {
    let lost: Vec<String> = structures
        .filter(|(_, taken, _)| *taken > 0)
        .map(|(name, taken, size)| {
            let cc = in_cc(taken as f64 * voxel_m3);
            format!("{name} ({taken} of {size} voxels) {cc}")
        })
        .collect();
    (!lost.is_empty()).then(|| {
        format!(
            "structures overlap, and where they do the smaller one has the voxel; others have it taken from them: {}",
            lost.join(", ")
        )
    })
}

/// Formats a lost volume for a note; small ones with more digits.
pub fn in_cc(m3: f64) -> String {
    let cc = m3 * 1e6;
    match cc < 0.1 {
        true => format!("{cc:.4} cc"),
        false => format!("{cc:.2} cc"),
    }
}

/// Returns the volume with one more warning for the user.
pub fn with_warning(mut voxels: Voxels, warning: Option<String>) -> Voxels {
    voxels.frame.warning = joined(voxels.frame.warning.take(), warning);
    voxels
}

/// Returns two remarks as one.
pub fn joined(one: Option<String>, other: Option<String>) -> Option<String> {
    match (one, other) {
        (Some(one), Some(other)) => Some(format!("{one}; {other}")),
        (one, other) => one.or(other),
    }
}
