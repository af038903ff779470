//! What a narrow tip moves near it, against integrals of Kelvin's solution.

use super::*;

const A: f64 = 0.635e-3;
const PATCH: f64 = 2.5e-3;

#[test]
fn a_stretch_of_shaft_is_moved_as_by_an_evenly_loaded_sphere() {
    let nu = 0.49;
    let near = NearTip::new(A, PATCH, nu);
    // Loads on the sphere's surface, each of which moves a place on the needle's.
    let by_sphere = |radius_m: f64, z_m: f64| {
        let count = 20_000;
        let each = (0..count).map(|n| {
            let up = 1.0 - 2.0 * (f64::from(n) + 0.5) / f64::from(count);
            let turn = 2.399_963_229_728_653 * f64::from(n);
            let (sine, cosine) = turn.sin_cos();
            let across = (1.0 - up * up).sqrt() * radius_m;
            let (x, y, z) = (across * cosine - A, across * sine, z_m - radius_m * up);
            let r = (x * x + y * y + z * z).sqrt();
            (3.0 - 4.0 * nu) / r + z * z / r.powi(3)
        });
        each.sum::<f64>() / f64::from(count)
    };
    let at_tip = (10.0 / 3.0 - 4.0 * nu) * (1.0 / A - 1.0 / PATCH);
    for from_m in [0.0_f64, 0.5e-3, 1.4e-3, 4e-3] {
        let to_m = from_m + 1.2e-3;
        let places = (0..24).map(|n| from_m + (f64::from(n) + 0.5) / 24.0 * (to_m - from_m));
        let wanted = places.map(|z_m| by_sphere(A, z_m) - by_sphere(PATCH, z_m)).sum::<f64>() / 24.0 / at_tip;
        let found = near.mean(from_m, to_m);
        assert!((found - wanted).abs() < 0.01, "{from_m}: {found} {wanted}");
        assert!((near.mean(-to_m, -from_m) - found).abs() < 1e-12);
    }
    // The table has steps.
    assert!((near.mean(-1e-6, 1e-6) - 1.0).abs() < 0.005);
}
