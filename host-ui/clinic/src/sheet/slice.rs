//! A slice through an implant, as SVG: outlines of the structures, isodose lines and seeds in the
//! middle plane of the target across the patient's axis.

use plotters::prelude::*;
use stylet_dose::{DosePoints, Seed, Structure};
use stylet_report::picture::{BLUE, DrawError, GREEN, INK, ORANGE, PURPLE, axes, drawn};
use stylet_surfaces::mesh::cut::{Sides, cut};

/// Distance between two points of the plane, and its margin around the target, m.
const STEP_M: f64 = 0.75e-3;
const MARGIN_M: f64 = 11e-3;
/// Distance from the plane within which a seed is drawn, m: half its length.
const SEED_REACH_M: f64 = 2.25e-3;
/// Dashes and gaps of a line, pixels.
type Dashes = (i32, i32);
/// Drawn doses, as shares of the prescription, with their colours and dashes.
const LEVELS: [(f64, RGBColor, Option<Dashes>); 4] = [
    (0.5, BLUE, Some((2, 3))),
    (1.0, GREEN, None),
    (1.5, ORANGE, Some((6, 3))),
    (2.0, PURPLE, Some((3, 2))),
];

/// Place in the plane: towards the patient's left and anterior, mm from the middle of the target.
type Place = (f64, f64);

/// Lines and seeds in the plane.
#[derive(Clone, Debug)]
pub struct Slice {
    target: Vec<Vec<Place>>,
    others: Vec<Vec<Place>>,
    isodoses: Vec<Vec<Vec<Place>>>,
    seeds: Vec<Place>,
    half_mm: f64,
}

/// Plane of points about the middle of a target, patient frame, m.
struct Plane {
    middle_m: [f64; 3],
    side: usize,
}

impl Plane {
    fn about(target: &Structure) -> Self {
        let (low, high) = target.bounds_m();
        let half_m = (0..2).map(|a| 0.5 * (high[a] - low[a])).fold(0.0, f64::max) + MARGIN_M;
        Self {
            middle_m: [0, 1, 2].map(|a| 0.5 * (low[a] + high[a])),
            side: (2.0 * half_m / STEP_M).ceil() as usize + 1,
        }
    }

    fn half_m(&self) -> f64 {
        0.5 * (self.side - 1) as f64 * STEP_M
    }

    fn points_m(&self) -> Vec<[f64; 3]> {
        let [x, y, z] = self.middle_m;
        let along = |n: usize| n as f64 * STEP_M - self.half_m();
        (0..self.side * self.side)
            .map(|n| [x + along(n % self.side), y + along(n / self.side), z])
            .collect()
    }

    /// Returns how much of the plane about each point is inside, from the points of a structure near
    /// it: 0 to 1.
    fn covered(&self, structure: &Structure) -> Vec<f64> {
        let mut covered = vec![0.0; self.side * self.side];
        let whole_m3 = structure.volumes_m3.iter().copied().fold(0.0, f64::max);
        // Three cells wide, so that scattered points make an even field.
        let reach_m = (3.0 * whole_m3.cbrt()).max(STEP_M);
        let share = |off_m: f64| (1.0 - off_m.abs() / reach_m).max(0.0);
        for (p, volume_m3) in structure.points_m.iter().zip(&structure.volumes_m3) {
            let off_m = [0, 1, 2].map(|a| p[a] - self.middle_m[a]);
            let in_plane = share(off_m[2]);
            if in_plane == 0.0 {
                continue;
            }
            let near = |a: usize| {
                let at = |m: f64| ((off_m[a] + m + self.half_m()) / STEP_M).clamp(0.0, self.side as f64);
                at(-reach_m).ceil() as usize..at(reach_m).ceil() as usize
            };
            for (i, j) in near(1).flat_map(|j| near(0).map(move |i| (i, j))) {
                let away_m = |n: usize, a: usize| n as f64 * STEP_M - self.half_m() - off_m[a];
                covered[j * self.side + i] +=
                    volume_m3 / reach_m.powi(3) * in_plane * share(away_m(i, 0)) * share(away_m(j, 1));
            }
        }
        covered
    }

