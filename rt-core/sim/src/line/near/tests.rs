//! What a narrow tip moves near it, against integrals of Kelvin's solution.

use super::*;

const A: f64 = 0.635e-3;
const PATCH: f64 = 2.5e-3;
const CUBE: f64 = CUBE_PER_RADIUS * PATCH;

#[test]
fn a_stretch_of_shaft_is_moved_as_by_a_loaded_sphere_less_a_cube() {
    let nu = 0.49;
    let near = NearTip::new(A, PATCH, nu);
    let by_load = |x: f64, y: f64, z: f64| {
        let r = (x * x + y * y + z * z).sqrt();
        (3.0 - 4.0 * nu) / r + z * z / r.powi(3)
    };
    // Loads on the sphere's surface, each of which moves a place on the needle's.
    let by_sphere = |radius_m: f64, z_m: f64| {
        let count = 20_000;
        let each = (0..count).map(|n| {
            let up = 1.0 - 2.0 * (f64::from(n) + 0.5) / f64::from(count);
            let turn = 2.399_963_229_728_653 * f64::from(n);
            let (sine, cosine) = turn.sin_cos();
            let across = (1.0 - up * up).sqrt() * radius_m;
            by_load(across * cosine - A, across * sine, z_m - radius_m * up)
        });
        each.sum::<f64>() / f64::from(count)
    };
    // Loads all over the cube.
    let by_cube = |z_m: f64| {
        let count = 30;
        let at = |n: u32| (f64::from(n % count) + 0.5) / f64::from(count) * CUBE - 0.5 * CUBE;
        let each = (0..count.pow(3)).map(|n| by_load(at(n) - A, at(n / count), z_m - at(n / count / count)));
        each.sum::<f64>() / f64::from(count.pow(3))
    };
    let at_tip = (10.0 / 3.0 - 4.0 * nu) * (1.0 / A - 1.0 / PATCH);
    for from_m in [0.0_f64, 0.5e-3, 1.4e-3, 4e-3] {
        let to_m = from_m + 1.2e-3;
        let places = (0..24).map(|n| from_m + (f64::from(n) + 0.5) / 24.0 * (to_m - from_m));
        let wanted = places.map(|z_m| by_sphere(A, z_m) - by_cube(z_m)).sum::<f64>() / 24.0 / at_tip;
        let found = near.mean(from_m, to_m);
        assert!((found - wanted).abs() < 0.01, "{from_m}: {found} {wanted}");
        assert!((near.mean(-to_m, -from_m) - found).abs() < 1e-12);
    }
    // The table has steps.
    let middle = (by_sphere(A, 0.0) - by_cube(0.0)) / at_tip;
    assert!((near.mean(-1e-6, 1e-6) - middle).abs() < 0.01, "{middle}");
}
