//! Contours against closed forms, and outlines that give their voxels back.

use super::super::Identity;
use super::super::{checked, images};
use super::*;
use nalgebra::Rotation3;
use std::f64::consts::PI;

mod contours;
mod without_images;

fn grid(dims: [usize; 3], sides_mm: [f64; 3]) -> Grid {
    let turned = Rotation3::from_euler_angles(0.2, -0.3, 0.4);
    let columns = turned.matrix() * Matrix3::from_diagonal(&(Vector3::from(sides_mm) * 1e-3));
    Grid {
        dims,
        frame: VoxelFrame::new(columns, Vector3::new(0.01, -0.02, 0.03), "test").unwrap(),
    }
}

/// Returns a circle in columns and rows of a slice.
fn circle(grid: &Grid, slice: f64, middle_mm: [f64; 2], radius_mm: f64) -> Vec<Vector3<f64>> {
    let corner = |i: usize| {
        let t = i as f64 / 200.0 * 2.0 * PI;
        let mm = [middle_mm[0] + radius_mm * t.cos(), middle_mm[1] + radius_mm * t.sin()];
        let side = grid.frame.spacing_m;
        grid.frame
            .place_m([mm[0] * 1e-3 / side[0], mm[1] * 1e-3 / side[1], slice])
    };
    (0..200).map(corner).collect()
}

fn written(v: &Voxels) -> Result<Vec<u8>, ContentError> {
    write::bytes(&write::Written {
        uid: "2.25.1",
        identity: &Identity::new(),
        images: &[],
        structures: &write::of_voxels(v)?,
    })
}

/// Structure of a file: number, name, kind and contours.
type Drawing<'a> = (usize, &'a str, &'a str, Vec<Vec<Vector3<f64>>>);

/// Returns a structure set as it is read from a file.
fn object(structures: &[Drawing]) -> Object {
    use super::super::write::{decimals, item, sequence, string, whole};
    let v = Voxels {
        dims: [1, 1, 1],
        labels: vec![1],
        frame: grid([1, 1, 1], [1.0; 3]).frame,
        names: [(1, "any".to_owned())].into(),
        also: Vec::new(),
        overlap: None,
    };
    let mut object = checked::read(&written(&v).unwrap()).unwrap();
    let mm = |c: &Vec<Vector3<f64>>| {
        c.iter()
            .flat_map(|p| [-p.x * 1e3, -p.y * 1e3, p.z * 1e3])
            .collect::<Vec<_>>()
    };
    let roi = |(number, name, ..): &Drawing| item([whole(tags::ROI_NUMBER, *number), string(tags::ROI_NAME, name)]);
    let drawn = |(number, _, kind, contours): &Drawing| {
        let contour = |c: &Vec<Vector3<f64>>| {
            item([
                string(tags::CONTOUR_GEOMETRIC_TYPE, kind),
                decimals(tags::CONTOUR_DATA, &mm(c)),
            ])
        };
        item([
            whole(tags::REFERENCED_ROI_NUMBER, *number),
            sequence(tags::CONTOUR_SEQUENCE, contours.iter().map(contour).collect()),
        ])
    };
    for element in [
        sequence(tags::STRUCTURE_SET_ROI_SEQUENCE, structures.iter().map(roi).collect()),
        sequence(tags::ROI_CONTOUR_SEQUENCE, structures.iter().map(drawn).collect()),
    ] {
        object.data.put(element);
    }
    object
}

fn set(structures: Vec<(&str, Vec<Vec<Vector3<f64>>>)>) -> StructureSet {
    let structure = |(name, contours): (&str, _)| Contoured {
        name: name.to_owned(),
        contours,
    };
    StructureSet {
        structures: structures.into_iter().map(structure).collect(),
        series: Vec::new(),
        images: Vec::new(),
        notes: Vec::new(),
    }
}

fn volume_mm3(v: &Voxels, label: u8) -> f64 {
    let voxels = v.labels.iter().filter(|&&l| l == label).count();
    voxels as f64 * v.frame.spacing_m.iter().product::<f64>() * 1e9
}

