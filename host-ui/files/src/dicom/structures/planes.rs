//! Duplicate contours count once, and missing planes are reported with the volume at stake.

use super::super::super::element::short;
use super::solid::encloses;
use super::{Contoured, SAME_PLANE_M, area_vector, overlaps};
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeSet, HashSet};

/// Distance, in usual distances, beyond which planes between two contours are missing.
const WIDE: f64 = 1.5;
/// Largest gap, in usual distances, that missing planes explain; beyond it there are two bodies.
pub const WIDEST: f64 = 3.5;
/// Distance below which two corners are the same.
const SAME_CORNER_M: f64 = 1e-6;
/// Most contours of one plane whose nesting is checked.
pub const MOST_NESTED: usize = 32;
/// Most gaps that a note lists.
const LISTED: usize = 4;

/// Plane of a structure: its height along the normal (m), and the area that its contours enclose
/// (m²).
struct Plane {
    height_m: f64,
    area_m2: f64,
}

/// Removes duplicate contours and unites those that overlap in part, unless the file says that
/// overlaps are holes; returns irregularities in words.
pub fn tidy(structure: &mut Contoured, is_exclusive: bool) -> Vec<String> {
    let largest = structure.contours.iter().map(|c| area_vector(c));
    let largest = largest.max_by(|a, b| a.norm().total_cmp(&b.norm()));
    let Some(normal) = largest.and_then(|a| a.try_normalize(1e-12)) else {
        return Vec::new();
    };
    // Upwards, so that heights of axial planes are the patient's z.
    let normal = if normal[normal.iamax()] < 0.0 { -normal } else { normal };
    let mut twice_m = without_duplicates(structure, normal);
    let overlaps = overlaps::settle(structure, normal, is_exclusive);
    twice_m.extend(&overlaps.copies_m);
    let planes = planes(structure, normal);
    let mut notes = Vec::new();
    let name = short(&structure.name);
    if !twice_m.is_empty() {
        notes.push(duplicates(&name, &twice_m, &planes));
    }
    notes.extend(overlaps.notes(&name, usual_m(&planes).unwrap_or_default()));
    notes.extend(distances(&name, &planes));
    notes
}

/// Removes duplicates; returns the height of each removed contour.
fn without_duplicates(structure: &mut Contoured, normal: Vector3<f64>) -> Vec<f64> {
    let (mut seen, mut twice_m) = (HashSet::new(), Vec::new());
    structure.contours.retain(|contour| {
        let is_new = seen.insert(shape(contour));
        if !is_new {
            twice_m.push(contour[0].dot(&normal));
        }
        is_new
    });
    twice_m
}

/// Returns a normal form of a contour, independent of its start, its direction, and a repeated
/// first corner.
fn shape(contour: &[Vector3<f64>]) -> Vec<[i64; 3]> {
    let corner = |p: &Vector3<f64>| [p.x, p.y, p.z].map(|v| (v / SAME_CORNER_M).round() as i64);
    let mut corners: Vec<[i64; 3]> = contour.iter().map(corner).collect();
    corners.dedup();
    while corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    let from_least = |corners: &mut Vec<[i64; 3]>| {
        let least = (0..corners.len()).min_by_key(|&i| corners[i]).unwrap_or(0);
        corners.rotate_left(least);
    };
    let mut reversed: Vec<[i64; 3]> = corners.iter().rev().copied().collect();
    from_least(&mut corners);
    from_least(&mut reversed);
    corners.min(reversed)
}

/// Returns two axes within planes of this normal, and the normal.
pub fn axes_of(normal: Vector3<f64>) -> Matrix3<f64> {
    let aside = if normal.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let across = (aside - normal * aside.dot(&normal)).normalize();
    Matrix3::from_columns(&[across, normal.cross(&across), normal])
}

/// Returns the contours plane by plane, as polygons in their plane.
pub fn flat(contours: &[Vec<Vector3<f64>>], normal: Vector3<f64>) -> Vec<Vec<Vec<[f64; 2]>>> {
    let axes = axes_of(normal);
    let mut by_height: Vec<&Vec<Vector3<f64>>> = contours.iter().filter(|c| !c.is_empty()).collect();
    let height = |c: &Vec<Vector3<f64>>| c[0].dot(&normal);
    by_height.sort_by(|a, b| height(a).total_cmp(&height(b)));
    let polygon = |c: &&Vec<Vector3<f64>>| c.iter().map(|p| axes.tr_mul(p)).map(|p| [p.x, p.y]).collect();
    by_height
        .chunk_by(|a, b| height(b) - height(a) < SAME_PLANE_M)
        .map(|of_plane| of_plane.iter().map(polygon).collect())
        .collect()
}

