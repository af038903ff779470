//! The grid of contours whose images are missing.

use super::*;

#[test]
fn without_images_the_grid_is_around_the_contours() {
    let grid = grid([60, 60, 8], [0.5, 0.5, 3.0]);
    let contours = (1..7)
        .map(|k| circle(&grid, f64::from(k), [14.0, 15.0], 11.0))
        .collect();
    let v = set(vec![("Prostate", contours)]).voxels(None).unwrap();
    let expected = PI * 121.0 * 18.0;
    assert!((volume_mm3(&v, 1) / expected - 1.0).abs() < 0.01);
    assert!((v.frame.spacing_m[2] - 3e-3).abs() < 1e-9);
    let normal = grid.frame.directions.column(2);
    assert!(v.frame.directions.column(2).dot(&normal).abs() > 1.0 - 1e-9);
    assert!(v.frame.warning.unwrap().contains("images are not in its folder"));
}

/// Guards against voxel centres on the outermost contours: structures of whole half millimetres
/// were read half a millimetre wider, the urethra of `pelvis` by 3.2 % in volume.
#[test]
fn rods_that_are_outlined_along_cells_have_the_volume_of_their_cells() {
    for side_mm in [0.3, 0.5, 0.93, 1.0, 1.7, 2.0] {
        let sides_mm = [side_mm, side_mm * 1.1, 2.0];
        // A patient's columns run to the left and to the back.
        let columns = Matrix3::from_diagonal(&Vector3::new(-sides_mm[0], -sides_mm[1], sides_mm[2])) * 1e-3;
        let frame = VoxelFrame::new(columns, Vector3::new(0.01, -0.02, 0.03), "test").unwrap();
        // A rod of 3 x 3 cells, and a body around it with a step.
        let label = |n: usize| {
            let [i, j, k] = [n % 12, n / 12 % 14, n / 168];
            match (i, j, k) {
                (4..7, 5..8, 1..8) => 2,
                (2..10, 3..12, 2..7) | (3..8, 2..13, 2..5) => 1,
                _ => 0,
            }
        };
        let labels: Vec<u8> = (0..12 * 14 * 9).map(label).collect();
        let cells = [1, 2].map(|label| labels.iter().filter(|l| **l == label).count() as f64);
        let v = Voxels {
            dims: [12, 14, 9],
            labels,
            frame,
            names: [(1, "Prostate".to_owned()), (2, "Urethra".to_owned())].into(),
            also: Vec::new(),
            overlap: None,
        };
        let set = StructureSet::of(&checked::read(&written(&v).unwrap()).unwrap()).unwrap();
        let again = set.voxels(None).unwrap();
        for (label, cells) in [1, 2].into_iter().zip(cells) {
            let share = volume_mm3(&again, label) / (cells * side_mm * side_mm * 1.1 * 2.0);
            assert!((share - 1.0).abs() < 1e-6, "{side_mm} mm, label {label}: {share}");
        }
    }
}

/// Compares with the closed form, for any place of the axis between the voxels: drawn contours lie
/// on no lattice.
#[test]
fn thin_cylinders_keep_their_volume_without_images() {
    for radius_mm in [2.0, 3.0, 4.5] {
        let share = |n: u32| {
            let grid = grid([60, 60, 9], [0.5, 0.5, 2.0]);
            let middle = [15.0 + 0.037 * f64::from(n), 15.0 + 0.061 * f64::from(n)];
            let thin = (1..8).map(|k| circle(&grid, f64::from(k), middle, radius_mm)).collect();
            let wide = (1..8)
                .map(|k| circle(&grid, f64::from(k), [15.0, 15.0], 11.3))
                .collect();
            let v = set(vec![("Prostate", wide), ("Urethra", thin)]).voxels(None).unwrap();
            volume_mm3(&v, 2) / (PI * radius_mm * radius_mm * 14.0)
        };
        let shares: Vec<f64> = (0..12).map(share).collect();
        let mean = shares.iter().sum::<f64>() / 12.0;
        // The number of lattice points in a circle of R steps deviates from its area by 0.676 R
        // (variance; Kendall, Quart. J. Math. 19, 1, 1948).
        let steps = radius_mm / 0.5;
        let deviation = (0.676 * steps).sqrt() / (PI * steps * steps);
        let worst = shares.iter().map(|s| (s - 1.0).abs()).fold(0.0, f64::max);
        println!("radius {radius_mm} mm: mean {mean:.4}, worst off by {worst:.4}, deviation {deviation:.4}");
        assert!(
            (mean - 1.0).abs() < 3.0 * deviation / 12.0_f64.sqrt(),
            "{radius_mm}: {shares:?}"
        );
        assert!(worst < 3.0 * deviation, "{radius_mm}: {shares:?}");
    }
}
