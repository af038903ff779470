//! Error of one model's tissue against another's.

use stylet_sim::tissue::Deformed;

/// Elements that the reference moves by less than this part of the tip's travel are not of the moved region.
pub const MOVED: f64 = 0.01;

/// Distances, by their RMS and largest.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spread {
    square_m2: f64,
    count: usize,
    pub max_m: f64,
}

impl Spread {
    fn add(&mut self, distance_m: f64) {
        self.square_m2 += distance_m * distance_m;
        self.count += 1;
        self.max_m = self.max_m.max(distance_m);
    }

    /// Adds those between `reference` and the displacements in metres by element, where the reference moves by more
    /// than [`MOVED`] of `travel_m`.
    pub fn add_field(&mut self, reference: &Field, moved_m: impl Fn(usize) -> [f64; 3], travel_m: f64) {
        for (e, &there) in reference.iter().enumerate() {
            if norm(there) > MOVED * travel_m {
                self.add(apart(there, moved_m(e)));
            }
        }
    }

    pub fn rms_m(&self) -> f64 {
        (self.square_m2 / self.count.max(1) as f64).sqrt()
    }
}

/// Distances between two models over the ticks compared: of all elements that move, and of the seeds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Error {
    pub all: Spread,
    pub seeds: Spread,
}

impl Error {
    /// Adds one tick: `reference` against displacements in metres, by element.
    pub fn add(&mut self, reference: &Field, moved_m: impl Fn(usize) -> [f64; 3], travel_m: f64, seeds: &[u32]) {
        self.all.add_field(reference, &moved_m, travel_m);
        for &seed in seeds {
            let e = seed as usize;
            self.seeds.add(apart(reference[e], moved_m(e)));
        }
    }
}

/// Displacements of one tick, in metres.
pub type Field = Vec<[f64; 3]>;

/// Returns the shift that comes nearest to a field where that moves, in metres: the mean there.
pub fn best_shift_m(field: &Field, travel_m: f64) -> [f64; 3] {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for u in field.iter().filter(|&&u| norm(u) > MOVED * travel_m) {
        (0..3).for_each(|a| sum[a] += u[a]);
        count += 1.0;
    }
    sum.map(|s| if count > 0.0 { s / count } else { 0.0 })
}

pub fn field(body: &Deformed) -> Field {
    let h = body.lattice.spacing_m;
    let elements = 0..body.lattice.element_count() as u32;
    elements.map(|e| body.displacement(e).map(|u| u * h)).collect()
}

/// The value below which a share `q` of them lies.
pub fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = (sorted.len().max(1) - 1) as f64 * q;
    sorted.get(place.round() as usize).copied().unwrap_or(f64::NAN)
}

/// The root of the mean square; not a number without values.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

pub fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    norm([0, 1, 2].map(|c| a[c] - b[c]))
}

/// Returns the largest displacement.
pub fn largest_m(field: &Field) -> f64 {
    field.iter().map(|&u| norm(u)).fold(0.0, f64::max)
}

pub fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_other_shift_comes_nearer_than_the_best() {
        let field: Field = (0..50)
            .map(|n| [1e-3 * f64::from(n % 7), -2e-4 * f64::from(n), 3e-3])
            .collect();
        let best_m = best_shift_m(&field, 0.01);
        let rms_m = |shift_m: [f64; 3]| {
            let mut spread = Spread::default();
            spread.add_field(&field, |_| shift_m, 0.01);
            spread.rms_m()
        };
        for axis in 0..3 {
            for by_m in [-1e-4, 1e-4] {
                let mut other_m = best_m;
                other_m[axis] += by_m;
                assert!(rms_m(other_m) > rms_m(best_m));
            }
        }
        assert!(rms_m(best_m) < rms_m([0.0; 3]));
    }
}
