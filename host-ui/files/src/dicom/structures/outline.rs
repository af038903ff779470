//! Outlines of a structure in one slice, along the edges of its voxels, so that rasterising them
//! gives the same voxels.

use std::collections::BTreeMap;

/// Corner of voxels: corner (i, j) lies between voxels i - 1 and i, j - 1 and j.
pub type Corner = [usize; 2];

/// Returns closed loops, with a loop for each hole. Calls `inside` for whole columns and rows.
pub fn loops([columns, rows]: [usize; 2], inside: impl Fn(usize, usize) -> bool) -> Vec<Vec<Corner>> {
    let mut next: BTreeMap<Corner, Vec<Corner>> = BTreeMap::new();
    let mut edge = |from: Corner, to: Corner| next.entry(from).or_default().push(to);
    for j in 0..rows {
        for i in (0..columns).filter(|&i| inside(i, j)) {
            // With the voxel on the left.
            if j == 0 || !inside(i, j - 1) {
                edge([i, j], [i + 1, j]);
            }
            if i + 1 == columns || !inside(i + 1, j) {
                edge([i + 1, j], [i + 1, j + 1]);
            }
            if j + 1 == rows || !inside(i, j + 1) {
                edge([i + 1, j + 1], [i, j + 1]);
            }
            if i == 0 || !inside(i - 1, j) {
                edge([i, j + 1], [i, j]);
            }
        }
    }
    let mut all = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        all.push(follow(start, &mut next));
    }
    all
}

/// Follows a loop. As many edges leave a corner as reach it, so a loop always closes.
fn follow(start: Corner, next: &mut BTreeMap<Corner, Vec<Corner>>) -> Vec<Corner> {
    let mut corners = vec![start];
    let mut at = start;
    while let Some(ways) = next.get_mut(&at) {
        let Some(to) = ways.pop() else { break };
        if ways.is_empty() {
            next.remove(&at);
        }
        at = to;
        if at == start {
            break;
        }
        corners.push(at);
    }
    straightened(corners)
}

fn straightened(corners: Vec<Corner>) -> Vec<Corner> {
    let n = corners.len();
    let turns = |i: usize| {
        let (before, after) = (corners[(i + n - 1) % n], corners[(i + 1) % n]);
        !(0..2).any(|a| before[a] == corners[i][a] && after[a] == corners[i][a])
    };
    (0..n).filter(|&i| turns(i)).map(|i| corners[i]).collect()
}
