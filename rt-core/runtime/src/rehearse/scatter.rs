//! Scatter of a needle about its planned axis before it meets tissue: offset at the hole, and deflection by template
//! and skin.

use nalgebra::Vector3;
use sha2::{Digest, Sha256};
use stylet_shm_schema::{NeedleRehearsal, ParameterId, ParameterSet};

/// Standard deviations in each direction across the needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    entry_m: f64,
    deflection_rad: f64,
    seed: u64,
}

impl Scatter {
    /// Returns the scatter of a parameter set; `None` if it is off.
    pub fn of(set: &ParameterSet) -> Option<Self> {
        let scatter = Scatter {
            entry_m: set.get(ParameterId::EntryScatter),
            deflection_rad: set.get(ParameterId::SkinDeflection),
            seed: set.get(ParameterId::ScatterSeed).round() as u64,
        };
        (scatter.entry_m > 0.0 || scatter.deflection_rad > 0.0).then_some(scatter)
    }

    /// Returns the needle as it goes in. The numbers depend only on the seed and on the planned axis, so neither the
    /// order of needles nor earlier rehearsals matter.
    pub fn apply(&self, run: &NeedleRehearsal) -> NeedleRehearsal {
        let (planned_m, along) = (Vector3::from(run.entry_m), Vector3::from(run.direction));
        let least = along.iamin();
        let mut other = Vector3::zeros();
        other[least] = 1.0;
        let first = (other - along * along.dot(&other)).normalize();
        let across = [first, along.cross(&first)];
        let [a, b, c, d] = self.normals(run);
        let beside_m = (across[0] * a + across[1] * b) * self.entry_m;
        let turned = along + across[0] * (c * self.deflection_rad).tan() + across[1] * (d * self.deflection_rad).tan();
        let (entry_m, direction) = (planned_m + beside_m, turned.normalize());
        let moved = |drop_m: &[f64; 3]| {
            let depth_m = (Vector3::from(*drop_m) - planned_m).dot(&along);
            (entry_m + direction * depth_m).into()
        };
        NeedleRehearsal {
            entry_m: entry_m.into(),
            direction: direction.into(),
            drops_m: run.drops_m.iter().map(moved).collect(),
            ..run.clone()
        }
    }

    /// Draws four normally distributed numbers.
    fn normals(&self, run: &NeedleRehearsal) -> [f64; 4] {
        let mut hash = Sha256::new();
        hash.update(self.seed.to_le_bytes());
        for value in run.entry_m.iter().chain(&run.direction) {
            hash.update(value.to_le_bytes());
        }
        let digest: [u8; 32] = hash.finalize().into();
        let (words, _) = digest.as_chunks::<8>();
        // In (0, 1].
        let even = |n: usize| ((u64::from_le_bytes(words[n]) >> 11) + 1) as f64 / (1_u64 << 53) as f64;
        let pair = |n: usize| {
            let (size, angle) = ((-2.0 * even(n).ln()).sqrt(), std::f64::consts::TAU * even(n + 1));
            [size * angle.cos(), size * angle.sin()]
        };
        let ([a, b], [c, d]) = (pair(0), pair(2));
        [a, b, c, d]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(x_m: f64) -> NeedleRehearsal {
        NeedleRehearsal {
            entry_m: [x_m, 0.02, 0.0],
            direction: [0.0, 0.0, 1.0],
            insert_m_per_s: 0.05,
            retract_m_per_s: 0.05,
            approach_m_per_s: 0.1,
            acceleration_m_per_s2: 2.0,
            retract_to_m: 0.0,
            strand_pitch_m: None,
            stabilising: Vec::new(),
            earlier: Vec::new(),
            as_points: false,
            drops_m: vec![[x_m, 0.02, 0.08]],
        }
    }

    fn scatter(seed: f64) -> Scatter {
        let mut set = ParameterSet::default();
        assert_eq!(Scatter::of(&set), None, "off by default");
        set.set(ParameterId::EntryScatter, 1.5e-3);
        set.set(ParameterId::SkinDeflection, 3.7_f64.to_radians());
        set.set(ParameterId::ScatterSeed, seed);
        Scatter::of(&set).expect("on")
    }

    #[test]
    fn the_same_seed_gives_a_needle_the_same_error_and_another_seed_another() {
        let planned = run(0.01);
        let first = scatter(1.0).apply(&planned);
        assert_eq!(first, scatter(1.0).apply(&planned));
        assert_ne!(first, scatter(2.0).apply(&planned));
        let apart = |to: [f64; 3], from: [f64; 3]| Vector3::from(to) - Vector3::from(from);
        assert_ne!(
            apart(first.entry_m, planned.entry_m),
            apart(scatter(1.0).apply(&run(0.02)).entry_m, run(0.02).entry_m)
        );
        assert!((Vector3::from(first.direction).norm() - 1.0).abs() < 1e-12);
        let depth_m = apart(first.drops_m[0], first.entry_m).norm();
        assert!((depth_m - 0.08).abs() < 1e-12, "as deep as planned");
    }

    /// Moreira 2018: 6.3 mm median over 188 insertions; the depth of 80 mm is assumed here.
    #[test]
    fn the_two_causes_give_what_was_measured_in_patients() {
        let mut beside_mm: Vec<f64> = (0..20_000)
            .map(|n| {
                let planned = run(1e-6 * f64::from(n));
                let (now, then) = (scatter(1.0).apply(&planned).drops_m[0], planned.drops_m[0]);
                1e3 * (now[0] - then[0]).hypot(now[1] - then[1])
            })
            .collect();
        beside_mm.sort_by(f64::total_cmp);
        let median = beside_mm[10_000];
        println!("median {median:.2} mm, 95 % below {:.1} mm", beside_mm[19_000]);
        assert!((median / 6.3 - 1.0).abs() < 0.03, "{median}");
    }
}
