//! A needle's line in a body that is solved far beyond what ships, behind the same law of contact.

use crate::error::Field;
use std::sync::Arc;
use stylet_sim::force::ForceParameters;
use stylet_sim::force::chain::ChainParameters;
use stylet_sim::line::{Column, Compliance, HandLine, LayerForces, Load, StationSettings, Stations};
use stylet_sim::needle::NeedleParameters;
use stylet_sim::scene::{Lattice, Scene};
use stylet_sim::tissue::fem::Compiled;
use stylet_sim::tissue::fem::batch::{BatchModel, BatchState, LOADS, NodeWeight};
use stylet_sim::tissue::{ElementField, FemTissue, PackedField};

/// Nearly incompressible tissue next to bone takes hundreds.
const MOST_ITERATIONS: u32 = 600;

/// The same needle on the same way, with another answer of the body.
pub struct Twin {
    /// Contact, friction and membranes, as in the force loop.
    pub hand: HandLine,
    /// The body that was solved.
    pub body: Arc<Lattice>,
    columns: Vec<PackedField>,
    /// Largest residual over load of a column.
    pub residual: f64,
}

/// Stations of the twin, and the residual that it is solved to.
#[derive(Clone, Copy, Debug)]
pub struct TwinSettings {
    /// Spacing of the stations, radii of needle and tip.
    pub stations: StationSettings,
    /// Stations at most: those of the line that it is compared with.
    pub most: usize,
    /// Residual over load of every column.
    pub tolerance: f64,
    /// Structure that a membrane moves as a whole, in a body that something holds. `None`: the body on its springs.
    pub whole_of: Option<u8>,
}

impl Twin {
    /// Solves every column of `like`'s way in the unchanged `scene`.
    ///
    /// # Panics
    ///
    /// If the scene has no finite elements, or none on the way.
    pub fn of<T: Compiled>(scene: &Scene, like: &HandLine, settings: TwinSettings) -> Self {
        let fem = FemTissue::<T>::new(scene)
            .expect("materials of a scene that was built")
            .model;
        let batch = BatchModel::<T>::new(&fem);
        let stations = Stations::along(&batch, *like.line(), settings.stations, settings.most);
        let columns = columns(&batch, &stations, settings.tolerance);
        let residual = columns.iter().map(|c| c.residual).fold(0.0, f64::max);
        let mut compliance = Compliance::of_columns(&batch, &stations, &columns).expect("tissue on the way");
        if let Some(structure) = settings.whole_of {
            let axis = like.line().axes[0];
            compliance.whole_m_per_n = whole_m_per_n(&batch, &scene.body, structure, axis, settings.tolerance);
        }
        Self {
            hand: like.in_other_body(compliance).expect("a line as valid as the first"),
            body: Arc::clone(&scene.body),
            columns: columns.into_iter().map(|column| column.field).collect(),
            residual,
        }
    }

    /// Returns the displacement of every element by a newton on each shaft station, then on the tip at each, m/N.
    pub fn columns(&self) -> &[PackedField] {
        &self.columns
    }

    /// Returns the displacement of every element of the body by the loads of now, m.
    pub fn field(&self) -> Field {
        self.field_of(&self.hand)
    }

    /// Returns the same by the loads of another line with these stations.
    pub fn field_of(&self, hand: &HandLine) -> Field {
        let axis = hand.line().axes[0];
        sum(&self.columns, hand.state().loads_n(), axis.map(|c| c * hand.whole_m()))
    }
}

/// Shaft, then tip of every station; the queue that ships gives up where a body is hard to solve, this one does not.
fn columns<T: Compiled>(batch: &BatchModel<T>, stations: &Stations, tolerance: f64) -> Vec<Column> {
    let shaft = stations.shaft.iter().enumerate().map(|(n, at)| (Load::Shaft(n), at));
    let tip = stations.tip.iter().enumerate().map(|(n, at)| (Load::Tip(n), at));
    let wanted: Vec<(Load, Vec<NodeWeight>)> = shaft
        .chain(tip)
        .map(|(load, at)| (load, stations.load(at, 0)))
        .collect();
    let mut state = BatchState::<T>::new(batch);
    let mut field = ElementField::zeros(batch.element_count());
    let mut columns = Vec::new();
    for eight in wanted.chunks(LOADS) {
        let loads: Vec<&[NodeWeight]> = eight.iter().map(|(_, load)| load.as_slice()).collect();
        state.begin(batch, &loads);
        let residual = solved(batch, &mut state, tolerance);
        for (lane, (load, _)) in eight.iter().enumerate() {
            state.write(batch, lane, &mut field);
            let mut packed = PackedField::zeros(batch.element_count());
            packed.pack(&field);
            columns.push(Column {
                load: *load,
                field: packed,
                samples_m: wanted.iter().map(|(_, load)| state.sample(lane, load)).collect(),
                beside_m: Vec::new(),
                foundation_n: state.foundation_n(batch, lane),
                residual,
            });
        }
    }
    columns
}

