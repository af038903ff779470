//! The probe in a small body and in the pelvis: what it must not do, and how it compares with the contact solved in
//! full.

use super::wall::Wall;
use super::*;
use crate::scene::{Labels, Material, Role, Scene, Structure, Surroundings, TissueKind};
use crate::tissue::fem::FemTissue;
use crate::tissue::fem::batch::BatchModel;
use std::sync::OnceLock;
use stylet_anatomy::Beyond;

mod hard;
mod lines;
mod oracle;
mod pelvis;
mod reference;

/// Adds up the displacement of the body by the loads.
fn displace(probe: &ReadyProbe, state: &mut ProbeState) {
    let loads_n = state.loads_n().to_vec();
    state.share.load(&probe.solved.columns, &loads_n);
}

/// A scene, the body that is solved for, and a probe in it.
pub(super) struct Fixture {
    pub scene: Scene,
    pub body: BatchModel<f32>,
    pub probe: ReadyProbe,
}

impl Fixture {
    pub fn new(scene: Scene, spacing_m: f64) -> Self {
        let solved_in = scene.clone();
        Fixture::solved_in(&solved_in, scene, spacing_m)
    }

    /// Solves in the body of another scene, of the same tissue in other elements.
    pub fn solved_in(other: &Scene, scene: Scene, spacing_m: f64) -> Self {
        let wall = Wall::of(&scene, spacing_m).expect("a rectum");
        Fixture::solved_for(other, scene, wall)
    }

    /// Solves for that wall.
    pub fn solved_for(other: &Scene, scene: Scene, wall: Wall) -> Self {
        let fem = FemTissue::<f32>::new(other).expect("valid");
        let body = BatchModel::new(&fem.model);
        drop(fem);
        let queue = ProbeQueue::new(&body, &scene.body, wall, ProbeShape::default()).expect("in the body");
        // The later half of the batches by a second thread.
        let half = queue.batches() / 2;
        let solve = |batches: std::ops::Range<usize>| {
            let mut room = queue.room(&body);
            let solved = batches.map(|batch| queue.solve(&body, batch, &mut room, &mut || true));
            solved.collect::<Option<Vec<_>>>().expect("not stopped")
        };
        let solved = std::thread::scope(|scope| {
            let later = scope.spawn(|| solve(half..queue.batches()));
            let first = solve(0..half);
            later.join().expect("solved").into_iter().chain(first).collect()
        });
        let probe = queue.finish(solved).expect("all are there");
        Fixture { scene, body, probe }
    }

    /// Returns a pose along z in the middle, so far above where it meets the wall, its tip so far beyond the target's
    /// middle.
    pub fn pose(&self, pressed_m: f64, beyond_m: f64) -> ProbePose {
        let probe = &self.probe;
        probe
            .wall
            .pose_below_target(&self.scene, &probe.shape, pressed_m, beyond_m)
    }

    /// Returns how far the axis in the middle of the hollow is above where it meets the wall.
    pub fn middle_m(&self) -> f64 {
        let heights = self.probe.wall.pads.iter().map(|p| p.place_m[1]);
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
        0.5 * (low + high) - self.pose(0.0, 0.0).tip_m[1]
    }

    /// Goes in from outside in the middle of the hollow, to where it meets the wall, then presses, in ticks at 50 mm/s.
    pub fn go_in_and_press(&self, state: &mut ProbeState, pressed_m: f64, beyond_m: f64) -> ProbeResponse {
        const TICK_M: f64 = 0.25e-3;
        let mut response = ProbeResponse::default();
        let outside_m = beyond_m - 0.12;
        for n in 0..=60 {
            let at = outside_m + (beyond_m - outside_m) * f64::from(n) / 60.0;
            response = step(&self.probe, state, &self.pose(self.middle_m(), at), &[]);
        }
        let down = (self.middle_m() / TICK_M).ceil() as i32;
        for n in 1..=down {
            let part = 1.0 - f64::from(n) / f64::from(down);
            response = step(&self.probe, state, &self.pose(part * self.middle_m(), beyond_m), &[]);
        }
        let ticks = (pressed_m / TICK_M).round() as i32;
        for n in 1..=ticks {
            response = step(&self.probe, state, &self.pose(f64::from(n) * TICK_M, beyond_m), &[]);
        }
        response
    }
}

