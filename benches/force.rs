//! Stiffness that the loop holds, and forces of insertions: tables, and pictures in `docs/pictures`.
//!
//! `cargo bench -p stylet-benches --bench force`, or `make force-pictures`. Simulation only: the same figures on any
//! machine.

use nalgebra::Vector3;
use plotters::prelude::*;
use std::path::{Path, PathBuf};
use stylet_benches::session::{Session, axis_start, gland_shift_m};
use stylet_benches::wall::Wall;
use stylet_hw::Hand;
use stylet_runtime::rt::world::World;
use stylet_sim::limits::TissueParameters;
use stylet_sim::needle::Phase;
use stylet_sim::scene::{Scene, TissueKind};

type Drawn = Result<(), Box<dyn std::error::Error>>;

/// The hand that damps least: the worst of the envelope.
const LIGHT_HAND: Hand = Hand {
    mass_kg: 0.1,
    damping_n_s_per_m: 2.0,
    stiffness_n_per_m: 220.0,
    effort: None,
};
const MOST_N_PER_M: f64 = 60e3;

fn main() -> Drawn {
    let pictures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/pictures");
    z_width(&pictures.join("z-width.svg"))?;
    insertions(&pictures.join("insertions.svg"))
}

/// A row of the table: how the wall is built, and its colour.
const WALLS: [(&str, f64, usize, bool, RGBColor); 5] = [
    ("wall alone", 0.0, 0, false, RGBColor(120, 120, 120)),
    ("wall alone, 1 tick late", 0.0, 1, false, RGBColor(190, 150, 60)),
    ("with 5 N s/m", 5.0, 0, false, RGBColor(60, 120, 190)),
    ("with 5 N s/m, controlled", 5.0, 0, true, RGBColor(30, 140, 90)),
    ("with 5 N s/m, controlled, 3 late", 5.0, 3, true, RGBColor(190, 60, 60)),
];
const RATES_HZ: [f64; 3] = [1000.0, 2000.0, 5000.0];

fn z_width(path: &PathBuf) -> Drawn {
    println!("stiffest wall that does not sing, N/m; hand of 0.1 kg, 2 N s/m, 220 N/m");
    println!("{:<36} {:>8} {:>8} {:>8}", "", "1 kHz", "2 kHz", "5 kHz");
    let bound = |rate: f64| 2.0 * LIGHT_HAND.damping_n_s_per_m * rate;
    println!(
        "{:<36} {:>8.0} {:>8.0} {:>8.0}",
        "2 b / T",
        bound(1e3),
        bound(2e3),
        bound(5e3)
    );
    let root = SVGBackend::new(path, (760, 440)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(
            (0.8f64..6.5)
                .log_scale()
                .with_key_points(RATES_HZ.map(|rate| rate / 1e3).to_vec()),
            (100f64..1e5).log_scale(),
        )?;
    chart
        .configure_mesh()
        .x_desc("rate of the loop, kHz")
        .y_desc("stiffest wall, N/m")
        .x_labels(6)
        .light_line_style(WHITE)
        .draw()?;
    let ideal = RATES_HZ.map(|rate| (rate / 1e3, bound(rate)));
    chart
        .draw_series(DashedLineSeries::new(ideal, 8, 5, BLACK.stroke_width(2)))?
        .label("2 b / T, b of the hand")
        .legend(|(x, y)| plotters::element::DashedPathElement::new([(x, y), (x + 18, y)], 5, 3, BLACK.stroke_width(2)));
    for (name, damping_n_s_per_m, late_ticks, controlled, colour) in WALLS {
        let reached = RATES_HZ.map(|rate| {
            let wall = Wall {
                stiffness_n_per_m: 0.0,
                damping_n_s_per_m,
                period_s: 1.0 / rate,
                late_ticks,
                controlled,
            };
            (rate / 1e3, wall.stiffest(LIGHT_HAND, MOST_N_PER_M))
        });
        println!(
            "{name:<36} {:>8.0} {:>8.0} {:>8.0}",
            reached[0].1, reached[1].1, reached[2].1
        );
        chart
            .draw_series(LineSeries::new(reached, colour.stroke_width(2)).point_size(3))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.9))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    root.present()?;
    Ok(())
}

/// One tick of an insertion into the pelvis.
struct Sample {
    depth_mm: f64,
    force_n: f64,
    shift_mm: f64,
    phase: Phase,
}

