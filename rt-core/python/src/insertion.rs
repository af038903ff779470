//! An insertion, step by step.

use crate::arrays::{self, M_PER_MM, MM_PER_M, Rows};
use crate::needle::{Body, Needle, info};
use crate::parameters::{self, Given};
use crate::scene::Scene;
use crate::work::{interruptible, refused};
use numpy::PyArray2;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::atomic::Ordering;
use std::sync::{Mutex, MutexGuard, PoisonError};
use stylet_shm_schema::{Fault, NeedleAxis, Phase, SeedPose};
use stylet_sim::active::Active;
use stylet_sim::tissue::MaterialPoint;

const TICKS_PER_S: f64 = 1e3;
const LONGEST_S: f64 = 600.0;

type Three = (f64, f64, f64);
type Table<'py> = Bound<'py, PyArray2<f64>>;

/// Needle and tissue after a step.
#[pyclass(frozen, get_all, module = "stylet")]
pub struct State {
    /// Simulated time, s.
    time_s: f64,
    /// Depth of the tip from the entry along the axis, mm.
    depth_mm: f64,
    /// Place of the tip, scene frame, mm; of a needle that bends, where it is bent to.
    tip_mm: Three,
    /// Force on the hand, scene frame, N, as the simulated device gives it: times `force.scale` (0.9), within 8.5 N and
    /// `force.slew_limit`.
    force_n: Three,
    /// The part of it along the needle, positive against insertion, N.
    resistance_n: f64,
    /// Before scale and limits, along the insertion: membrane, guide, damping, shaft friction, weight, N.
    terms_n: (f64, f64, f64, f64, f64),
    /// Depth behind the membrane in front of the tip, as it lay at rest, mm (u_tip of the paper's eq. 6).
    past_membrane_mm: f64,
    /// "outside", "membrane contraction", "penetration", "retraction" or "hold" (eq. 6).
    phase: &'static str,
    /// Membranes that have given way.
    punctures: u32,
    /// Largest displacement of any element of the body, mm.
    displacement_mm: f64,
    /// Seeds in the tissue.
    seeds: u32,
}

impl State {
    fn of(needle: &Needle) -> Self {
        let state = needle.state();
        let mm = |m: f64| m * MM_PER_M;
        let [tip, bent] = [state.tip_in_scene_m, state.tip_deflection_m];
        let [r, guide, damping, shaft, weight] = state.force_terms_n;
        let force = state.force_on_hand_n;
        Self {
            time_s: needle.seconds(),
            depth_mm: mm(needle.depth_m()),
            tip_mm: [0, 1, 2].map(|a| mm(tip[a] + bent[a])).into(),
            force_n: force.into(),
            resistance_n: resistance_n(needle),
            terms_n: (r, guide, damping, shaft, weight),
            past_membrane_mm: mm(state.depth_m),
            phase: Phase::from_number(state.phase).map_or("", Phase::name),
            punctures: needle.punctures,
            displacement_mm: mm(needle.tissue().displacement_m()),
            seeds: needle.tissue().response().seed_count,
        }
    }
}

fn resistance_n(needle: &Needle) -> f64 {
    let force = needle.state().force_on_hand_n;
    -(0..3).map(|a| force[a] * needle.direction[a]).sum::<f64>()
}

#[pymethods]
impl State {
    fn __repr__(&self) -> String {
        let Self {
            time_s,
            depth_mm,
            resistance_n,
            phase,
            ..
        } = self;
        format!("<State {time_s:.3} s, {depth_mm:.2} mm deep, {resistance_n:.3} N, {phase}>")
    }
}

/// One needle in a body, moved by the caller: the two ticks of a run (1 kHz force, 200 Hz tissue) without a clock, over
/// a device that no hand holds. The same steps give the same bits.
///
/// :param scene: a :class:`Scene`.
/// :param entry_mm: where the tip starts, outside the body, scene frame.
/// :param direction: into the body; of any length.
/// :param tissue: a name of :func:`tissues`.
/// :param parameters: values by the keys and in the units of :func:`parameters`; the others have their defaults.
/// :param linear: tissue near the tip stays linear: the same seeds and forces in a fifth of the time, without its large
///     strain in the displacements.
/// :raises ValueError: parameters out of their limits, a needle that misses the body.
///
/// The needle's line is solved here (within a second; seconds with "fem"). The tip is then at the entry, the force on.
///
/// >>> needle = stylet.Insertion(stylet.Scene("paper"), (72.979, 44.715, 86.401))
/// >>> state = needle.step(30.0, dt_s=0.6)          # to 30 mm at 50 mm/s
/// >>> state.resistance_n, state.phase
/// >>> needle.drop_seed(); trace = needle.move(0.0, 50.0); positions_mm, axes = needle.seeds()
#[pyclass(frozen, module = "stylet")]
pub struct Insertion(Mutex<Inner>);