    /// Returns the lines on which values at the points have a level: the plane, raised by them, cut
    /// at that height.
    fn lines(&self, values: &[f64], level: f64) -> Vec<Vec<Place>> {
        let mm = |n: usize| ((n as f64 * STEP_M - self.half_m()) * 1e3) as f32;
        let raised = |(n, value): (usize, &f64)| [mm(n % self.side), mm(n / self.side), *value as f32];
        let points: Vec<[f32; 3]> = values.iter().enumerate().map(raised).collect();
        let corner = |i: usize, j: usize| (j * self.side + i) as u32;
        let squares = (1..self.side).flat_map(|j| (1..self.side).map(move |i| (i, j)));
        let triangles: Vec<[u32; 3]> = squares
            .flat_map(|(i, j)| {
                let [a, b] = [corner(i - 1, j - 1), corner(i, j)];
                [[a, corner(i, j - 1), b], [a, b, corner(i - 1, j)]]
            })
            .collect();
        let lines = cut(&points, &triangles, &Sides::of(&points, [0.0, 0.0, 1.0], level as f32));
        let seen = |p: [f32; 3]| (-f64::from(p[0]), f64::from(p[1]));
        lines
            .into_iter()
            .map(|line| line.into_iter().map(seen).collect())
            .collect()
    }
}

impl Slice {
    /// Creates the slice through the target among structures in the patient's frame (RAS);
    /// `dose_gy` returns the dose of points.
    pub fn of(
        structures: &[Structure],
        target: usize,
        seeds: &[Seed],
        prescription_gy: f64,
        dose_gy: &dyn Fn(&DosePoints) -> Vec<f64>,
    ) -> Option<Self> {
        let plane = Plane::about(structures.get(target).filter(|s| !s.points_m.is_empty())?);
        let outline = |s: &Structure| plane.lines(&plane.covered(s), 0.5);
        let others = structures.iter().enumerate().filter(|(n, _)| *n != target);
        // Its logarithm is nearly linear between points, unlike the dose itself.
        let doses: Vec<f64> = dose_gy(&DosePoints::new(&plane.points_m()))
            .iter()
            .map(|gy| (gy / prescription_gy).max(1e-6).ln())
            .collect();
        let [x, y, z] = plane.middle_m;
        let near = seeds.iter().filter(|s| (s.position_m[2] - z).abs() <= SEED_REACH_M);
        Some(Self {
            target: outline(&structures[target]),
            others: others.flat_map(|(_, s)| outline(s)).collect(),
            isodoses: LEVELS.map(|(share, ..)| plane.lines(&doses, share.ln())).into(),
            seeds: near
                .map(|s| ((x - s.position_m[0]) * 1e3, (s.position_m[1] - y) * 1e3))
                .collect(),
            half_mm: plane.half_m() * 1e3,
        })
    }

