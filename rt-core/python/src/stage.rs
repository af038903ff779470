//! Rehearsals: the script of the programs, with their simulated hand.

use crate::arrays::{self, M_PER_MM, MM_PER_M};
use crate::parameters::{self, Given};
use crate::scene::Scene;
use crate::work::{interruptible, refused};
use nalgebra::{Unit, Vector3};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::sync::{Mutex, PoisonError};
use stylet_hw::{DeviceInfo, Hand};
use stylet_runtime::rehearse;
use stylet_shm_schema::{NeedleRehearsal, Request, StabilisingNeedle};

/// Result of :meth:`Stage.rehearse`. Seeds are in the order of the drops, scene frame.
#[pyclass(frozen, get_all, module = "stylet")]
pub struct Rehearsed {
    /// Planned middle of each seed, shape (N, 3), mm.
    planned_mm: Py<PyArray2<f64>>,
    /// Middle of each seed once the tissue has come to rest, shape (N, 3), mm.
    seeds_mm: Py<PyArray2<f64>>,
    /// Unit vector along each seed then, shape (N, 3).
    axes: Py<PyArray2<f64>>,
    /// Times of the drops after the tip's first contact with tissue, shape (N,), s.
    dropped_after_s: Py<PyArray1<f64>>,
    /// Largest force on the hand, N, as the device gives it (times `force.scale`).
    peak_force_n: f64,
    /// Largest displacement of tissue before the first puncture, mm.
    displacement_before_puncture_mm: f64,
    /// Largest displacement of tissue during the whole insertion, mm.
    largest_displacement_mm: f64,
    /// Largest shift of the target's centre, mm.
    target_shift_mm: f64,
    /// Largest deflection of the tip from a rigid needle's, mm.
    deflection_mm: f64,
    /// Simulated time, s.
    simulated_s: f64,
}

/// A body in which needles are rehearsed, each in tissue at rest, by the script that ``host-ui procedure`` and
/// ``rt-core study`` carry out: a simulated hand inserts the needle, drops the seeds on the way back, and takes it out.
/// Same needle, same bits as there.
///
/// :param scene: a :class:`Scene`.
/// :param tissue: a name of :func:`tissues`.
/// :param linear: tissue near the tip stays linear: the same seeds and forces in a fifth of the time, without its large
///     strain in the displacements.
#[pyclass(frozen, module = "stylet")]
pub struct Stage(Mutex<rehearse::Stage>);

#[pymethods]
impl Stage {
    #[new]
    #[pyo3(signature = (scene, *, tissue="chainmail", linear=false))]
    fn new(py: Python<'_>, scene: &Scene, tissue: &str, linear: bool) -> PyResult<Self> {
        let (tissue, source) = (parameters::tissue(tissue)?, &scene.source);
        let built = py.detach(|| rehearse::Stage::build(source, tissue, DeviceInfo::phantom_premium_1_5()));
        let mut stage = built.map_err(refused)?;
        if linear {
            stage.seeds_and_forces_alone();
        }
        Ok(Self(Mutex::new(stage)))
    }