/// Solves to the tolerance, or up to a limit of work; returns the residual.
fn solved<T: Compiled>(batch: &BatchModel<T>, state: &mut BatchState<T>, tolerance: f64) -> f64 {
    loop {
        let progress = state.advance(batch);
        if state.is_whole() && (progress.residual <= tolerance || progress.iterations >= MOST_ITERATIONS) {
            return progress.residual;
        }
    }
}

/// Returns the layers' forces of the default parameters, as a run sets them.
pub fn default_forces() -> LayerForces {
    let parameters = ChainParameters {
        needle: NeedleParameters::default(),
        force: ForceParameters::default(),
    };
    parameters.layer_forces()
}

/// Loads times columns and a shift of all, m.
pub fn sum(columns: &[PackedField], loads_n: &[f64], whole_m: [f64; 3]) -> Field {
    let elements = columns.first().map_or(0, |column| column.bytes() / 6);
    let pairs: Vec<_> = columns.iter().zip(loads_n).filter(|(_, n)| **n != 0.0).collect();
    let at = |element: u32| {
        let mut u = whole_m;
        for (column, load_n) in &pairs {
            let per_newton = column.at(element);
            (0..3).for_each(|a| u[a] += **load_n * f64::from(per_newton[a]));
        }
        u
    };
    (0..elements as u32).map(at).collect()
}

/// Returns the mean displacement of a structure by a newton that is spread evenly over it.
fn whole_m_per_n<T: Compiled>(
    batch: &BatchModel<T>,
    body: &Lattice,
    structure: u8,
    axis: [f64; 3],
    tolerance: f64,
) -> f64 {
    let own = (0..body.element_count() as u32).filter(|&e| body.structure(e) == structure);
    let corners = own.filter_map(|e| batch.trilinear(body.rest_m(e))).flatten();
    let mut load: Vec<NodeWeight> = corners
        .map(|(node, weight)| NodeWeight {
            node,
            weight: axis.map(|c| c * weight),
        })
        .collect();
    let elements: f64 = load.iter().map(|l| l.weight[2].abs()).sum::<f64>() / axis[2].abs();
    load.iter_mut().for_each(|l| l.weight = l.weight.map(|w| w / elements));
    let mut state = BatchState::<T>::new(batch);
    state.begin(batch, &[&load]);
    solved(batch, &mut state, tolerance);
    state.sample(0, &load)
}

/// Displacements of `fine` cells as means over the elements of `body`, which has edges of a whole number of theirs.
pub struct Mean {
    /// Element of the body of each cell; past the end for none.
    element_of: Vec<u32>,
    elements: usize,
}

impl Mean {
    /// Averages cells of `fine` in the elements of `body`.
    pub fn over(fine: &Lattice, body: &Lattice) -> Self {
        let element = |cell: u32| body.element_at_rest(fine.rest_m(cell)).unwrap_or(u32::MAX);
        Self {
            element_of: (0..fine.element_count() as u32).map(element).collect(),
            elements: body.element_count(),
        }
    }

    /// Returns the mean of each element; zero for one without a cell.
    pub fn of(&self, moved_m: impl Fn(u32) -> [f64; 3]) -> Field {
        let mut sums = vec![([0.0; 3], 0.0_f64); self.elements];
        for (cell, &element) in self.element_of.iter().enumerate() {
            let Some((sum, count)) = sums.get_mut(element as usize) else {
                continue;
            };
            let u = moved_m(cell as u32);
            (0..3).for_each(|a| sum[a] += u[a]);
            *count += 1.0;
        }
        sums.into_iter()
            .map(|(sum, count)| sum.map(|s| s / count.max(1.0)))
            .collect()
    }
}