#[test]
fn a_cylinder_has_its_volume_and_its_hole_is_no_part_of_it() {
    let grid = grid([90, 70, 10], [0.4, 0.5, 2.5]);
    let middle = [17.0, 16.3];
    let outer = |k| circle(&grid, k, middle, 12.0);
    let inner = |k| circle(&grid, k, middle, 5.0);
    let ring: Vec<_> = (2..7)
        .flat_map(|k| [outer(f64::from(k)), inner(f64::from(k))])
        .collect();
    let v = set(vec![("Rectum", ring)]).voxels(Some(grid.clone())).unwrap();
    // Every voxel against a fine lattice of points in it: only at about half coverage may four
    // lines decide differently.
    let mut near_half = 0;
    for index in 0..90 * 70 {
        let at = [index % 90, index / 90].map(|i| i as f64);
        let point = |n: usize| {
            let within = [n % 32, n / 32].map(|i| (i as f64 + 0.5) / 32.0 - 0.5);
            let mm = [
                (at[0] + within[0]) * 0.4 - middle[0],
                (at[1] + within[1]) * 0.5 - middle[1],
            ];
            (5.0..12.0).contains(&mm[0].hypot(mm[1]))
        };
        let share = (0..1024).filter(|&n| point(n)).count() as f64 / 1024.0;
        let labels = [2, 6].map(|k| v.labels[k * 90 * 70 + index]);
        assert_eq!(labels[0], labels[1]);
        if (share - 0.5).abs() < 0.03 {
            near_half += 1;
        } else {
            assert_eq!(labels[0] == 1, share > 0.5, "{at:?} is covered by {share}");
        }
    }
    assert!(near_half < 40, "{near_half}");
    assert!(
        [1, 7]
            .iter()
            .all(|k| !v.labels[k * 90 * 70..(k + 1) * 90 * 70].contains(&1))
    );
    let expected = PI * (12.0_f64.powi(2) - 5.0_f64.powi(2)) * 2.5 * 5.0;
    assert!((volume_mm3(&v, 1) / expected - 1.0).abs() < 0.01);
    // The same by a keyhole: out, along a cut, back round the hole.
    let keyhole = |k| {
        let (out, mut hole) = (outer(k), inner(k));
        hole.reverse();
        let (first, back) = (out[0], hole[0]);
        [out, vec![first], vec![back], hole[1..].to_vec(), vec![back]].concat()
    };
    let keyholes = (2..7).map(|k| keyhole(f64::from(k))).collect();
    let same = set(vec![("Rectum", keyholes)]).voxels(Some(grid)).unwrap();
    let differ = v.labels.iter().zip(&same.labels).filter(|(a, b)| a != b).count();
    assert!(differ <= 10, "{differ}");
}

#[test]
fn nested_structures_keep_their_label_with_a_report() {
    let grid = grid([60, 60, 5], [0.5, 0.5, 2.0]);
    let gland: Vec<_> = (0..5)
        .map(|k| circle(&grid, f64::from(k), [15.0, 15.0], 10.0))
        .collect();
    let urethra: Vec<_> = (0..5).map(|k| circle(&grid, f64::from(k), [13.0, 15.0], 3.0)).collect();
    // In either order.
    for (order, label) in [([0, 1], 2), ([1, 0], 1)] {
        let both = [("Prostate", gland.clone()), ("Urethra", urethra.clone())];
        let v = set(order.map(|i| both[i].clone()).to_vec())
            .voxels(Some(grid.clone()))
            .unwrap();
        let expected = PI * 9.0 * 10.0;
        assert!((volume_mm3(&v, label) / expected - 1.0).abs() < 0.03);
        assert!(v.frame.warning.unwrap().contains("Prostate ("));
    }
}

/// Checks a solid, in which dose is counted: its volume is that of its contours, and structures
/// inside it take nothing from it.
#[test]
fn a_solid_keeps_its_hole_and_its_inner_structures() {
    let grid = grid([60, 60, 5], [0.5, 0.5, 2.0]);
    let ring = (0..5)
        .flat_map(|k| [10.0, 4.0].map(|r| circle(&grid, f64::from(k), [15.0, 15.0], r)))
        .collect();
    let inside: Vec<_> = (1..3).map(|k| circle(&grid, f64::from(k), [22.0, 15.0], 1.5)).collect();
    let solids = set(vec![("Prostate", ring), ("Urethra", inside)]).solids().unwrap();
    // The trapezoid rule over a lattice that is not aligned with the planes.
    let volume = |solid: &Solid, step: f64| {
        let counts = [0, 1, 2].map(|a| ((solid.upper_m[a] - solid.lower_m[a]) / step).ceil() as usize);
        let total: usize = counts.iter().product();
        let inside = |n: usize| {
            let at = [n % counts[0], n / counts[0] % counts[1], n / counts[0] / counts[1]];
            solid.contains([0, 1, 2].map(|a| solid.lower_m[a] + (at[a] as f64 + 0.5) * step))
        };
        (0..total).filter(|&n| inside(n)).count() as f64 * (step * 1e3).powi(3)
    };
    let disc = |r: f64| 100.0 * (2.0 * PI / 200.0).sin() * r * r;
    let (gland, urethra) = (volume(&solids[0], 0.25e-3), volume(&solids[1], 0.1e-3));
    assert!(
        (gland / ((disc(10.0) - disc(4.0)) * 10.0) - 1.0).abs() < 2e-3,
        "{gland}"
    );
    assert!((urethra / (disc(1.5) * 4.0) - 1.0).abs() < 1e-2, "{urethra}");
}

