//! Holes for stabilising needles, which go in first and hold the gland while the others come and
//! go.

use super::template::{Hole, PITCH_M, Template};
use super::{Anatomy, Needle};
use nalgebra::Vector3;
use stylet_host::link::Link;
use stylet_procedure::NeedleWay;
use stylet_shm_schema::StabilisingNeedle;

/// Distance of a stabilising needle from the path of every needle of the plan, m.
const FROM_NEEDLES_M: f64 = 0.8 * PITCH_M;
/// Distance from spared structures.
const FROM_SPARED_M: f64 = 2e-3;
/// Distance from the target's side, halfway through it: a needle along the edge holds almost
/// nothing.
const FROM_SIDE_M: f64 = 5e-3;
/// Distance of its tip from the far side of the target, as a share of its path through it.
const SHORT: f64 = 0.2;
/// Shortest path through the target, m.
const LEAST_M: f64 = 10e-3;

/// Stabilising needle: its hole, and the place of its tip.
#[derive(Clone, Debug, PartialEq)]
pub struct Stabilising {
    /// Hole of the template.
    pub hole: Hole,
    /// Needle in the core's form.
    pub needle: StabilisingNeedle,
}

impl Stabilising {
    /// Returns the path of its tip.
    pub fn way(&self) -> NeedleWay {
        let (entry_m, direction) = (Vector3::from(self.needle.entry_m), Vector3::from(self.needle.direction));
        NeedleWay {
            entry_m,
            direction,
            drops_m: vec![entry_m + direction * self.needle.depth_m],
            retract_to_m: 0.0,
            strand_pitch_m: None,
        }
    }
}

/// Chooses at most `count` needles as far from each other as the holes allow, the first as far from
/// the centre of the target as possible. Returns fewer if no more holes are clear of the plan and
/// of spared structures.
pub fn stabilising(template: &Template, anatomy: &Anatomy, needles: &[Needle], count: usize) -> Vec<Stabilising> {
    let direction = template.inwards;
    let across_m = |a: [f64; 3], b: [f64; 3]| {
        let off = Vector3::from(a) - Vector3::from(b);
        let axis = Vector3::from(direction);
        (off - axis * off.dot(&axis)).norm()
    };
    let mut free: Vec<Stabilising> = Hole::all()
        .filter_map(|hole| at_hole(template, anatomy, hole))
        .filter(|found| {
            let beside = |needle: &Needle| across_m(needle.entry_m, found.needle.entry_m);
            needles.iter().all(|needle| beside(needle) >= FROM_NEEDLES_M)
        })
        .collect();
    let mut chosen: Vec<Stabilising> = Vec::new();
    while chosen.len() < count {
        let clear_m = |found: &Stabilising| {
            let to = chosen.iter().map(|c| across_m(c.needle.entry_m, found.needle.entry_m));
            match chosen.is_empty() {
                true => across_m(found.needle.entry_m, template.middle_m),
                false => to.fold(f64::INFINITY, f64::min),
            }
        };
        let best = (0..free.len()).max_by(|&a, &b| clear_m(&free[a]).total_cmp(&clear_m(&free[b])));
        let Some(best) = best.filter(|&best| chosen.is_empty() || clear_m(&free[best]) > 0.5 * PITCH_M) else {
            break;
        };
        chosen.push(free.remove(best));
    }
    chosen
}

fn at_hole(template: &Template, anatomy: &Anatomy, hole: Hole) -> Option<Stabilising> {
    let (entry_m, direction) = (template.hole_m(hole), template.inwards);
    let pieces = anatomy.target.all_pieces_m(entry_m, direction);
    let (first, last) = (pieces.first()?[0], pieces.last()?[1]);
    if last - first < LEAST_M {
        return None;
    }
    let halfway_m = 0.5 * (first + last);
    let is_inside = |[right, up]: [f64; 2]| {
        let off = |a: usize| right * template.columns[a] + up * template.rows[a];
        anatomy
            .target
            .contains([0, 1, 2].map(|a| entry_m[a] + direction[a] * halfway_m + FROM_SIDE_M * off(a)))
    };
    let sides = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
    if !sides.into_iter().all(is_inside) {
        return None;
    }
    let depth_m = last - SHORT * (last - first);
    let is_in_bone = |along_m: f64| {
        let place_m = [0, 1, 2].map(|a| entry_m[a] + direction[a] * along_m);
        anatomy
            .bone
            .iter()
            .any(|body| body.is_near(place_m, direction, FROM_SPARED_M))
    };
    let is_spared = anatomy
        .spared_in_the_way(entry_m, direction, depth_m, FROM_SPARED_M)
        .is_some();
    let steps = (depth_m / 1e-3) as usize;
    let is_clear = !is_spared && !(0..=steps).any(|n| is_in_bone(n as f64 * 1e-3));
    is_clear.then_some(Stabilising {
        hole,
        needle: StabilisingNeedle {
            entry_m,
            direction,
            depth_m,
        },
    })
}

/// Returns the number of the first needle that was left in, among those still in.
pub fn first_left(link: &Link) -> Option<u32> {
    let left = link.snapshot()?.header.left().first()?.number;
    u32::try_from(left).ok()
}

/// Returns whether a snapshot already shows the needles that stay in: it may be older than the
/// state that counts them.
pub fn shows_left(link: &Link) -> bool {
    let counts = link.snapshot().zip(link.state());
    counts.is_none_or(|(snapshot, state)| snapshot.header.left_count == state.left_count)
}
