//! Chosen places with their dose at the sample points, changed by moves that can be undone.

use super::candidates::Candidates;
use super::objective::{Limits, cost};
use super::samples::Samples;
use rayon::prelude::*;

/// Number of accepted moves after which the dose is summed again, because rounding adds up.
const REFRESH_EVERY: usize = 500;
/// Smallest number of moves that a thread tries.
const TRIED_TOGETHER: usize = 16;

/// Variables of a search.
#[derive(Clone)]
pub struct State<'a> {
    /// Holes and places.
    pub candidates: &'a Candidates,
    samples: &'a Samples,
    /// Strengths that can be ordered, U.
    strengths_u: &'a [f64],
    /// The limits.
    pub limits: Limits,
    /// True for each place with a seed.
    pub chosen: Vec<bool>,
    /// Indices of the places with a seed.
    pub seeds: Vec<usize>,
    /// Number of seeds of each hole.
    pub of_way: Vec<usize>,
    /// Number of holes with seeds.
    pub needles: usize,
    /// Index in the list of strengths.
    pub strength: usize,
    /// Cost of the present choice.
    pub cost: f32,
    of_one_u: Vec<f32>,
    tried: Vec<f32>,
    accepted: usize,
}

/// Change of a choice: places that lose and get a seed, and the new strength.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Move {
    /// Places that lose their seed.
    pub without: Vec<usize>,
    /// Places that get a seed.
    pub with: Vec<usize>,
    /// Index in the list of strengths.
    pub strength: usize,
}

impl<'a> State<'a> {
    /// Creates a state without seeds.
    pub fn empty(
        candidates: &'a Candidates,
        samples: &'a Samples,
        strengths_u: &'a [f64],
        strength: usize,
        limits: Limits,
    ) -> Self {
        let mut state = Self {
            candidates,
            samples,
            strengths_u,
            limits,
            chosen: vec![false; candidates.places.len()],
            seeds: Vec::new(),
            of_way: vec![0; candidates.ways.len()],
            needles: 0,
            strength,
            cost: 0.0,
            of_one_u: vec![0.0; samples.row_len()],
            tried: vec![0.0; samples.row_len()],
            accepted: 0,
        };
        state.refresh();
        state
    }

    /// Returns the strength, U.
    pub fn strength_u(&self) -> f64 {
        self.strengths_u[self.strength]
    }

    /// Returns the number of strengths to choose from.
    pub fn strengths(&self) -> usize {
        self.strengths_u.len()
    }

    /// Returns the dose at the sample points as a share of the prescription.
    pub fn dose(&self) -> Vec<f32> {
        let planned = &self.of_one_u[..self.samples.mean.start];
        planned.iter().map(|d| d * self.strength_u() as f32).collect()
    }

    /// Sets another strength for the same choice.
    pub fn set_strength(&mut self, strength: usize) {
        self.strength = strength;
        self.refresh();
    }

