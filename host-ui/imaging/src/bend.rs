//! The shape of a needle that bends.

use stylet_shm_schema::{MAX_BEND_POINTS, SnapshotHeader};

/// Offsets of the shaft from a rigid needle, from the tip back to the hand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bend {
    bends_m: Vec<[f64; 3]>,
    spacing_m: f64,
}

impl Bend {
    /// Forgets the bend: the needle is straight.
    pub fn clear(&mut self) {
        self.bends_m.clear();
    }

    /// Takes the bend of a snapshot; an invalid one is straight.
    pub fn take(&mut self, header: &SnapshotHeader) {
        let is_usable = header.bend_spacing_m > 0.0 && header.bend_spacing_m.is_finite();
        let bends_m = header.bends_m();
        let is_whole = bends_m.iter().flatten().all(|c| c.is_finite()) && bends_m.len() <= MAX_BEND_POINTS;
        self.bends_m.clear();
        if is_usable && is_whole {
            self.bends_m.extend_from_slice(bends_m);
            self.spacing_m = header.bend_spacing_m;
        }
    }

    /// Returns places along the needle from the tip to `length_m` behind it, scene frame; two if it
    /// does not bend.
    pub fn points_m(&self, tip_m: [f64; 3], direction: [f64; 3], length_m: f64) -> Vec<[f64; 3]> {
        let at = |back_m: f64, bend_m: [f64; 3]| [0, 1, 2].map(|a| tip_m[a] - back_m * direction[a] + bend_m[a]);
        if self.bends_m.len() < 2 {
            return vec![at(0.0, [0.0; 3]), at(length_m, [0.0; 3])];
        }
        let backs = (0_u32..).map(|n| f64::from(n) * self.spacing_m);
        let whole = backs.zip(&self.bends_m).take_while(|(back_m, _)| *back_m < length_m);
        let mut points: Vec<_> = whole.map(|(back_m, bend_m)| at(back_m, *bend_m)).collect();
        // The last piece ends where the drawn needle does.
        if let Some(pair) = self
            .bends_m
            .get(points.len().saturating_sub(1)..)
            .filter(|rest| rest.len() > 1)
        {
            let part = length_m / self.spacing_m - (points.len() as f64 - 1.0);
            points.push(at(
                length_m,
                [0, 1, 2].map(|a| pair[0][a] + part * (pair[1][a] - pair[0][a])),
            ));
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    const TIP_M: [f64; 3] = [0.03, 0.02, 0.08];

    #[test]
    fn a_needle_that_does_not_bend_has_two_ends() {
        let points = Bend::default().points_m(TIP_M, [0.0, 0.0, 1.0], 0.12);
        assert_eq!(points.len(), 2);
        assert_eq!(points[0], TIP_M);
        assert!((points[1][2] + 0.04).abs() < 1e-12);
    }

    #[test]
    fn a_bent_needle_is_as_long_as_a_straight_one() {
        let mut header = SnapshotHeader::zeroed();
        (header.bend_count, header.bend_spacing_m) = (MAX_BEND_POINTS as u32, 0.2 / 15.0);
        for (n, bend_m) in header.bend_m.iter_mut().enumerate() {
            *bend_m = [1e-3 * (1.0 - n as f64 / 15.0), 0.0, 0.0];
        }
        let mut bend = Bend::default();
        bend.take(&header);
        let points = bend.points_m(TIP_M, [0.0, 0.0, 1.0], 0.12);
        assert!((points[0][0] - TIP_M[0] - 1e-3).abs() < 1e-12, "{points:?}");
        let last = points.last().unwrap();
        assert!(
            (last[2] + 0.04).abs() < 1e-12 && (last[0] - TIP_M[0] - 0.4e-3).abs() < 1e-12,
            "{last:?}"
        );
        assert_eq!(points.len(), 10);
        header.bend_m[3][1] = f64::NAN;
        bend.take(&header);
        assert_eq!(
            bend.points_m(TIP_M, [0.0, 0.0, 1.0], 0.12).len(),
            2,
            "invalid places are not drawn"
        );
    }
}
