//! Twelve sectors of the target: base, middle and apex by quadrant.

use stylet_dose::Dvh;
use stylet_dose::Structure;

/// Thirds from the head to the feet.
const LEVELS: [&str; 3] = ["base", "mid", "apex"];
const QUADRANTS: [&str; 4] = ["anterior right", "anterior left", "posterior right", "posterior left"];
/// Definition of the sectors, for display.
pub const CUTS: &str = "Thirds of the length of the target along the patient's axis; quadrants by the planes through the middle of each \
    third. Patient frame (RAS).";

/// Dose of one sector.
#[derive(Clone, Debug, PartialEq)]
pub struct Sector {
    /// Name, such as "apex, posterior left".
    pub name: String,
    /// Volume, in m³.
    pub volume_m3: f64,
    /// Dose to 90 % of it, in Gy; `None` for one without volume.
    pub d90_gy: Option<f64>,
    /// Share of its volume at the prescription.
    pub v100: Option<f64>,
}

/// Returns the sectors of a target from the dose of each of its points.
pub fn of(target: &Structure, dose_gy: &[f64], prescription_gy: f64) -> Vec<Sector> {
    let (low, high) = target.bounds_m();
    let third_m = (high[2] - low[2]) / 3.0;
    let level = |p: &[f64; 3]| match third_m > 0.0 {
        true => (((high[2] - p[2]) / third_m) as usize).min(2),
        false => 0,
    };
    let mut middles = [[0.0; 3]; 3];
    for (p, volume) in target.points_m.iter().zip(&target.volumes_m3) {
        let middle = &mut middles[level(p)];
        middle[0] += p[0] * volume;
        middle[1] += p[1] * volume;
        middle[2] += volume;
    }
    let quadrant = |p: &[f64; 3]| {
        let [x, y, volume] = middles[level(p)];
        let (left, anterior) = (p[0] * volume < x, p[1] * volume > y);
        usize::from(left) + 2 * usize::from(!anterior)
    };
    let mut parts = vec![(Vec::new(), Vec::new()); 12];
    for ((p, volume), gy) in target.points_m.iter().zip(&target.volumes_m3).zip(dose_gy) {
        let part: &mut (Vec<f64>, Vec<f64>) = &mut parts[4 * level(p) + quadrant(p)];
        part.0.push(*gy);
        part.1.push(*volume);
    }
    let sector = |(n, (doses, volumes)): (usize, (Vec<f64>, Vec<f64>))| {
        let dvh = Dvh::new(&doses, &volumes);
        Sector {
            name: format!("{}, {}", LEVELS[n / 4], QUADRANTS[n % 4]),
            volume_m3: dvh.as_ref().map_or(0.0, Dvh::volume_m3),
            d90_gy: dvh.as_ref().and_then(|d| d.dose_of_gy(0.9 * d.volume_m3())),
            v100: dvh.as_ref().map(|d| d.at_least_m3(prescription_gy) / d.volume_m3()),
        }
    };
    parts.into_iter().enumerate().map(sector).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests a box with a dose that rises to the head, to the right and to the front.
    #[test]
    fn sectors_match_their_names() {
        let target = Structure::of_box("Prostate", [-0.02, 0.0, -0.03], [0.02, 0.04, 0.03], 1e-3);
        let dose: Vec<f64> = target
            .points_m
            .iter()
            .map(|p| 100.0 + 1e3 * (p[2] + p[0] + p[1]))
            .collect();
        let sectors = of(&target, &dose, 145.0);
        let all: f64 = sectors.iter().map(|s| s.volume_m3).sum();
        assert!((all - target.volume_m3()).abs() < 1e-9);
        for sector in &sectors {
            assert!((sector.volume_m3 / 8e-6 - 1.0).abs() < 0.02, "{sector:?}");
        }
        let d90 = |name: &str| sectors.iter().find(|s| s.name == name).unwrap().d90_gy.unwrap();
        // RAS: x rises to the patient's right.
        assert!((d90("base, anterior left") - d90("apex, anterior left") - 40.0).abs() < 1.0);
        assert!((d90("mid, anterior right") - d90("mid, anterior left") - 20.0).abs() < 1.0);
        assert!((d90("mid, anterior left") - d90("mid, posterior left") - 20.0).abs() < 1.0);
        let v100 = |name: &str| sectors.iter().find(|s| s.name == name).unwrap().v100.unwrap();
        assert!(v100("base, anterior right") > 0.9 && v100("apex, posterior left") == 0.0);
    }
}