struct Inner {
    body: Body,
    active: Active,
    axis: NeedleAxis,
    needle: Option<Needle>,
}

fn lost() -> PyErr {
    PyRuntimeError::new_err("a reset has failed: reset once more")
}

fn force_off(fault: Fault) -> PyErr {
    PyRuntimeError::new_err(format!("the force is off: {}; reset to go on", fault.message()))
}

impl Insertion {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets `work` have the needle, without the interpreter's lock.
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut Needle) -> PyResult<T> + Send) -> PyResult<T> {
        py.detach(|| self.inner().needle.as_mut().ok_or_else(lost).and_then(work))
    }
}

#[pymethods]
impl Insertion {
    #[new]
    #[pyo3(signature = (scene, entry_mm, direction=[0.0, 0.0, 1.0], *, tissue="chainmail", parameters=None,
        linear=false))]
    fn new(
        py: Python<'_>,
        scene: &Scene,
        entry_mm: [f64; 3],
        direction: [f64; 3],
        tissue: &str,
        parameters: Given,
        linear: bool,
    ) -> PyResult<Self> {
        let (tissue, set) = (parameters::tissue(tissue)?, parameters::set(parameters)?);
        let active = parameters::active(&set, &info())?;
        let axis = axis(entry_mm, direction)?;
        let source = &scene.source;
        interruptible(py, |stop| {
            let mut body = Body::build(source, tissue, &active, linear)?;
            let needle = Some(body.needle(axis, &active, stop)?);
            Ok(Self(Mutex::new(Inner {
                body,
                active,
                axis,
                needle,
            })))
        })?
        .map_err(|why: stylet_runtime::rehearse::RehearseError| refused(why))
    }

    /// Begins anew: body at rest, no seeds, the tip at the entry. What is given changes; the others stay. The line of a
    /// needle on an axis as before is not solved again.
    #[pyo3(signature = (entry_mm=None, direction=None, *, parameters=None))]
    fn reset(
        &self,
        py: Python<'_>,
        entry_mm: Option<[f64; 3]>,
        direction: Option<[f64; 3]>,
        parameters: Given,
    ) -> PyResult<State> {
        let active = match parameters {
            None => None,
            given => Some(parameters::active(&parameters::set(given)?, &info())?),
        };
        let now = self.inner().axis;
        let mut wanted = now;
        if let Some(entry_mm) = entry_mm {
            wanted.entry_m = arrays::place_m("entry_mm", entry_mm)?.into();
        }
        if let Some(to) = direction {
            wanted.direction = arrays::direction("direction", to)?.into_inner().into();
        }
        interruptible(py, |stop| {
            let inner = &mut *self.inner();
            if let Some(active) = active {
                inner.active = active;
            }
            if let Some(needle) = inner.needle.take() {
                inner.body.take_back(needle);
            }
            let needle = inner.body.needle(wanted, &inner.active, stop)?;
            inner.axis = wanted;
            let state = State::of(&needle);
            inner.needle = Some(needle);
            Ok(state)
        })?
        .map_err(|why: stylet_runtime::rehearse::RehearseError| refused(why))
    }

    /// Moves the needle at constant speed within `dt_s` (rounded to whole milliseconds, at least one), and returns the
    /// :class:`State` after it.
    ///
    /// :param depth_mm: where to along the axis, from the entry; or
    /// :param tip_mm: any place of the tip, scene frame, with the `direction` of the needle. Without any of these the
    ///     needle rests.
    /// :param roll_deg: how far the needle is turned about itself at the end; its bevel leads to +x at 0, for a needle
    ///     along +z. Felt with ``needle.bending_stiffness`` above 0 (0.016 N m² for 18 G steel).
    /// :raises RuntimeError: the force went off by a fault, such as tissue whose constraints cannot be met.
    #[pyo3(signature = (depth_mm=None, dt_s=0.001, *, tip_mm=None, direction=None, roll_deg=None))]
    fn step(
        &self,
        py: Python<'_>,
        depth_mm: Option<f64>,
        dt_s: f64,
        tip_mm: Option<[f64; 3]>,
        direction: Option<[f64; 3]>,
        roll_deg: Option<f64>,
    ) -> PyResult<State> {
        if !(0.0..=LONGEST_S).contains(&dt_s) {
            return Err(refused(format!("dt_s is {dt_s}; it must be 0 to {LONGEST_S}")));
        }
        let ticks = ((dt_s * TICKS_PER_S).round() as u32).max(1);
        let tip_m = tip_mm.map(|mm| arrays::place_m("tip_mm", mm)).transpose()?;
        let direction = direction.map(|to| arrays::direction("direction", to)).transpose()?;
        let depth_m = depth_mm.map(finite_m).transpose()?;
        if depth_m.is_some() && (tip_m.is_some() || direction.is_some()) {
            return Err(refused("give depth_mm, or tip_mm and direction"));
        }
        if roll_deg.is_some_and(|roll| !roll.is_finite()) {
            return Err(refused("roll_deg is no angle"));
        }
        self.with(py, |needle| {
            let now = needle.pose;
            let mut to = depth_m.map_or(now, |depth_m| needle.at_depth(depth_m));
            to.tip_m = tip_m.unwrap_or(to.tip_m);
            to.direction = direction.unwrap_or(to.direction);
            to.roll_rad = roll_deg.map_or(to.roll_rad, f64::to_radians);
            needle.go(to, ticks, |_| true).map_err(force_off)?;
            Ok(State::of(needle))
        })
    }

    /// Moves the tip along the axis to `depth_mm` at constant speed, and returns a trace of every millisecond: a dict
    /// of arrays of N ticks.
    ///
    /// ``time_s``, ``depth_mm``, ``resistance_n``, ``displacement_mm`` have the shape (N,), ``force_n`` (N, 3),
    /// ``terms_n`` (N, 5), all as in :class:`State`. ``phase`` (N,) has numbers: 0 outside, 1 membrane contraction, 2
    /// penetration, 3 retraction, 4 hold.
    ///
    /// :raises RuntimeError: as of :meth:`step`.
    #[pyo3(signature = (depth_mm, speed_mm_per_s=50.0))]
    fn r#move<'py>(&self, py: Python<'py>, depth_mm: f64, speed_mm_per_s: f64) -> PyResult<Bound<'py, PyDict>> {
        if !(0.01..=1000.0).contains(&speed_mm_per_s) {
            let range = "it must be 0.01 to 1000";
            return Err(refused(format!("speed_mm_per_s is {speed_mm_per_s}; {range}")));
        }
        let depth_m = finite_m(depth_mm)?;
        let trace = interruptible(py, |stop| {
            let inner = &mut *self.inner();
            let needle = inner.needle.as_mut().ok_or_else(lost)?;
            let seconds = (depth_m - needle.depth_m()).abs() * MM_PER_M / speed_mm_per_s;
            if seconds > LONGEST_S {
                let why = format!("that would take {seconds:.0} s; at most {LONGEST_S} s are possible at once");
                return Err(refused(why));
            }
            let mut trace = Trace::default();
            let ticks = ((seconds * TICKS_PER_S - 1e-6).ceil() as u32).max(1);
            let moved = needle.go(needle.at_depth(depth_m), ticks, |needle| {
                trace.push(needle);
                // SYNC: nothing but the flag is carried.
                !stop.load(Ordering::Relaxed)
            });
            moved.map(|()| trace).map_err(force_off)
        })??;
        trace.into_dict(py)
    }

    /// Leaves a seed with its deeper end at the tip; the needle rests for 5 ms meanwhile. `strand_pitch_mm` joins it to
    /// the seed dropped before it, if that lies about so far behind.
    ///
    /// :raises ValueError: the tip is outside the tissue, or there are 128 seeds.
    #[pyo3(signature = (strand_pitch_mm=None))]
    fn drop_seed(&self, py: Python<'_>, strand_pitch_mm: Option<f64>) -> PyResult<State> {
        let pitch_m = strand_pitch_mm.map(finite_m).transpose()?;
        self.with(py, |needle| {
            needle.drop_seed(pitch_m).map_err(|why| refused(why.message()))?;
            Ok(State::of(needle))
        })
    }

    /// Returns the middles of the seeds, mm, and their axes, both of shape (N, 3), in the order of the drops: where
    /// they rest once nothing moves the tissue, or with `at_rest=False` where they are now.
    #[pyo3(signature = (*, at_rest=true))]
    fn seeds<'py>(&self, py: Python<'py>, at_rest: bool) -> PyResult<(Table<'py>, Table<'py>)> {
        let seeds: Vec<SeedPose> = self.with(py, |needle| {
            Ok(match at_rest {
                true => needle.tissue().seeds_at_rest().collect(),
                false => needle.tissue().seeds().collect(),
            })
        })?;
        Ok((
            arrays::table(py, seeds.iter().map(|seed| seed.position_m), MM_PER_M),
            arrays::table(py, seeds.iter().map(|seed| seed.axis), 1.0),
        ))
    }

    /// Returns the displacement of the tissue that lies at these places at rest, shape (N, 3), mm; NaN where there is
    /// none.
    fn displacement<'py>(&self, py: Python<'py>, places_mm: Rows<'py>) -> PyResult<Table<'py>> {
        let places_m = arrays::rows("places_mm", &places_mm, M_PER_MM)?;
        let moved = self.with(py, |needle| {
            let body = needle.tissue().world().tissue.deformed();
            let moved_m = |place_m: &[f64; 3]| {
                let point = MaterialPoint::at_rest(body.lattice, *place_m);
                point.map_or([f64::NAN; 3], |point| point.displacement_m(&body))
            };
            Ok(places_m.iter().map(moved_m).collect::<Vec<_>>())
        })?;
        Ok(arrays::table(py, moved.into_iter(), MM_PER_M))
    }

    /// The :class:`State` now.
    #[getter]
    fn state(&self, py: Python<'_>) -> PyResult<State> {
        self.with(py, |needle| Ok(State::of(needle)))
    }
}

