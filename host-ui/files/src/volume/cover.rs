//! Voxels covered by an element, and the label that it takes from them.

use super::Voxels;

/// Returns the voxels under each element with their shares of its length.
pub(super) fn covers(elements: usize, corner: f64, h: f64, side: f64, voxels: usize) -> Vec<Vec<(usize, f64)>> {
    (0..elements)
        .map(|e| {
            let (from, to) = ((corner + e as f64 * h) / side, (corner + (e + 1) as f64 * h) / side);
            let first = from.floor().max(0.0) as usize;
            (first..voxels)
                .take_while(|&x| (x as f64) < to)
                .map(|x| (x, (to.min((x + 1) as f64) - from.max(x as f64)) / (to - from)))
                .filter(|&(_, share)| share > 1e-9)
                .collect()
        })
        .collect()
}

/// Returns the label that covers most of an element, if labels together cover at least half of it;
/// else 0.
pub(super) fn covered(v: &Voxels, keep: &[u8; 256], flip: bool, [xs, ys, zs]: [&Vec<(usize, f64)>; 3]) -> u8 {
    let mut shares: [(u8, f64); 8] = [(0, 0.0); 8];
    let mut sum = 0.0;
    for &(z, wz) in zs {
        for &(y, wy) in ys {
            let row = (z * v.dims[1] + y) * v.dims[0];
            for &(x, wx) in xs {
                let x = if flip { v.dims[0] - 1 - x } else { x };
                let label = keep[usize::from(v.labels[row + x])];
                if label == 0 {
                    continue;
                }
                sum += wx * wy * wz;
                // More than eight structures in one element are not worth more effort.
                if let Some(share) = shares.iter_mut().find(|(l, _)| *l == label || *l == 0) {
                    *share = (label, share.1 + wx * wy * wz);
                }
            }
        }
    }
    let most = shares.iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
    most.filter(|_| sum + 1e-9 >= 0.5).map_or(0, |(label, _)| *label)
}
