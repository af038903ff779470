//! Computes the dose of an implant of iodine seeds in a gland of 34 cc by TG-43U1, and the figures that clinicians quote.
//!
//! ```text
//! cargo run --release -p stylet-dose --example dose_of_an_implant
//! ```

use std::error::Error;

use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, DosePoints, Dvh, Metric, Region, Seed, Source, Structure};

/// Semi-axes of an ellipsoid around the origin, m.
struct Ellipsoid([f64; 3]);

impl Ellipsoid {
    /// Returns 1 on the surface, less inside.
    fn level(&self, point_m: [f64; 3]) -> f64 {
        (0..3).map(|axis| (point_m[axis] / self.0[axis]).powi(2)).sum()
    }
}

impl Region for Ellipsoid {
    fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        (self.0.map(|half| -half), self.0)
    }

    fn contains(&self, point_m: [f64; 3]) -> bool {
        self.level(point_m) <= 1.0
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    const PRESCRIPTION_GY: f64 = 145.0;
    const STRENGTH_U: f64 = 0.6;
    const PITCH_M: f64 = 1e-3;
    let gland = Ellipsoid([22e-3, 17e-3, 22e-3]);
    let source = Source::known("6711").ok_or("the source comes with the program")?;
    let kernel = DoseKernel::new(&source, Interval::ALL);

    // Needles along z, 10 mm apart and none through the urethra; seeds 7 mm apart on each.
    let places = |half: i32, pitch_m: f64| (-half..=half).map(move |n| pitch_m * f64::from(n));
    let mut seeds = Vec::new();
    for x in places(2, 10e-3) {
        for y in places(1, 10e-3) {
            for z in places(3, 7e-3) {
                let position_m = [x, y, z];
                let is_in_urethra = x == 0.0 && y == 0.0;
                if gland.level(position_m) <= 1.1 && !is_in_urethra {
                    seeds.push(Seed {
                        position_m,
                        axis: Some([0.0, 0.0, 1.0]),
                        strength_u: STRENGTH_U,
                    });
                }
            }
        }
    }

    let prostate = Structure::of_region("prostate", &gland, PITCH_M);
    let urethra = Structure::of_box("urethra", [-2e-3, -2e-3, -22e-3], [2e-3, 2e-3, 22e-3], PITCH_M);
    println!(
        "{} seeds of {STRENGTH_U} U, {PRESCRIPTION_GY} Gy prescribed",
        seeds.len()
    );
    for (structure, metrics) in [
        (&prostate, ["D90", "V100", "V150", "V200"].as_slice()),
        (&urethra, ["D10", "D30"].as_slice()),
    ] {
        println!("{}, {:.1} cc", structure.name, 1e6 * structure.volume_m3());
        let dose_gy = DosePoints::new(&structure.points_m).of_seeds_gy(&kernel, &seeds);
        let dvh = Dvh::new(&dose_gy, &structure.volumes_m3).ok_or("a structure without points")?;
        for name in metrics {
            let metric = Metric::parse(name)?;
            let value = metric.of(&dvh, PRESCRIPTION_GY).main().unwrap_or(f64::NAN);
            let unit = if metric.unit() == "gy" { "Gy" } else { "%" };
            println!("  {name:5} {value:7.1} {unit}");
        }
    }
    Ok(())
}