    /// Sets other limits for the same choice.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
        self.refresh();
    }

    /// Returns the cost after a move; `None` for one with too many needles. [`State::accept`]
    /// applies it.
    pub fn try_move(&mut self, change: &Move) -> Option<f32> {
        let mut tried = std::mem::take(&mut self.tried);
        let cost = self.cost_after(change, &mut tried);
        self.tried = tried;
        cost
    }

    /// Returns the best of these moves with its cost, the first of equal ones; `None` if none
    /// reduces the cost.
    pub fn best_of(&self, moves: &[Move]) -> Option<(usize, f32)> {
        let try_one = |tried: &mut Vec<f32>, change: &Move| self.cost_after(change, tried).unwrap_or(f32::INFINITY);
        let costs: Vec<f32> = moves
            .par_iter()
            .with_min_len(TRIED_TOGETHER)
            .map_init(|| vec![0.0; self.samples.row_len()], try_one)
            .collect();
        let least = costs.into_iter().enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
        (least.1 < self.cost - 1e-6).then_some(least)
    }

    /// Returns the cost after a move, whose dose is left in `tried`.
    fn cost_after(&self, change: &Move, tried: &mut [f32]) -> Option<f32> {
        let needles = self.needles_after(change);
        if needles > self.limits.needles {
            return None;
        }
        let row = |&place: &usize| self.samples.of_place(place);
        match (&change.without[..], &change.with[..]) {
            ([], []) => tried.copy_from_slice(&self.of_one_u),
            ([], [plus]) => add(tried, &self.of_one_u, row(plus)),
            ([minus], [plus]) => exchange(tried, &self.of_one_u, row(minus), row(plus)),
            (minus, plus) => {
                tried.copy_from_slice(&self.of_one_u);
                for row in minus.iter().map(row) {
                    tried.iter_mut().zip(row).for_each(|(sum, d)| *sum -= d);
                }
                for row in plus.iter().map(row) {
                    tried.iter_mut().zip(row).for_each(|(sum, d)| *sum += d);
                }
            }
        }
        let seeds = self.seeds.len() + change.with.len() - change.without.len();
        let strength_u = self.strengths_u[change.strength] as f32;
        Some(cost(self.samples, tried, strength_u, &self.limits, needles, seeds))
    }

    /// Applies the move that was tried last, with its cost.
    pub fn accept(&mut self, change: &Move, cost: f32) {
        std::mem::swap(&mut self.of_one_u, &mut self.tried);
        for &place in &change.without {
            self.chosen[place] = false;
            self.seeds.retain(|&other| other != place);
            self.of_way[self.candidates.places[place].way] -= 1;
        }
        for &place in &change.with {
            self.chosen[place] = true;
            self.seeds.push(place);
            self.of_way[self.candidates.places[place].way] += 1;
        }
        self.needles = self.of_way.iter().filter(|&&n| n > 0).count();
        (self.strength, self.cost) = (change.strength, cost);
        self.accepted += 1;
        if self.accepted.is_multiple_of(REFRESH_EVERY) {
            self.refresh();
        }
    }

    /// Tries a move and applies it if it reduces the cost.
    pub fn take_if_better(&mut self, change: &Move) -> bool {
        match self.try_move(change) {
            Some(cost) if cost < self.cost - 1e-6 => {
                self.accept(change, cost);
                true
            }
            _ => false,
        }
    }

    fn needles_after(&self, change: &Move) -> usize {
        let way = |&place: &usize| self.candidates.places[place].way;
        let count = |places: &[usize], of: usize| places.iter().filter(|p| way(p) == of).count();
        let mut needles = self.needles;
        let touched = || change.without.iter().chain(&change.with).map(way);
        for (n, of) in touched().enumerate() {
            if touched().take(n).any(|other| other == of) {
                continue;
            }
            let before = self.of_way[of];
            let after = before + count(&change.with, of) - count(&change.without, of);
            needles = needles + usize::from(after > 0) - usize::from(before > 0);
        }
        needles
    }

    fn refresh(&mut self) {
        self.of_one_u.copy_from_slice(&self.samples.present);
        for &place in &self.seeds {
            let row = self.samples.of_place(place);
            self.of_one_u.iter_mut().zip(row).for_each(|(sum, d)| *sum += d);
        }
        let strength_u = self.strength_u() as f32;
        self.cost = cost(
            self.samples,
            &self.of_one_u,
            strength_u,
            &self.limits,
            self.needles,
            self.seeds.len(),
        );
    }
}

fn add(to: &mut [f32], from: &[f32], plus: &[f32]) {
    for ((to, from), plus) in to.iter_mut().zip(from).zip(plus) {
        *to = from + plus;
    }
}

fn exchange(to: &mut [f32], from: &[f32], minus: &[f32], plus: &[f32]) {
    for (((to, from), minus), plus) in to.iter_mut().zip(from).zip(minus).zip(plus) {
        *to = from - minus + plus;
    }
}