#[test]
fn planes_farther_apart_than_slices_fill_the_slices_between_but_not_a_gap() {
    let grid = grid([40, 40, 20], [0.5, 0.5, 1.0]);
    // Every second slice, and one piece far from the others.
    let planes = [2.0, 4.0, 6.0, 14.0, 16.0];
    let contours = planes.iter().map(|&k| circle(&grid, k, [10.0, 10.0], 6.0)).collect();
    let v = set(vec![("Bladder", contours)]).voxels(Some(grid)).unwrap();
    let used: Vec<usize> = (0..20)
        .filter(|k| v.labels[k * 1600..(k + 1) * 1600].contains(&1))
        .collect();
    assert_eq!(used, [1, 2, 3, 4, 5, 6, 13, 14, 15, 16]);
}

/// Tests a seeded scatter of blobs with holes and voxels that touch at corners.
#[test]
fn outlined_voxels_rasterise_back_equal() {
    let grid = grid([23, 19, 6], [0.7, 0.9, 2.0]);
    let count = 23 * 19 * 6;
    let mut random = stylet_random::Random(7);
    let labels: Vec<u8> = (0..count).map(|_| [0, 0, 1, 1, 3][random.below(5)]).collect();
    let v = Voxels {
        dims: grid.dims,
        labels,
        frame: grid.frame.clone(),
        names: [(1, "Prostate".to_owned()), (3, "Urethra".to_owned())].into(),
        also: Vec::new(),
        overlap: None,
    };
    let bytes = written(&v).unwrap();
    let set = StructureSet::of(&checked::read(&bytes).unwrap()).unwrap();
    assert_eq!(
        set.structures.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(),
        ["Prostate", "Urethra"]
    );
    let again = set
        .voxels(Some(images::Grid {
            dims: grid.dims,
            frame: grid.frame,
        }))
        .unwrap();
    // Labels are renumbered: 1 and 2.
    let expected: Vec<u8> = v.labels.iter().map(|l| [0, 1, 0, 2][usize::from(*l)]).collect();
    assert_eq!(again.labels, expected);
    assert!(again.frame.warning.is_none());
}

/// Guards against refused contours of sagittal images next to axial ones, and against dose in a
/// body that was neither.
#[test]
fn contours_across_the_slices_enclose_the_same_body() {
    let grid = grid([60, 60, 30], [0.5, 0.5, 1.0]);
    let (middle, radius_m) = (grid.frame.place_m([30.0, 30.0, 15.0]), 9e-3);
    let columns = grid.frame.directions;
    // A ball in discs across the first axis of the grid, across one that is oblique to all, and
    // across the slices.
    let oblique = (columns.column(0) + columns.column(1) * 0.4 + columns.column(2) * 0.7).normalize();
    let expected_mm3 = 4.0 / 3.0 * PI * (radius_m * 1e3_f64).powi(3);
    let discs = |normal: Vector3<f64>| -> Vec<Vec<Vector3<f64>>> {
        let u = normal.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize();
        let v = normal.cross(&u);
        let disc = |n: i32| {
            let height_m = f64::from(n) * 1e-3;
            let across_m = (radius_m * radius_m - height_m * height_m).sqrt();
            let corner = |i: u32| {
                let t = f64::from(i) / 100.0 * 2.0 * PI;
                middle + normal * height_m + (u * t.cos() + v * t.sin()) * across_m
            };
            (0..100).map(corner).collect()
        };
        (-8..=8).map(disc).collect()
    };
    let normals = [columns.column(0).into(), oblique, columns.column(2).into()];
    let drawn = set(vec![
        ("across", discs(normals[0])),
        ("oblique", discs(normals[1])),
        ("axial", discs(normals[2])),
    ]);
    for solid in drawn.solids().unwrap() {
        let (mut inside, mut all) = (0, 0);
        for n in 0..60_u32.pow(3) {
            let at = [n % 60, n / 60 % 60, n / 3600].map(|i| (f64::from(i) - 29.5) / 3.0 * 1e-3);
            let place = middle + Vector3::from(at);
            all += 1;
            inside += usize::from(solid.contains(place.into()));
        }
        let mm3 = f64::from(inside as u32) / f64::from(all) * 20.0_f64.powi(3);
        assert!(
            (mm3 / expected_mm3 - 1.0).abs() < 0.02,
            "{}: {mm3} of {expected_mm3}",
            solid.name
        );
    }
    for name in ["across", "oblique", "axial"] {
        let alone = drawn.structures.iter().filter(|s| s.name == name).cloned().collect();
        let alone = StructureSet {
            structures: alone,
            ..drawn.clone()
        };
        let mm3 = volume_mm3(&alone.voxels(Some(grid.clone())).unwrap(), 1);
        assert!(
            (mm3 / expected_mm3 - 1.0).abs() < 0.02,
            "{name}: {mm3} of {expected_mm3}"
        );
    }
    // One structure in two directions has no body.
    let mixed = set(vec![("mixed", [discs(normals[0]), discs(normals[2])].concat())]);
    let why = mixed.solids().unwrap_err().to_string();
    assert!(why.contains("off the planes of its others"), "{why}");
}

