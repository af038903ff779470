//! Random numbers of an insertion: each quantity has its own stream, which follows from the id alone.

use crate::definition::{Gland, Study};
use crate::quantity::{Id, QUANTITIES, Scope};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use sha2::{Digest, Sha256};

/// One implant of a study: a gland, and the number of the draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Implant {
    /// Place among the glands of the study.
    pub gland: usize,
    /// Number, from 1.
    pub number: u32,
}

impl Implant {
    /// Returns the implant with that place among all of a study, from 0.
    pub fn at(study: &Study, place: usize) -> Self {
        let each = study.implants as usize;
        Self {
            gland: place / each,
            number: (place % each) as u32 + 1,
        }
    }

    /// Returns scene and plan.
    pub fn gland<'a>(&self, study: &'a Study) -> &'a Gland {
        &study.glands[self.gland]
    }

    /// Returns the beginning of the ids of its insertions.
    pub fn id(&self, study: &Study) -> String {
        let gland = self.gland(study);
        format!("{}/{}/{}/{:06}", study.name, gland.scene, gland.plan_name, self.number)
    }

    /// Returns the id of one insertion; needles count from 0 here and from 1 in the id.
    pub fn id_of_needle(&self, study: &Study, needle: usize) -> String {
        format!("{}/{:03}", self.id(study), needle + 1)
    }
}

/// Values drawn for one insertion.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Values in the order of [`QUANTITIES`], then the parameters of the study.
    pub values: Vec<f64>,
}

impl Drawn {
    /// Draws the values for one needle, from 0, of an implant.
    pub fn of(study: &Study, implant: Implant, needle: usize) -> Self {
        let (of_implant, of_needle) = (implant.id(study), implant.id_of_needle(study, needle));
        let quantities = QUANTITIES.iter().zip(&study.quantities).map(|(quantity, spread)| {
            let id = match quantity.scope {
                Scope::Implant => &of_implant,
                Scope::Needle => &of_needle,
            };
            spread.draw(&mut stream(study.seed, id, quantity.key))
        });
        let parameters = study.parameters.iter();
        let parameters = parameters.map(|(spec, spread)| spread.draw(&mut stream(study.seed, &of_implant, spec.key)));
        Self {
            values: quantities.chain(parameters).collect(),
        }
    }

    /// Returns the value of a quantity.
    pub fn get(&self, id: Id) -> f64 {
        self.values[id as usize]
    }

    /// Values of the parameters of the study, in its order.
    pub fn parameters(&self) -> &[f64] {
        &self.values[QUANTITIES.len()..]
    }
}

/// Makes the stream of random numbers of a quantity, so that one added to a study changes no other.
fn stream(seed: u64, id: &str, key: &str) -> ChaCha8Rng {
    let mut sum = Sha256::new();
    sum.update(seed.to_le_bytes());
    for part in [id, key] {
        sum.update((part.len() as u64).to_le_bytes());
        sum.update(part);
    }
    ChaCha8Rng::from_seed(sum.finalize().into())
}