    /// Draws the slice.
    ///
    /// # Errors
    /// Where the picture cannot be drawn.
    pub fn picture(&self, size: (u32, u32)) -> Result<String, DrawError> {
        drawn(size, |root| {
            root.fill(&WHITE)?;
            let half = self.half_mm;
            let mut chart = ChartBuilder::on(root)
                .margin(6)
                .x_label_area_size(34)
                .y_label_area_size(44)
                .build_cartesian_2d(-half..half, -half..half)?;
            let whole = |mm: &f64| format!("{mm:.0}");
            axes(
                &mut chart,
                ["right – left (mm)", "posterior – anterior (mm)"],
                |mesh| {
                    mesh.x_labels(5).y_labels(5);
                    mesh.x_label_formatter(&whole).y_label_formatter(&whole);
                },
            )?;
            let others = self.others.iter().map(|line| (line, INK.stroke_width(1)));
            for (line, style) in others.chain(self.target.iter().map(|line| (line, INK.stroke_width(2)))) {
                chart.draw_series([PathElement::new(line.clone(), style)])?;
            }
            for ((_, colour, dashes), lines) in LEVELS.iter().zip(&self.isodoses) {
                for line in lines {
                    match *dashes {
                        Some((on, off)) => {
                            let line = line.iter().copied();
                            chart.draw_series(DashedLineSeries::new(line, on, off, colour.stroke_width(1)))?
                        }
                        None => chart.draw_series(LineSeries::new(line.clone(), colour.stroke_width(1)))?,
                    };
                }
            }
            chart.draw_series(self.seeds.iter().map(|seed| Circle::new(*seed, 2, INK.filled())))?;
            Ok(())
        })
    }

    /// Returns what the lines of a picture mean, each with its colour as in a style sheet.
    pub fn legend() -> impl Iterator<Item = (String, String)> {
        LEVELS.iter().map(|(share, colour, dashes)| {
            let RGBColor(red, green, blue) = colour;
            let line = if dashes.is_some() { "dashed" } else { "solid" };
            (
                format!("{:.0} %", share * 100.0),
                format!("border-top:2px {line} rgb({red},{green},{blue})"),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area_mm2(line: &[Place]) -> f64 {
        let twice: f64 = line.windows(2).map(|w| w[0].0 * w[1].1 - w[1].0 * w[0].1).sum();
        0.5 * twice.abs()
    }

    /// Tests a box beside the origin, and a dose that falls evenly with the distance from its middle.
    #[test]
    fn outline_and_isodose_lines_enclose_the_right_areas() {
        let middle_m = [0.05, -0.02, 0.01];
        let [low, high] = [-0.016, 0.016].map(|m| middle_m.map(|c| c + m));
        let structures = [Structure::of_box("Prostate", low, high, 1e-3)];
        let seed = |dz: f64| Seed {
            position_m: [0.058, -0.02, 0.01 + dz],
            axis: None,
            strength_u: 1.0,
        };
        let dose_gy = |points: &DosePoints| vec![0.0; points.dose_gy().len()];
        let plane = Plane::about(&structures[0]);
        let falls = |points: &DosePoints| -> Vec<f64> {
            let away = |p: &[f64; 3]| (p[0] - middle_m[0]).hypot(p[1] - middle_m[1]);
            assert_eq!(points.dose_gy().len(), plane.side.pow(2));
            plane
                .points_m()
                .iter()
                .map(|p| 145.0 * (1.0 - 50.0 * away(p)))
                .collect()
        };
        let slice = Slice::of(&structures, 0, &[seed(1e-3), seed(4e-3)], 145.0, &falls).unwrap();
        let [outline] = &slice.target[..] else {
            panic!("{:?}", slice.target)
        };
        assert_eq!(outline.first(), outline.last(), "closed");
        let area = area_mm2(outline);
        // The corners are rounded.
        assert!((area / 1024.0 - 1.0).abs() < 0.03, "{area} mm²");
        // Half of the dose at 10 mm.
        let [half] = &slice.isodoses[0][..] else {
            panic!("one line")
        };
        assert!((area_mm2(half) / (100.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
        assert!(slice.isodoses[2].is_empty(), "nowhere 150 %");
        // The seed in the plane, to the patient's right and so on the left of the picture.
        assert_eq!(slice.seeds.len(), 1);
        // The middle is that of points, each anywhere in its cell.
        let x_mm = slice.seeds[0].0;
        assert!((x_mm + 8.0).abs() <= 0.5, "{x_mm} mm");
        assert!(slice.picture((300, 300)).unwrap().starts_with("<svg"));
        assert!(Slice::of(&structures, 1, &[], 145.0, &dose_gy).is_none());
    }
}