fn planes(structure: &Contoured, normal: Vector3<f64>) -> Vec<Plane> {
    let mut contours: Vec<(f64, &Vec<Vector3<f64>>)> =
        structure.contours.iter().map(|c| (c[0].dot(&normal), c)).collect();
    contours.sort_by(|a, b| a.0.total_cmp(&b.0));
    let axes = axes_of(normal);
    contours
        .chunk_by(|a, b| b.0 - a.0 < SAME_PLANE_M)
        .map(|of_plane| {
            let flat = |c: &Vec<Vector3<f64>>| -> Vec<[f64; 2]> {
                c.iter().map(|p| axes.tr_mul(p)).map(|p| [p.x, p.y]).collect()
            };
            let polygons: Vec<_> = of_plane.iter().take(MOST_NESTED).map(|(_, c)| flat(c)).collect();
            let areas = of_plane.iter().enumerate().map(|(n, (_, contour))| {
                let Some(corner) = polygons.get(n).map(|p| p[0]) else {
                    return area_vector(contour).norm();
                };
                let others = polygons.iter().enumerate().filter(|(other, _)| *other != n);
                let depth = others.filter(|(_, polygon)| encloses(polygon, corner)).count();
                // A contour inside another one is a hole of it.
                area_vector(contour).norm() * if depth % 2 == 0 { 1.0 } else { -1.0 }
            });
            Plane {
                height_m: of_plane[0].0,
                area_m2: areas.sum::<f64>().max(0.0),
            }
        })
        .collect()
}

fn duplicates(name: &str, twice_m: &[f64], planes: &[Plane]) -> String {
    let in_um: BTreeSet<i64> = twice_m.iter().map(|m| (m * 1e6).round() as i64).collect();
    let usual_m = usual_m(planes).unwrap_or_default();
    let touched = planes
        .iter()
        .filter(|p| twice_m.iter().any(|m| (m - p.height_m).abs() < SAME_PLANE_M));
    let cc: f64 = touched.map(|p| p.area_m2 * usual_m * 1e6).sum();
    let heights: Vec<String> = in_um.iter().map(|um| format!("{:.1}", *um as f64 * 1e-3)).collect();
    format!(
        "{name}: {} of its contours are there twice and are counted once (planes at {} mm, {cc:.1} cc)",
        twice_m.len(),
        first_of(&heights)
    )
}

/// Returns the median distance between planes, in m.
fn usual_m(planes: &[Plane]) -> Option<f64> {
    let mut gaps: Vec<f64> = planes.windows(2).map(|w| w[1].height_m - w[0].height_m).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).copied()
}

fn distances(name: &str, planes: &[Plane]) -> Vec<String> {
    let Some(usual_m) = usual_m(planes) else {
        return Vec::new();
    };
    let gaps = || planes.windows(2).map(|w| (w[1].height_m - w[0].height_m, w));
    let least_m = gaps().map(|(gap, _)| gap).fold(f64::INFINITY, f64::min);
    let most_m = gaps().map(|(gap, _)| gap).fold(0.0, f64::max);
    if most_m <= WIDE * least_m {
        return Vec::new();
    }
    let mut text = format!(
        "{name}: its planes are unevenly spaced ({:.1} to {:.1} mm, usually {:.1} mm)",
        least_m * 1e3,
        most_m * 1e3,
        usual_m * 1e3
    );
    let all = |which: &dyn Fn(f64) -> bool| {
        let wide = gaps().filter(|(gap, _)| *gap > WIDE * usual_m && which(*gap));
        let (mut places, mut cc) = (Vec::new(), 0.0);
        for (gap, w) in wide {
            places.push(format!("{:.1} to {:.1}", w[0].height_m * 1e3, w[1].height_m * 1e3));
            cc += (w[0].area_m2 + w[1].area_m2) / 2.0 * (gap - usual_m) * 1e6;
        }
        (places, cc)
    };
    let (filled, filled_cc) = all(&|gap| gap <= WIDEST * usual_m);
    if !filled.is_empty() {
        let places = first_of(&filled);
        text += &format!(
            "; where some are missing ({places} mm) their neighbours reach half-way, which makes {filled_cc:.1} cc of its volume"
        );
    }
    let (empty, empty_cc) = all(&|gap| gap > WIDEST * usual_m);
    if !empty.is_empty() {
        let places = first_of(&empty);
        text += &format!(
            "; nothing is drawn between {places} mm, and it is taken as empty ({empty_cc:.1} cc if it is one body)"
        );
    }
    text += "; check its contours";
    vec![text]
}

/// Returns the first of several texts, and how many more there are.
pub fn first_of(all: &[String]) -> String {
    let mut text = all.iter().take(LISTED).cloned().collect::<Vec<_>>().join(", ");
    if all.len() > LISTED {
        text += &format!(" and {} more", all.len() - LISTED);
    }
    text
}