/// Returns the same with pads that are closer than its elements are wide: all that forces on its wall can do to it.
pub(super) fn finely() -> &'static Fixture {
    static FINELY: OnceLock<Fixture> = OnceLock::new();
    FINELY.get_or_init(|| Fixture::new(block(true), 3.5e-3))
}

/// Returns a block of gland, a hollow of 28 x 20 mm in rectal wall below it, 4 mm elements: some thousand of them.
pub(super) fn small() -> &'static Fixture {
    static SMALL: OnceLock<Fixture> = OnceLock::new();
    SMALL.get_or_init(|| Fixture::new(block(true), 5e-3))
}

pub(super) fn block(is_hollow: bool) -> Scene {
    let scene = block_in([18, 16, 14], 1, is_hollow);
    scene.for_lines(TissueKind::ChainMail).expect("a model with lines")
}

/// Makes a block so many times 4 mm large, in so many cells for each 4 mm.
fn block_in(size: [usize; 3], times: usize, is_hollow: bool) -> Scene {
    let dims = size.map(|n| n * times);
    let mut cells = Vec::new();
    for _ in 0..dims[2] {
        for j in 0..dims[1] {
            for i in 0..dims[0] {
                let [i, j] = [i, j].map(|c| (c as f64 + 0.5) / times as f64);
                let from_middle = [i - size[0] as f64 / 2.0, j - 5.0];
                let across = (from_middle[0] / 3.5).powi(2) + (from_middle[1] / 2.5).powi(2);
                cells.push(match across {
                    a if a <= 1.0 && is_hollow => 0,
                    a if a <= 2.6 => 2,
                    _ => 1,
                });
            }
        }
    }
    let structure = |name: &str, label, role, beyond| Structure {
        name: name.to_owned(),
        label,
        role,
        material: Material {
            limits: None,
            fixed: false,
            surroundings: Surroundings::all(beyond),
            young_pa: 15e3,
            poisson: 0.45,
        },
    };
    let labels = Labels {
        dims,
        spacing_m: 4e-3 / times as f64,
        cells,
        structures: vec![
            structure("gland", 1, Role::Target, Beyond::Fat),
            structure("rectal wall", 2, Role::Spare, Beyond::Free),
        ],
    };
    Scene {
        // On springs, as the oracle has them.
        layers: Vec::new(),
        ..Scene::from_labels("block", &labels).expect("valid")
    }
}

#[test]
fn the_gap_is_that_of_a_round_shaft_with_half_a_ball_at_its_end() {
    let probe = ProbeShape { radius_m: 10e-3 };
    let pose = ProbePose::new([1e-3, 2e-3, 30e-3], [0.1, -0.2, 1.0]).expect("a pose");
    let axis = nalgebra::Vector3::from(pose.axis);
    let tip = nalgebra::Vector3::from(pose.tip_m);
    // Brute force: the nearest of many points of the axis behind the middle of the ball.
    for n in 0..500 {
        let f = f64::from(n);
        let point = tip + nalgebra::Vector3::new((f * 0.7).sin(), (f * 1.3).cos(), (f * 0.37).sin()) * 35e-3;
        let nearest = (0..20_000).map(|k| (point - tip + axis * (10e-3 + 5e-6 * f64::from(k))).norm());
        let distance_m = nearest.fold(f64::INFINITY, f64::min) - 10e-3;
        let (gap_m, outward) = probe.gap_m(&pose, point.into());
        assert!((gap_m - distance_m).abs() < 1e-8, "{gap_m} {distance_m}");
        // The gap grows fastest along the direction that is given.
        let (farther_m, _) = probe.gap_m(&pose, (point + nalgebra::Vector3::from(outward) * 1e-4).into());
        assert!((farther_m - gap_m - 1e-4).abs() < 1e-9);
    }
}

#[test]
fn a_scene_without_a_rectum_is_refused_with_words() {
    let paper = Scene::builtin("paper").expect("built in");
    let refused = Wall::of(&paper, 5e-3).expect_err("no rectum");
    assert_eq!(refused, NoWall::NoRectum);
    assert!(refused.to_string().contains("rectal wall"), "{refused}");
    assert_eq!(Wall::of(&block(false), 5e-3).expect_err("not hollow"), NoWall::NoRectum);
}