fn insertion(speed_m_per_s: f64) -> Vec<Sample> {
    let scene = Scene::builtin("pelvis").expect("built in");
    let limits = TissueParameters::default().validate().expect("the defaults are valid");
    let world = World::new(scene, TissueKind::default(), limits, 1).expect("ChainMail takes every scene");
    let start = axis_start(&world);
    let mut session = Session::new(world, start, Hand::steady(), 5);
    session.go_to(start + Vector3::z() * 0.085, speed_m_per_s);
    let mut shift_mm = 0.0;
    (0..((0.085 / speed_m_per_s + 0.6) * 1e3) as u64)
        .map(|tick| {
            let output = session.step();
            if tick % 5 == 0 {
                shift_mm = gland_shift_m(session.world()) * 1e3;
            }
            Sample {
                depth_mm: (session.true_tip_in_world().z - start.z) * 1e3 - 5.0,
                force_n: -output.wrench.force_n.z,
                shift_mm,
                phase: output.phase,
            }
        })
        .collect()
}

const FORCE: RGBColor = RGBColor(30, 60, 120);
const GLAND: RGBColor = RGBColor(180, 60, 40);

fn shade(phase: Phase) -> RGBAColor {
    match phase {
        Phase::Outside => WHITE.mix(0.0),
        Phase::Contraction => RGBColor(240, 190, 90).mix(0.35),
        Phase::Penetration => RGBColor(120, 180, 230).mix(0.30),
        Phase::Retraction => RGBColor(200, 130, 200).mix(0.35),
        Phase::Hold => RGBColor(170, 170, 170).mix(0.30),
    }
}

fn insertions(path: &PathBuf) -> Drawn {
    let root = SVGBackend::new(path, (760, 780)).into_drawing_area();
    root.fill(&WHITE)?;
    println!("\ninsertions into the pelvis, force at the device");
    for (area, speed_m_per_s) in root.split_evenly((3, 1)).iter().zip([0.005, 0.048, 0.28]) {
        let samples = insertion(speed_m_per_s);
        let largest = |of: fn(&Sample) -> f64| samples.iter().map(of).fold(0.0, f64::max);
        let (force_n, shift_mm) = (largest(|s| s.force_n), largest(|s| s.shift_mm));
        let speed = speed_m_per_s * 1e3;
        println!("{speed:>5.0} mm/s: peak {force_n:.2} N, the gland moves {shift_mm:.2} mm");
        let mut chart = ChartBuilder::on(area)
            .caption(format!("{speed:.0} mm/s"), ("sans-serif", 16))
            .margin(12)
            .x_label_area_size(36)
            .y_label_area_size(48)
            .right_y_label_area_size(48)
            .build_cartesian_2d(-5f64..82.0, -4f64..9.0)?
            .set_secondary_coord(-5f64..82.0, -8f64..18.0);
        chart
            .configure_mesh()
            .x_desc("tip from the skin at rest, mm")
            .y_desc("force on the hand, N")
            .light_line_style(WHITE)
            .draw()?;
        chart.configure_secondary_axes().y_desc("gland, mm").draw()?;
        let mut named = vec![Phase::Outside];
        for run in samples.chunk_by(|a, b| a.phase == b.phase) {
            let ends = run.iter().map(|s| s.depth_mm);
            let (low, high) = (ends.clone().fold(f64::MAX, f64::min), ends.fold(f64::MIN, f64::max));
            let style = shade(run[0].phase).filled();
            let shaded = chart.draw_series([Rectangle::new([(low, -4.0), (high, 9.0)], style)])?;
            if !named.contains(&run[0].phase) {
                named.push(run[0].phase);
                shaded
                    .label(format!("{:?}", run[0].phase).to_lowercase())
                    .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 18, y + 5)], style));
            }
        }
        let force = samples.iter().map(|s| (s.depth_mm, s.force_n));
        chart
            .draw_series(LineSeries::new(force, FORCE.stroke_width(2)))?
            .label("force on the hand")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], FORCE.stroke_width(2)));
        let shift = samples.iter().map(|s| (s.depth_mm, s.shift_mm));
        chart
            .draw_secondary_series(LineSeries::new(shift, GLAND.stroke_width(1)))?
            .label("gland")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], GLAND.stroke_width(1)));
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.9))
            .border_style(BLACK.mix(0.3))
            .draw()?;
    }
    root.present()?;
    Ok(())
}