fn axis(entry_mm: [f64; 3], direction: [f64; 3]) -> PyResult<NeedleAxis> {
    Ok(NeedleAxis {
        entry_m: arrays::place_m("entry_mm", entry_mm)?.into(),
        direction: arrays::direction("direction", direction)?.into_inner().into(),
    })
}

fn finite_m(mm: f64) -> PyResult<f64> {
    match mm.is_finite() {
        true => Ok(mm * M_PER_MM),
        false => Err(refused(format!("{mm} is no length"))),
    }
}

/// Columns of a trace with one number a tick.
const COLUMNS: [&str; 4] = ["time_s", "depth_mm", "resistance_n", "displacement_mm"];

/// Values of each tick.
#[derive(Default)]
struct Trace {
    numbers: [Vec<f64>; COLUMNS.len()],
    force_n: Vec<[f64; 3]>,
    terms_n: Vec<[f64; 5]>,
    phase: Vec<u8>,
}

impl Trace {
    fn push(&mut self, needle: &Needle) {
        let (state, [depth_m, moved_m]) = (needle.state(), [needle.depth_m(), needle.tissue().displacement_m()]);
        let values = [
            needle.seconds(),
            depth_m * MM_PER_M,
            resistance_n(needle),
            moved_m * MM_PER_M,
        ];
        self.numbers
            .iter_mut()
            .zip(values)
            .for_each(|(column, value)| column.push(value));
        self.force_n.push(state.force_on_hand_n);
        self.terms_n.push(state.force_terms_n);
        self.phase.push(state.phase as u8);
    }

    fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let dict = PyDict::new(py);
        for (key, values) in COLUMNS.iter().zip(self.numbers) {
            dict.set_item(key, arrays::column(py, values))?;
        }
        dict.set_item("force_n", arrays::table(py, self.force_n.into_iter(), 1.0))?;
        dict.set_item("terms_n", arrays::table(py, self.terms_n.into_iter(), 1.0))?;
        dict.set_item("phase", arrays::column(py, self.phase))?;
        Ok(dict)
    }
}
