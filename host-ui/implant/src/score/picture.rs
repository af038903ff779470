//! Pictures of a debrief, as SVG: the implant from three sides, dose-volume histograms, force and speed over time.

use super::outline;
use super::{Score, SeedPair};
use crate::plan::anatomy::Body;
use nalgebra::Vector3;
use plotters::prelude::*;
use stylet_dose::picture::Curve;
use stylet_report::picture::{BLUE, Canvas, DrawError, Drawn, GREEN, INK, ORANGE, PURPLE, axes, drawn, label};
use stylet_shm_schema::TickRecord;

/// Axes of a view, and their names.
struct View {
    title: &'static str,
    across: [f64; 3],
    up: [f64; 3],
    labels: [&'static str; 2],
}

/// Draws the implant along the needles, from the side, and from the front: planned, delivered, and
/// the lines between them.
pub fn views(score: &Score) -> Result<String, DrawError> {
    let implant = &score.implant;
    let frame = implant.anatomy.patient;
    let axis = |patient: [f64; 3]| frame.scene_from_patient_direction(patient);
    // Facing the patient: his right is on the left.
    let (left, anterior, superior) = (axis([-1.0, 0.0, 0.0]), axis([0.0, 1.0, 0.0]), axis([0.0, 0.0, 1.0]));
    let views = [
        View {
            title: "Along the needles",
            across: left,
            up: anterior,
            labels: ["right – left (mm)", "posterior – anterior (mm)"],
        },
        View {
            title: "From the side",
            across: superior,
            up: anterior,
            labels: ["apex – base (mm)", "posterior – anterior (mm)"],
        },
        View {
            title: "From the front",
            across: left,
            up: superior,
            labels: ["right – left (mm)", "apex – base (mm)"],
        },
    ];
    drawn((1170, 430), |root| {
        root.fill(&WHITE)?;
        for (area, view) in root.split_evenly((1, 3)).iter().zip(&views) {
            one_view(area, score, view)?;
        }
        Ok(())
    })
}

fn one_view(area: &Canvas, score: &Score, view: &View) -> Drawn {
    let anatomy = score.implant.anatomy;
    let (low, high) = anatomy.target.bounds_m();
    let middle = (Vector3::from(low) + Vector3::from(high)) / 2.0;
    let seen = |p: Vector3<f64>| {
        let off = (p - middle) * 1e3;
        (off.dot(&Vector3::from(view.across)), off.dot(&Vector3::from(view.up)))
    };
    let pairs = &score.implant.pairs;
    let places = pairs
        .iter()
        .flat_map(|p| [p.planned.position_m, p.delivered.position_m]);
    let corners = places
        .map(|p| seen(Vector3::from(p)))
        .chain([seen(Vector3::from(low)), seen(Vector3::from(high))]);
    let reach = corners.fold(0.0_f64, |r, (x, y)| r.max(x.abs()).max(y.abs())) + 3.0;
    let mut chart = ChartBuilder::on(area)
        .caption(view.title, label(17))
        .margin(8)
        .x_label_area_size(38)
        .y_label_area_size(48)
        .build_cartesian_2d(-reach..reach, -reach..reach)?;
    axes(&mut chart, view.labels, |mesh| {
        mesh.x_labels(7).y_labels(7);
    })?;
    let bodies = anatomy.spared.iter().map(|body| (body, PURPLE.stroke_width(1)));
    for (body, style) in bodies.chain([(&anatomy.target, INK.stroke_width(2))]) {
        for ring in closed_rings(body, view, &seen, reach) {
            chart.draw_series([PathElement::new(ring, style)])?;
        }
    }
    let ends = |p: &SeedPair| [p.planned, p.delivered].map(|s| seen(Vector3::from(s.position_m)));
    let ways = pairs
        .iter()
        .map(|p| PathElement::new(ends(p), ORANGE.mix(0.6).stroke_width(1)));
    chart.draw_series(ways)?;
    chart.draw_series(pairs.iter().map(|p| Circle::new(ends(p)[0], 4, BLUE.stroke_width(1))))?;
    chart.draw_series(pairs.iter().map(|p| Circle::new(ends(p)[1], 3, ORANGE.filled())))?;
    Ok(())
}

/// Returns the edges of a body in the plane of the view through its centre, closed and clipped to
/// the picture.
fn closed_rings(
    body: &Body,
    view: &View,
    seen: &impl Fn(Vector3<f64>) -> (f64, f64),
    reach: f64,
) -> Vec<Vec<(f64, f64)>> {
    let (low, high) = body.bounds_m();
    let middle = (Vector3::from(low) + Vector3::from(high)) / 2.0;
    let normal = Vector3::from(view.across).cross(&Vector3::from(view.up));
    let in_picture = |ring: Vec<Vector3<f64>>| {
        let places: Vec<(f64, f64)> = ring.into_iter().map(seen).collect();
        let mut inside = outline::clipped(&places, reach);
        inside.extend(inside.first().copied());
        inside
    };
    let rings = outline::rings(body, middle, normal).into_iter().map(in_picture);
    rings.filter(|ring| !ring.is_empty()).collect()
}

/// Draws histograms, planned dashed, delivered solid.
pub fn dvh(score: &Score) -> Result<String, DrawError> {
    let pairs = score.planned.dvhs.iter().zip(&score.delivered.dvhs);
    let curves = score
        .judge
        .names()
        .zip(pairs)
        .map(|(name, (planned, delivered))| Curve {
            name,
            dvh: delivered,
            planned: Some(planned),
        });
    stylet_dose::picture::dvh((1170, 460), &curves.collect::<Vec<_>>(), score.implant.prescription_gy)
}

/// Number of distinguishable stretches of a curve over time.
const STRETCHES: usize = 900;
/// Distance of records that counts as a gap, in usual distances and as a minimum.
const USUAL_TIMES: u64 = 4;
const LEAST_GAP_NS: u64 = 40_000_000;

/// Draws force above, speed along the needle below.
pub fn over_time(records: &[TickRecord]) -> Result<String, DrawError> {
    let force = |r: &TickRecord| Vector3::from(r.force_on_hand_n).norm();
    let speed = |r: &TickRecord| r.speed_m_per_s * 1e3;
    drawn((1170, 420), |root| {
        root.fill(&WHITE)?;
        let (upper, lower) = root.split_vertically(200);
        series(&upper, records, force, ["", "Force on the hand (N)"], BLUE)?;
        series(
            &lower,
            records,
            speed,
            ["Time (s)", "Speed along the needle (mm/s)"],
            GREEN,
        )
    })
}

fn series(
    area: &Canvas,
    records: &[TickRecord],
    value: impl Fn(&TickRecord) -> f64,
    names: [&str; 2],
    colour: RGBColor,
) -> Drawn {
    let begin_ns = records.first().map_or(0, |r| r.due_ns);
    let seconds = |r: &TickRecord| r.due_ns.saturating_sub(begin_ns) as f64 / 1e9;
    let last_s = records.last().map_or(1.0, seconds).max(1e-3);
    let values = || records.iter().map(&value);
    let (low, high) = values().fold((0.0_f64, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    let room = 0.08 * (high - low).max(1e-3);
    let low = if low < 0.0 { low - room } else { 0.0 };
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(14)
        .margin_top(8)
        .x_label_area_size(if names[0].is_empty() { 22 } else { 40 })
        .y_label_area_size(56)
        .build_cartesian_2d(0.0..last_s, low..high + room)?;
    axes(&mut chart, names, |mesh| {
        mesh.y_labels(5);
    })?;
    let per_stretch = records.len().div_ceil(STRETCHES).max(1);
    for piece in pieces(records) {
        chart.draw_series(LineSeries::new(
            thinned(piece, per_stretch, seconds, &value),
            colour.stroke_width(1),
        ))?;
    }
    Ok(())
}

/// Cuts records at gaps: the part between was not seen.
fn pieces(records: &[TickRecord]) -> impl Iterator<Item = &[TickRecord]> {
    let apart_ns = |a: &TickRecord, b: &TickRecord| b.due_ns.saturating_sub(a.due_ns);
    let mut all: Vec<u64> = records.windows(2).map(|pair| apart_ns(&pair[0], &pair[1])).collect();
    all.sort_unstable();
    let usual_ns = all.get(all.len() / 2).copied().unwrap_or(0);
    let most_ns = (USUAL_TIMES * usual_ns).max(LEAST_GAP_NS);
    records.chunk_by(move |a, b| apart_ns(a, b) <= most_ns)
}

/// Keeps the minimum and maximum of each stretch, so that no peak is lost.
fn thinned(
    records: &[TickRecord],
    per_stretch: usize,
    seconds: impl Fn(&TickRecord) -> f64,
    value: impl Fn(&TickRecord) -> f64,
) -> Vec<(f64, f64)> {
    records
        .chunks(per_stretch)
        .flat_map(|stretch| {
            let by_value = |a: &&TickRecord, b: &&TickRecord| value(a).total_cmp(&value(b));
            let ends = [stretch.iter().min_by(by_value), stretch.iter().max_by(by_value)];
            let mut points: Vec<(f64, f64)> = ends.into_iter().flatten().map(|r| (seconds(r), value(r))).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            points
        })
        .collect()
}
