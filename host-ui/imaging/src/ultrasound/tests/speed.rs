//! Pictures per second, for `docs/imaging.md`.

use super::{block, field, plane, scanner};
use crate::ultrasound::{Settings, View};
use crate::{Metal, Needle, Tissue};
use nalgebra::Vector3;
use std::time::Instant;

#[test]
#[ignore = "a measurement, not a claim: cargo test --profile quick -p stylet-imaging pictures_a_second -- --ignored --nocapture"]
fn pictures_a_second() {
    let mut scanner = scanner();
    let body = block([Tissue::COUPLING, Tissue::SOFT, Tissue::GAS], |_| 1);
    let moved = |by: f64| field(move |p| Vector3::new(0.0, by, 0.2 * p.y * by));
    scanner.set_body(&body, &moved(0.0));
    let points_m = (0..=1)
        .map(|n| Vector3::new(5e-3, 30e-3, 10e-3 - 0.1 * f64::from(n)))
        .collect();
    let metal = Metal {
        needles: vec![Needle { points_m }],
        ..Metal::default()
    };
    for view in View::ALL {
        scanner.picture(&plane(view), &Settings::default(), &metal);
        scanner.wait();
        let before_ms = cpu_ms();
        let mut times: Vec<f64> = (0..60)
            .map(|n| {
                scanner.set_field(&moved(1e-5 * f64::from(n)));
                let start = Instant::now();
                scanner.picture(&plane(view), &Settings::default(), &metal);
                scanner.wait();
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        let cpu_ms = (cpu_ms() - before_ms) / 60.0;
        times.sort_by(f64::total_cmp);
        println!(
            "{}: p50 {:.1} ms, p90 {:.1} ms, most {:.1} ms; {cpu_ms:.1} ms of all processors",
            view.name(),
            times[30],
            times[54],
            times[59]
        );
    }
}

/// Returns the processor time of this process so far, in ms, independent of other programs, unlike
/// wall-clock time.
fn cpu_ms() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("a Linux process");
    let fields: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
    let ticks = |n: usize| fields[n].parse::<f64>().expect("ticks of 10 ms");
    (ticks(11) + ticks(12)) * 10.0
}
