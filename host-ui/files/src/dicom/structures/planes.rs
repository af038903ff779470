//! Contours plane by plane. Duplicates count once, and missing planes are reported with the volume at stake.

use super::super::super::element::short;
use super::solid::encloses;
use super::{Contoured, SAME_PLANE_M, overlaps};
use nalgebra::{Matrix3, Vector3};

/// Distance, in usual distances, beyond which planes between two contours are missing.
const WIDE: f64 = 1.5;
/// Largest gap, in usual distances, that missing planes explain; beyond it there are two bodies.
pub const WIDEST: f64 = 3.5;
/// Most contours of one plane whose nesting is checked.
pub const MOST_NESTED: usize = 32;
/// Most gaps that a note lists.
const LISTED: usize = 4;

/// Polygon in its plane.
pub type Polygon = Vec<[f64; 2]>;

/// Plane of a structure: its height along the normal (m), and the area that its contours enclose
/// (m²).
struct Plane {
    height_m: f64,
    area_m2: f64,
}

/// Removes duplicate contours and unites those that overlap in part, unless the file says that
/// overlaps are holes; returns irregularities in words.
pub fn tidy(structure: &mut Contoured, is_exclusive: bool) -> Vec<String> {
    let Ok(normal) = structure.normal() else {
        return Vec::new();
    };
    // Upwards, so that heights of axial planes are the patient's z.
    let axes = axes_of(if normal[normal.iamax()] < 0.0 { -normal } else { normal });
    let overlaps = overlaps::settle(structure, &axes, is_exclusive);
    let plane = |(height_m, polygons): (f64, Vec<Polygon>)| Plane {
        height_m,
        area_m2: enclosed(&polygons),
    };
    let planes: Vec<Plane> = flat(&structure.contours, &axes).into_iter().map(plane).collect();
    let name = short(&structure.name);
    let mut notes = Vec::new();
    if !overlaps.copies_m.is_empty() {
        notes.push(duplicates(&name, &overlaps.copies_m, &planes));
    }
    notes.extend(overlaps.notes(&name, usual_m(&planes).unwrap_or_default()));
    notes.extend(distances(&name, &planes));
    notes
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

/// Returns the mean height of a contour along the third axis.
pub fn height_m(contour: &[Vector3<f64>], axes: &Matrix3<f64>) -> f64 {
    contour.iter().map(|p| axes.column(2).dot(p)).sum::<f64>() / contour.len() as f64
}

/// Groups items by their heights, lowest first; `same` is the distance below which two are in one plane.
pub fn by_height<T>(mut items: Vec<(f64, T)>, same: f64) -> Vec<(f64, Vec<T>)> {
    items.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut planes: Vec<(f64, Vec<T>)> = Vec::new();
    for (height, item) in items {
        match planes.last_mut() {
            Some((of_plane, items)) if height - *of_plane < same => items.push(item),
            _ => planes.push((height, vec![item])),
        }
    }
    planes
}

/// Returns the contours plane by plane, as polygons in their plane.
pub fn flat(contours: &[Vec<Vector3<f64>>], axes: &Matrix3<f64>) -> Vec<(f64, Vec<Polygon>)> {
    let polygon = |c: &Vec<Vector3<f64>>| c.iter().map(|p| axes.tr_mul(p)).map(|p| [p.x, p.y]).collect();
    let drawn = contours.iter().filter(|c| !c.is_empty());
    by_height(drawn.map(|c| (height_m(c, axes), polygon(c))).collect(), SAME_PLANE_M)
}

/// Returns in how many others of its plane each polygon lies. Loops along voxels may touch at corners, but never along
/// an edge.
pub fn depths(polygons: &[Polygon]) -> impl Iterator<Item = usize> {
    polygons.iter().enumerate().map(|(n, p)| {
        let middle = [0, 1].map(|a| (p[0][a] + p[1 % p.len()][a]) / 2.0);
        let others = polygons.iter().enumerate().filter(|(other, _)| *other != n);
        others.filter(|(_, polygon)| encloses(polygon, middle)).count()
    })
}

/// Returns the area of a polygon.
pub fn area(polygon: &[[f64; 2]]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    let origin = polygon.first().copied().unwrap_or_default();
    let part = |(a, b): (&[f64; 2], &[f64; 2])| {
        (a[0] - origin[0]) * (b[1] - origin[1]) - (b[0] - origin[0]) * (a[1] - origin[1])
    };
    polygon.iter().zip(next).map(part).sum::<f64>().abs() / 2.0
}

/// Returns the area that the polygons of a plane enclose; one inside another one is a hole of it.
fn enclosed(polygons: &[Polygon]) -> f64 {
    if polygons.len() > MOST_NESTED {
        return polygons.iter().map(|polygon| area(polygon)).sum();
    }
    let signed = |(polygon, depth): (&Polygon, usize)| area(polygon) * if depth % 2 == 0 { 1.0 } else { -1.0 };
    polygons.iter().zip(depths(polygons)).map(signed).sum::<f64>().max(0.0)
}

fn duplicates(name: &str, twice_m: &[f64], planes: &[Plane]) -> String {
    let usual_m = usual_m(planes).unwrap_or_default();
    let touched = planes
        .iter()
        .filter(|p| twice_m.iter().any(|m| (m - p.height_m).abs() < SAME_PLANE_M));
    let cc: f64 = touched.map(|p| p.area_m2 * usual_m * 1e6).sum();
    format!(
        "{name}: {} of its contours are there twice and are counted once (planes at {} mm, {cc:.1} cc)",
        twice_m.len(),
        in_mm(twice_m.iter().copied())
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

/// Returns heights of planes, rising, each once.
pub fn in_mm(heights_m: impl Iterator<Item = f64>) -> String {
    let mut heights: Vec<String> = heights_m.map(|m| format!("{:.1}", m * 1e3)).collect();
    heights.dedup();
    first_of(&heights)
}

/// Returns the first of several texts, and how many more there are.
fn first_of(all: &[String]) -> String {
    let mut text = all.iter().take(LISTED).cloned().collect::<Vec<_>>().join(", ");
    if all.len() > LISTED {
        text += &format!(" and {} more", all.len() - LISTED);
    }
    text
}
