//! How far one model's tissue is from another's.

use stylet_sim::tissue::Deformed;

/// Elements that the reference moves by less than this part of the tip's travel are not of the moved region.
const MOVED: f64 = 0.01;

/// Sums of squared distances between two models, over the ticks compared.
#[derive(Clone, Debug, Default)]
pub struct Error {
    squares_m2: f64,
    count: usize,
    max_m: f64,
    seed_squares_m2: f64,
    seed_count: usize,
    seed_max_m: f64,
}

/// Displacements of one tick, in metres.
pub type Field = Vec<[f64; 3]>;

pub fn field(body: &Deformed) -> Field {
    let h = body.lattice.spacing_m;
    let elements = 0..body.lattice.element_count() as u32;
    elements.map(|e| body.displacement(e).map(|u| u * h)).collect()
}

impl Error {
    /// Adds one tick: `reference` against the body as it is, where the reference has moved.
    pub fn add(&mut self, reference: &Field, body: &Deformed, travel_m: f64, seeds: &[u32]) {
        let h = body.lattice.spacing_m;
        let apart = |e: usize| {
            let u = body.displacement(e as u32);
            norm([0, 1, 2].map(|a| h * u[a] - reference[e][a]))
        };
        for (e, &there) in reference.iter().enumerate() {
            if norm(there) > MOVED * travel_m {
                let d = apart(e);
                self.squares_m2 += d * d;
                self.count += 1;
                self.max_m = self.max_m.max(d);
            }
        }
        for &seed in seeds {
            let d = apart(seed as usize);
            self.seed_squares_m2 += d * d;
            self.seed_count += 1;
            self.seed_max_m = self.seed_max_m.max(d);
        }
    }

    pub fn rms_m(&self) -> f64 {
        (self.squares_m2 / self.count.max(1) as f64).sqrt()
    }

    pub fn max_m(&self) -> f64 {
        self.max_m
    }

    pub fn seed_rms_m(&self) -> f64 {
        (self.seed_squares_m2 / self.seed_count.max(1) as f64).sqrt()
    }

    pub fn seed_max_m(&self) -> f64 {
        self.seed_max_m
    }
}

pub fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}