    /// Inserts one needle and drops its seeds.
    ///
    /// :param entry_mm: where the tip starts, outside the body, scene frame.
    /// :param direction: into the body; of any length.
    /// :param seeds_mm: middle of each seed along the needle, from the entry, deepest first.
    /// :param insert_mm_per_s, retract_mm_per_s: speeds of the hand.
    /// :param retract_to_mm: where the tip is drawn back to after the last seed, from the entry.
    /// :param strand_pitch_mm: distance between the seeds of one strand; loose seeds without it.
    /// :param stabilising: needles that go in first and stay, ``[(entry_mm, direction, depth_mm), ...]``, at most four.
    /// :param hand: ``(mass_kg, damping_n_s_per_m, stiffness_n_per_m)`` of the simulated hand.
    /// :param parameters: values by the keys and in the units of :func:`parameters`.
    /// :raises ValueError: values out of their limits, a needle that misses the body, bone before the deepest seed, a
    ///     seed outside the tissue.
    #[pyo3(signature = (entry_mm, direction, seeds_mm, *, insert_mm_per_s=50.0, retract_mm_per_s=50.0, retract_to_mm=0.0,
        strand_pitch_mm=None, stabilising=Vec::new(), hand=(0.5, 5.0, 300.0), parameters=None))]
    #[allow(clippy::too_many_arguments)]
    fn rehearse(
        &self,
        py: Python<'_>,
        entry_mm: [f64; 3],
        direction: [f64; 3],
        seeds_mm: Vec<f64>,
        insert_mm_per_s: f64,
        retract_mm_per_s: f64,
        retract_to_mm: f64,
        strand_pitch_mm: Option<f64>,
        stabilising: Vec<([f64; 3], [f64; 3], f64)>,
        hand: (f64, f64, f64),
        parameters: Given,
    ) -> PyResult<Rehearsed> {
        if !seeds_mm.is_sorted_by(|deeper, next| deeper > next) {
            return Err(refused(
                "seeds_mm must go from the deepest seed to the one nearest to the entry",
            ));
        }
        if ![hand.0, hand.1, hand.2]
            .iter()
            .all(|value| value.is_finite() && *value > 0.0)
        {
            return Err(refused(format!("hand is {hand:?}; all three must be above 0")));
        }
        let set = parameters::set(parameters)?;
        let (entry_m, direction) = axis(entry_mm, direction)?;
        let pace = stylet_procedure::Pace::default();
        let stays = |(entry_mm, direction, depth_mm): ([f64; 3], [f64; 3], f64)| -> PyResult<StabilisingNeedle> {
            let (entry_m, direction) = axis(entry_mm, direction)?;
            Ok(StabilisingNeedle {
                entry_m: entry_m.into(),
                direction: direction.into_inner().into(),
                depth_m: depth_mm * M_PER_MM,
            })
        };
        let run = NeedleRehearsal {
            entry_m: entry_m.into(),
            direction: direction.into_inner().into(),
            insert_m_per_s: insert_mm_per_s * M_PER_MM,
            retract_m_per_s: retract_mm_per_s * M_PER_MM,
            approach_m_per_s: pace.approach_m_per_s,
            acceleration_m_per_s2: pace.acceleration_m_per_s2,
            retract_to_m: retract_to_mm * M_PER_MM,
            strand_pitch_m: strand_pitch_mm.map(|pitch| pitch * M_PER_MM),
            stabilising: stabilising.into_iter().map(stays).collect::<PyResult<_>>()?,
            earlier: Vec::new(),
            as_points: false,
            drops_m: seeds_mm
                .iter()
                .map(|along_mm| (entry_m + *direction * (along_mm * M_PER_MM)).into())
                .collect(),
        };
        // The limits of a host's request.
        let asked = Request::Rehearse(run.clone()).encode(0, 0);
        asked
            .and_then(|command| Request::decode(&command))
            .map_err(|why| refused(why.text))?;
        let outcome = interruptible(py, |stop| {
            let mut stage = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            stage.take_hand(Hand {
                mass_kg: hand.0,
                damping_n_s_per_m: hand.1,
                stiffness_n_per_m: hand.2,
                ..Hand::steady()
            });
            stage.rehearse(&run, &set, stop)
        })?;
        let done = outcome.map_err(refused)?;
        let seeds = done.seeds.iter();
        Ok(Rehearsed {
            planned_mm: arrays::table(py, run.drops_m.into_iter(), MM_PER_M).unbind(),
            seeds_mm: arrays::table(py, seeds.clone().map(|seed| seed.position_m), MM_PER_M).unbind(),
            axes: arrays::table(py, seeds.map(|seed| seed.axis), 1.0).unbind(),
            dropped_after_s: arrays::column(py, done.dropped_after_s).unbind(),
            peak_force_n: done.peak_force_n,
            displacement_before_puncture_mm: done.displacement_before_puncture_m * MM_PER_M,
            largest_displacement_mm: done.largest_displacement_m * MM_PER_M,
            target_shift_mm: done.target_shift_m * MM_PER_M,
            deflection_mm: done.deflection_m * MM_PER_M,
            simulated_s: done.simulated_s,
        })
    }
}

fn axis(entry_mm: [f64; 3], direction: [f64; 3]) -> PyResult<(Vector3<f64>, Unit<Vector3<f64>>)> {
    Ok((
        arrays::place_m("entry_mm", entry_mm)?,
        arrays::direction("direction", direction)?,
    ))
}
