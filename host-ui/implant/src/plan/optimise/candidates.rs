//! Choices of a search: holes with a free path, and places for seeds along them.

use crate::plan::check::SPARED_MARGIN_M;
use crate::plan::{Anatomy, Hole, ImplantPlan, Loading, Needle, NeedleSeed, SEED_LENGTH_M, SPACER_M, Template};
use std::ops::Range;

/// Distance between places along a needle, half the pitch of a strand.
pub const PLACE_PITCH_M: f64 = (SEED_LENGTH_M + SPACER_M) / 2.0;
/// Distance of needles from spared structures, in addition to the margin of the check.
const SPARED_M: f64 = 1e-3;
/// Distance of needles from bone.
const BONE_M: f64 = 1e-3;
/// Shortest path through the target that gets a needle.
const SHORTEST_M: f64 = 10e-3;
/// Distance of a needle's end from the target's edge, along it.
const INSIDE_M: f64 = 1.5e-3;
const STEP_M: f64 = 1e-3;

/// Hole that a needle can go through.
pub struct Way {
    /// The hole.
    pub hole: Hole,
    /// Range of its places, deepest first.
    pub places: Range<usize>,
}

/// Place for a seed.
pub struct Place {
    /// Index of its hole.
    pub way: usize,
    /// Distance from the hole, along the needle, m.
    pub along_m: f64,
    /// Scene frame, m.
    pub position_m: [f64; 3],
}

/// All holes with all places.
pub struct Candidates {
    template: Template,
    /// Holes, row by row.
    pub ways: Vec<Way>,
    /// Places, way by way.
    pub places: Vec<Place>,
}

impl Candidates {
    /// Returns every unused hole with enough target behind it that is reachable past bone and
    /// spared structures.
    pub fn new(template: &Template, anatomy: &Anatomy, used: &[Hole]) -> Self {
        let mut found = Self {
            template: *template,
            ways: Vec::new(),
            places: Vec::new(),
        };
        for hole in Hole::all().filter(|hole| !used.contains(hole)) {
            found.add(hole, anatomy);
        }
        found
    }

    fn add(&mut self, hole: Hole, anatomy: &Anatomy) {
        let (entry_m, inwards) = (self.template.hole_m(hole), self.template.inwards);
        let longest = |a: &[f64; 2], b: &[f64; 2]| (a[1] - a[0]).total_cmp(&(b[1] - b[0]));
        let pieces = anatomy.target.all_pieces_m(entry_m, inwards);
        let Some([from_m, to_m]) = pieces.into_iter().max_by(longest) else {
            return;
        };
        let at = |along_m: f64| [0, 1, 2].map(|a| entry_m[a] + inwards[a] * along_m);
        let is_rim = !is_inside(&self.template, anatomy, at((from_m + to_m) / 2.0));
        if to_m - from_m < SHORTEST_M || is_rim {
            return;
        }
        let free_until = |bodies: &[crate::plan::anatomy::Body], margin_m: f64| {
            // The tip goes half a seed deeper than the middle of the deepest one.
            let steps = ((to_m + 0.5 * SEED_LENGTH_M) / STEP_M) as usize;
            let is_blocked = |along_m: f64| bodies.iter().any(|b| b.is_near(at(along_m), inwards, margin_m));
            (0..=steps)
                .map(|s| s as f64 * STEP_M)
                .find(|along_m| is_blocked(*along_m))
        };
        if free_until(&anatomy.bone, BONE_M).is_some() {
            return;
        }
        // The needle may end before a spared structure.
        let spared_m = free_until(&anatomy.spared, SPARED_MARGIN_M + SPARED_M);
        let to_m = spared_m.map_or(to_m, |spared_m| to_m.min(spared_m - SEED_LENGTH_M));
        if to_m - from_m < SHORTEST_M {
            return;
        }
        let count = ((to_m - from_m) / PLACE_PITCH_M) as usize;
        let deepest_m = (from_m + to_m + count as f64 * PLACE_PITCH_M) / 2.0;
        let (way, first) = (self.ways.len(), self.places.len());
        self.places.extend((0..=count).map(|place| {
            let along_m = deepest_m - place as f64 * PLACE_PITCH_M;
            Place {
                way,
                along_m,
                position_m: at(along_m),
            }
        }));
        let places = first..self.places.len();
        self.ways.push(Way { hole, places });
    }

    /// Returns the unit vector along all needles.
    pub fn inwards(&self) -> [f64; 3] {
        self.template.inwards
    }

    /// Returns the plan whose seeds lie at the chosen places.
    pub fn plan(&self, chosen: &[bool], strength_u: f64, source: &str, prescription_gy: f64) -> ImplantPlan {
        let mut needles: Vec<Needle> = self
            .ways
            .iter()
            .filter_map(|way| self.needle(way, chosen, strength_u))
            .collect();
        // From anterior to posterior, as in practice: the part behind stays visible to the probe.
        needles.sort_by(|a, b| {
            let row = |needle: &Needle| needle.hole.map(Hole::row);
            row(b).cmp(&row(a)).then(a.hole.cmp(&b.hole))
        });
        ImplantPlan {
            template: self.template,
            source: source.to_owned(),
            prescription_gy,
            needles,
        }
    }

    fn needle(&self, way: &Way, chosen: &[bool], strength_u: f64) -> Option<Needle> {
        let places: Vec<usize> = way.places.clone().filter(|&place| chosen[place]).collect();
        let deepest_m = self.places[*places.first()?].along_m;
        let is_strand = places.len() > 1 && places.windows(2).all(|pair| pair[1] - pair[0] == 2);
        let seed = |&place: &usize| NeedleSeed {
            along_m: self.places[place].along_m,
            strength_u,
        };
        Some(Needle {
            hole: Some(way.hole),
            entry_m: self.template.hole_m(way.hole),
            direction: self.template.inwards,
            depth_m: deepest_m,
            retract_to_m: 0.0,
            loading: match is_strand {
                true => Loading::Stranded { spacer_m: SPACER_M },
                false => Loading::Loose,
            },
            seeds: places.iter().map(seed).collect(),
        })
    }
}

/// Returns whether all places around one across the needles lie in the target.
fn is_inside(template: &Template, anatomy: &Anatomy, place_m: [f64; 3]) -> bool {
    (0..8).all(|direction| {
        let (sine, cosine) = (f64::from(direction) * std::f64::consts::FRAC_PI_4).sin_cos();
        let across = [0, 1, 2].map(|a| template.columns[a] * cosine + template.rows[a] * sine);
        anatomy
            .target
            .contains([0, 1, 2].map(|a| place_m[a] + across[a] * INSIDE_M))
    })
}