#[test]
fn excessive_contours_are_refused() {
    let grid = grid([40, 40, 6], [0.5, 0.5, 2.0]);
    // A sawtooth from one end of the slice to the other, again and again.
    let saw: Vec<_> = (0..200_000)
        .map(|i| {
            grid.frame
                .place_m([f64::from(i % 40), f64::from(i % 2) * 1e4 - 5e3, 2.0])
        })
        .collect();
    let why = set(vec![("Prostate", vec![saw])])
        .voxels(Some(grid))
        .unwrap_err()
        .to_string();
    assert!(why.contains("too many to be drawn"), "{why}");
}

/// Guards against two silent errors: planes 2 and 4 mm apart made 24.6 cc of a gland of 37.6 cc,
/// duplicate contours made 34.8 cc.
#[test]
fn missing_planes_and_duplicate_contours_are_reported() {
    let (middle, radius) = ([20.0, 20.0], 17.0);
    let sides = [0.5, 0.5, 1.0];
    let grid = grid([80, 80, 60], sides);
    // 2 and 4 mm, alternating: every third plane of 2 mm is missing.
    let heights: Vec<f64> = (0..38)
        .map(f64::from)
        .filter(|k| k % 6.0 == 3.0 || k % 6.0 == 5.0)
        .collect();
    let drawn = |k: &f64| circle(&grid, *k, middle, radius);
    let contours: Vec<_> = heights.iter().map(drawn).collect();
    let expected = 100.0 * (2.0 * PI / 200.0).sin() * radius * radius * (heights[heights.len() - 1] - heights[0] + 2.0);
    let volumes = |contours: Vec<Vec<Vector3<f64>>>| {
        let object = object(&[(1, "Prostate", "CLOSED_PLANAR", contours)]);
        let set = StructureSet::of(&object).unwrap();
        let notes = set.notes.join("; ");
        let v = set.voxels(Some(grid.clone())).unwrap();
        assert!(notes.is_empty() || v.frame.warning.as_ref().unwrap().contains(&notes));
        (volume_mm3(&v, 1), notes)
    };
    let (found, notes) = volumes(contours.clone());
    assert!((found / expected - 1.0).abs() < 0.01, "{found} of {expected} mm3");
    assert!(
        notes.contains("Prostate: its planes") && notes.contains("2.0 to 4.0 mm"),
        "{notes}"
    );
    assert!(notes.contains(" cc of its volume"), "{notes}");
    // One from another corner on and in the other direction.
    let mut other = contours[5].clone();
    other.reverse();
    other.rotate_left(7);
    let twice = [contours, vec![other]].concat();
    let (again, notes) = volumes(twice);
    assert_eq!(again, found);
    assert!(
        notes.contains("1 of its contours are there twice and are counted once"),
        "{notes}"
    );
    let even = (2..30).map(f64::from).map(|k| drawn(&k)).collect();
    assert_eq!(volumes(even).1, "");
}

/// Guards against an outline of more than some 1,300 corners, which could not be written.
#[test]
fn an_outline_of_many_corners_is_written_and_read() {
    let grid = grid([1500, 3, 2], [0.1, 0.1, 1.0]);
    // A comb: every second column is longer.
    let inside = |n: usize| (n / 1500).is_multiple_of(3) || (n / 1500 % 3 == 1 && n.is_multiple_of(2));
    let v = Voxels {
        dims: grid.dims,
        labels: (0..1500 * 3 * 2).map(|n| u8::from(inside(n))).collect(),
        frame: grid.frame.clone(),
        names: [(1, "Prostate".to_owned())].into(),
        also: Vec::new(),
        overlap: None,
    };
    let set = StructureSet::of(&checked::read(&written(&v).unwrap()).unwrap()).unwrap();
    assert!(set.structures[0].contours[0].len() > 2900);
    assert_eq!(set.voxels(Some(grid)).unwrap().labels, v.labels);
}