#[test]
fn pads_cover_the_wall_that_can_be_reached_once() {
    let fixture = small();
    let pads = &fixture.probe.wall.pads;
    let faces: usize = pads.iter().map(|p| p.faces.len()).sum();
    let area_m2: f64 = pads.iter().map(|p| p.area_m2).sum();
    assert!((area_m2 - faces as f64 * 16e-6).abs() < 1e-9);
    // The perimeter of the staircase is that of its box: 6 and 4 elements, on both sides, over 14.
    assert_eq!(faces, 2 * (6 + 4) * 14);
    for pad in pads {
        let length: f64 = pad.outward.iter().map(|c| c * c).sum();
        assert!((length - 1.0).abs() < 1e-9);
    }
}

/// Solved in cells of 2 mm, a body in elements of 4 mm is pressed as the one of 2 mm is: its force, and each element as
/// the cells in it.
#[test]
fn a_body_is_displaced_as_the_finer_one_that_was_solved_for() {
    const PRESSED_M: f64 = 4e-3;
    const BEYOND_M: f64 = 10e-3;
    let cells = block_in([14, 12, 10], 2, true);
    let coarse = cells.clone().for_lines(TissueKind::ChainMail).expect("has lines");
    let fine = cells.in_cells();
    assert!(coarse.body.spacing_m == 4e-3 && fine.body.spacing_m == 2e-3);
    let pressed = |fixture: &Fixture| {
        let mut state = ProbeState::new(&fixture.probe);
        let response = fixture.go_in_and_press(&mut state, PRESSED_M, BEYOND_M);
        displace(&fixture.probe, &mut state);
        (nalgebra::Vector3::from(response.wrench.force_n()), state.share)
    };
    let alone = Fixture::new(fine.clone(), 5e-3);
    let (force_n, field) = pressed(&alone);
    let (onto_n, onto_field) = pressed(&Fixture::solved_in(&fine, coarse.clone(), 5e-3));
    assert!(force_n.norm() > 0.5 && (onto_n - force_n).norm() < 1e-9 * force_n.norm());
    let onto = onto::ElementMap::new(&fine.body, &coarse.body);
    let mut room = crate::tissue::ElementField::zeros(coarse.body.element_count());
    let mean = onto.mean(&field, &mut room);
    let largest = mean.0.iter().flatten().fold(0.0_f32, |most, u| most.max(u.abs()));
    for (a, b) in mean.0.iter().flatten().zip(onto_field.0.iter().flatten()) {
        assert!((a - b).abs() < 1e-3 * largest, "{a} {b} of {largest}");
    }
    // In its own elements it is another press.
    let (coarse_n, _) = pressed(&Fixture::new(coarse.clone(), 5e-3));
    assert!(
        (coarse_n - force_n).norm() > 0.02 * force_n.norm(),
        "{coarse_n} {force_n}"
    );

    let (solved, wall) = (alone.probe.solved, alone.probe.wall);
    let is_taken = |change: &dyn Fn(&mut SolvedProbe)| {
        let mut other = solved.clone();
        change(&mut other);
        ReadyProbe::of_solved(other, &fine.body, wall.clone(), ProbeShape::default()).is_some()
    };
    assert!(is_taken(&|_| {}));
    assert!(!is_taken(&|other| other.between[3] = f32::INFINITY));
    assert!(!is_taken(&|other| other.shares[3] = f32::NAN));
    assert!(!is_taken(&|other| other.columns.truncate(7)));
    assert!(!is_taken(&|other| other.shares.truncate(7)));
    assert!(!is_taken(
        &|other| other.columns[0] = crate::tissue::PackedField::zeros(7)
    ));
    let other_body = ReadyProbe::of_solved(solved.clone(), &coarse.body, wall.clone(), ProbeShape::default());
    assert!(other_body.is_none());
}

/// Points that load the body themselves, against the contact at the same points solved in full, without pads that are
/// close enough.
#[test]
fn loaded_points_press_as_the_full_contact_does() {
    let scene = block(true);
    let wall = Wall::of(&scene, 5e-3).expect("a rectum").loaded_at_points();
    let fixture = Fixture::solved_for(&scene.clone(), scene, wall);
    let ([_, largest_m, _, worst_m], force_off) =
        reference::beside_reference(&fixture, &fixture.probe.wall, 5e-3, 10e-3);
    assert!(
        force_off < 0.01 && worst_m < 0.01 * largest_m,
        "{force_off}, {worst_m} of {largest_m}"
    );
}
