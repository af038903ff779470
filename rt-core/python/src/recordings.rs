//! Recordings of sessions and flights, as arrays.

use crate::arrays::{self, MM_PER_M};
use crate::work::refused;
use numpy::ndarray::{Array1, Array3};
use numpy::{Element, IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use stylet_base::interrupt::Interrupt;
use stylet_recordings::{Piece, SceneModel, Snapshot};
use stylet_runtime::replay::file::Flight;
use stylet_runtime::rt::tissue_tape::TissueEntry;
use stylet_shm_schema::{Event, EventKind, PARAMETERS, ParametersInForce, SecondRecord, TickRecord};

const MM_PER_M_F32: f32 = 1e3;

/// Reads a recording of a session (MCAP, of ``host-ui record``): the first run of ``rt-core`` in it.
///
/// :returns: a dict. Times in s since the first tick, places in mm in the frame of the scene.
///
///     ``ticks``: the force loop, a column for each quantity, shape (N,) if none is given. ``time_s``, when the tick
///     began; ``tick``, its number, which rises by one unless records were lost; ``tip_mm``, ``deflection_mm`` (of a
///     needle that bends) and ``force_n`` (on the hand, after the gate), shape (N, 3); ``tool``, the quaternion i, j,
///     k, w that turns +z to the needle, shape (N, 4); ``terms_n``, membrane, guide, damping, shaft friction, weight,
///     before the gate, shape (N, 5); ``past_membrane_mm``; ``speed_mm_per_s``, inwards; ``phase``, 0 outside, 1
///     membrane contraction, 2 penetration, 3 retraction, 4 hold; ``fault``, 0 without one; ``flags``, bits: 1
///     real-time, 2 engaged, 4 in contact, 8 punctured, others as in the file's schema; ``buttons``, bits;
///     ``tissue_tick``; ``missed``, deadlines before this tick; ``wake_latency_ns``, from the deadline;
///     ``force_written_ns`` and ``work_ns``, from the wake-up.
///
///     ``second``: the same of a second device, with ``torque_nm``, shape (N, 3), and ``contact_n``; without rows in a
///     run without one.
///
///     ``events``: columns of E events. ``kind``, such as "SeedDropped", and ``text``, lists; ``time_s``, ``tick``,
///     ``code`` and ``value``, by kind, shape (E,); ``position_mm``, shape (E, 3).
///
///     ``snapshots``: the tissue of the last scene, K times. ``time_s``, ``displacement_mm`` (the largest) and
///     ``seeds``, the number of them, shape (K,); ``tip_mm``, shape (K, 3); ``surface_mm``, ``float32``, shape (K, V,
///     3); ``rest_mm``, the same at rest, shape (V, 3), and ``triangles``, shape (T, 3).
///
///     ``seeds_mm`` and ``axes``: where the seeds were in the last snapshot, shape (S, 3). ``planned_mm``: those of the
///     last plan. ``parameters``: the last in force, ``{key: value}`` in the units of :func:`parameters`. ``scene``,
///     ``device``, ``version``: names. ``cut_off``: why reading ended before the end of the file, or None.
/// :raises ValueError: what is wrong with the file.
///
/// >>> ticks = stylet.read_recording("session.mcap")["ticks"]
/// >>> pandas.DataFrame({"s": ticks["time_s"], "N": ticks["force_n"][:, 2]})
#[pyfunction]
pub fn read_recording(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let played = py.detach(|| stylet_recordings::played(&path, &Interrupt::default()));
    let played = played.map_err(refused)?;
    let (mut ticks, mut second, mut events, mut snapshots) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut scene, mut parameters, mut planned) = (None, None, Vec::new());
    for (time_ns, piece) in &played.pieces {
        match piece {
            Piece::Tick(tick) => ticks.push(**tick),
            Piece::Second(record) => second.push(**record),
            Piece::Event(event) => events.push((seconds(*time_ns), &**event)),
            Piece::Snapshot(snapshot) => snapshots.push((seconds(*time_ns), &**snapshot)),
            Piece::Scene(model) => scene = Some(&**model),
            Piece::Parameters(in_force) => parameters = Some(&**in_force),
            Piece::Plan(plan) => planned = plan.needle().seeds_m,
            Piece::State(_) => {}
        }
    }
    let scene = scene.ok_or_else(|| refused("a recording without a scene"))?;
    snapshots.retain(|(_, s)| s.header.scene_id() == scene.header.id());
    let begun_ns = ticks.first().map_or(0, woke_ns);
    let dict = PyDict::new(py);
    dict.set_item("device", played.session.device.read())?;
    dict.set_item("version", played.session.version.read())?;
    dict.set_item("scene", scene.header.name.read())?;
    dict.set_item("cut_off", played.cut_off)?;
    dict.set_item("ticks", of_ticks(py, &ticks, begun_ns)?)?;
    dict.set_item("second", of_second(py, &second, begun_ns)?)?;
    dict.set_item("events", of_events(py, &events)?)?;
    dict.set_item("snapshots", of_snapshots(py, scene, &snapshots)?)?;
    let header = snapshots.last().map(|(_, snapshot)| &snapshot.header);
    let seeds = header.map_or(&[][..], |header| &header.seeds[..header.seed_count as usize]);
    let places = seeds.iter().map(|seed| seed.position_m);
    dict.set_item("seeds_mm", arrays::table(py, places, MM_PER_M))?;
    dict.set_item("axes", arrays::table(py, seeds.iter().map(|seed| seed.axis), 1.0))?;
    dict.set_item("planned_mm", arrays::table(py, planned.into_iter(), MM_PER_M))?;
    dict.set_item("parameters", of_parameters(py, parameters)?)?;
    Ok(dict)
}

/// Reads a flight recording: the last ticks of both loops, as ``rt-core`` writes them at a fault, at its end or on
/// request.
///
/// :returns: a dict. ``ticks`` and ``second`` as of :func:`read_recording`, without rows where the loop did not hand its
///     tape over. ``tissue``: columns of the tissue loop's M ticks. ``time_s``, on the clock of ``ticks``; ``tip_mm``,
///     the pose that the tick used, and ``displacement_mm``, of the tissue that the tip holds, shape (M, 3);
///     ``residual``, the largest violation of a limit, in elements, and ``seeds``, the number of them, shape (M,).
///     ``reason``, ``device``, ``version``; ``period_s``, between two ticks of the force loop, and ``tissue_period_s``.
/// :raises ValueError: what is wrong with the file; a flight of another layout must be read with its own version.
#[pyfunction]
pub fn read_flight(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let flight = py.detach(|| Flight::read(&path)).map_err(refused)?;
    let ticks = flight.haptic.iter().flat_map(|force| &force.ticks);
    let ticks: Vec<TickRecord> = ticks.map(|tick| tick.record).collect();
    let second = flight.second.iter().flat_map(|probe| &probe.ticks);
    let second: Vec<SecondRecord> = second.map(|tick| tick.record).collect();
    let tissue: Vec<TissueEntry> = flight.tissue.map_or_else(Vec::new, |tissue| tissue.ticks);
    let begun_ns = ticks.first().map_or(0, woke_ns);
    let dict = PyDict::new(py);
    dict.set_item("reason", flight.reason)?;
    dict.set_item("device", flight.device_name)?;
    dict.set_item("version", flight.version)?;
    dict.set_item("period_s", flight.haptic_period_s)?;
    dict.set_item("tissue_period_s", flight.tissue_period_s)?;
    dict.set_item("ticks", of_ticks(py, &ticks, begun_ns)?)?;
    dict.set_item("second", of_second(py, &second, begun_ns)?)?;
    let columns = Columns::of(py, &tissue);
    columns.one("time_s", |tick| since_s(tick.woke_ns, begun_ns))?;
    columns.rows::<3>("tip_mm", MM_PER_M, |tick| tick.pose.tip_in_scene.into())?;
    columns.rows::<3>("displacement_mm", MM_PER_M, |tick| {
        tick.response.local.displacement_m.into()
    })?;
    columns.one("residual", |tick| tick.residual)?;
    columns.one("seeds", |tick| tick.response.seed_count)?;
    dict.set_item("tissue", columns.dict)?;
    Ok(dict)
}

/// A dict of arrays, one value or row for each record.
struct Columns<'a, 'py, R> {
    dict: Bound<'py, PyDict>,
    records: &'a [R],
}

impl<'a, 'py, R> Columns<'a, 'py, R> {
    fn of(py: Python<'py>, records: &'a [R]) -> Self {
        let dict = PyDict::new(py);
        Self { dict, records }
    }

    fn one<T: Element>(&self, name: &str, value: impl Fn(&R) -> T) -> PyResult<()> {
        let values: Array1<T> = self.records.iter().map(value).collect();
        self.dict.set_item(name, values.into_pyarray(self.dict.py()))
    }

    fn rows<const K: usize>(&self, name: &str, factor: f64, row: impl Fn(&R) -> [f64; K]) -> PyResult<()> {
        let rows = arrays::table(self.dict.py(), self.records.iter().map(row), factor);
        self.dict.set_item(name, rows)
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

/// Returns the time since the first tick; a tissue tick may come before it.
fn since_s(time_ns: u64, begun_ns: u64) -> f64 {
    time_ns.wrapping_sub(begun_ns) as i64 as f64 * 1e-9
}

fn woke_ns(tick: &TickRecord) -> u64 {
    tick.due_ns + tick.wake_latency_ns
}

fn of_ticks<'py>(py: Python<'py>, ticks: &[TickRecord], begun_ns: u64) -> PyResult<Bound<'py, PyDict>> {
    let columns = Columns::of(py, ticks);
    columns.one("time_s", |t| since_s(woke_ns(t), begun_ns))?;
    columns.one("tick", |t| t.tick)?;
    columns.rows("tip_mm", MM_PER_M, |t| t.tip_in_scene_m)?;
    columns.rows("deflection_mm", MM_PER_M, |t| t.tip_deflection_m)?;
    columns.rows("tool", 1.0, |t| t.world_from_tool)?;
    columns.rows("force_n", 1.0, |t| t.force_on_hand_n)?;
    columns.rows("terms_n", 1.0, |t| t.force_terms_n)?;
    columns.one("past_membrane_mm", |t| t.depth_m * MM_PER_M)?;
    columns.one("speed_mm_per_s", |t| t.speed_m_per_s * MM_PER_M)?;
    columns.one("phase", |t| t.phase as u8)?;
    columns.one("fault", |t| t.fault)?;
    columns.one("flags", |t| t.flags)?;
    columns.one("buttons", |t| t.buttons)?;
    columns.one("tissue_tick", |t| t.tissue_tick)?;
    columns.one("missed", |t| t.missed)?;
    columns.one("wake_latency_ns", |t| t.wake_latency_ns)?;
    columns.one("force_written_ns", |t| t.force_written_ns)?;
    columns.one("work_ns", |t| t.work_ns)?;
    Ok(columns.dict)
}

fn of_second<'py>(py: Python<'py>, ticks: &[SecondRecord], begun_ns: u64) -> PyResult<Bound<'py, PyDict>> {
    let columns = Columns::of(py, ticks);
    columns.one("time_s", |t| since_s(t.due_ns + t.wake_latency_ns, begun_ns))?;
    columns.one("tick", |t| t.tick)?;
    columns.rows("tip_mm", MM_PER_M, |t| t.tip_in_scene_m)?;
    columns.rows("tool", 1.0, |t| t.world_from_tool)?;
    columns.rows("force_n", 1.0, |t| t.force_on_hand_n)?;
    columns.rows("torque_nm", 1.0, |t| t.torque_on_hand_nm)?;
    columns.one("contact_n", |t| t.contact_force_n)?;
    columns.one("fault", |t| t.fault)?;
    columns.one("flags", |t| t.flags)?;
    columns.one("buttons", |t| t.buttons)?;
    columns.one("tissue_tick", |t| t.tissue_tick)?;
    columns.one("missed", |t| t.missed)?;
    columns.one("wake_latency_ns", |t| t.wake_latency_ns)?;
    columns.one("force_written_ns", |t| t.force_written_ns)?;
    columns.one("work_ns", |t| t.work_ns)?;
    Ok(columns.dict)
}

fn of_events<'py>(py: Python<'py>, events: &[(f64, &Event)]) -> PyResult<Bound<'py, PyDict>> {
    let columns = Columns::of(py, events);
    let kind = |event: &Event| EventKind::from_number(event.kind).map(|kind| format!("{kind:?}"));
    let kinds: Vec<_> = events.iter().map(|(_, event)| kind(event)).collect();
    let texts: Vec<_> = events.iter().map(|(_, event)| event.text.read()).collect();
    columns.dict.set_item("kind", kinds)?;
    columns.dict.set_item("text", texts)?;
    columns.one("time_s", |(time_s, _)| *time_s)?;
    columns.one("tick", |(_, event)| event.tick)?;
    columns.one("code", |(_, event)| event.code)?;
    columns.one("value", |(_, event)| event.value)?;
    columns.rows("position_mm", MM_PER_M, |(_, event)| event.position_m)?;
    Ok(columns.dict)
}

fn of_snapshots<'py>(
    py: Python<'py>,
    scene: &SceneModel,
    snapshots: &[(f64, &Snapshot)],
) -> PyResult<Bound<'py, PyDict>> {
    let columns = Columns::of(py, snapshots);
    columns.one("time_s", |(time_s, _)| *time_s)?;
    columns.one("displacement_mm", |(_, s)| s.header.max_displacement_m * MM_PER_M)?;
    columns.one("seeds", |(_, s)| s.header.seed_count)?;
    columns.rows("tip_mm", MM_PER_M, |(_, s)| s.header.tip_in_scene_m)?;
    let vertices = scene.rest_m.len();
    let in_mm = |places_m: &[[f32; 3]]| places_m.iter().flatten().map(|m| m * MM_PER_M_F32).collect::<Vec<_>>();
    let all: Vec<f32> = snapshots.iter().flat_map(|(_, s)| in_mm(&s.positions_m)).collect();
    let surface = Array3::from_shape_vec((snapshots.len(), vertices, 3), all)
        .map_err(|_| refused("a snapshot has another surface than its scene"))?;
    columns.dict.set_item("surface_mm", surface.into_pyarray(py))?;
    let rest = arrays::column(py, in_mm(&scene.rest_m)).reshape([vertices, 3])?;
    columns.dict.set_item("rest_mm", rest)?;
    let corners = scene.triangles.iter().flatten().copied().collect();
    let corners = arrays::column::<u32>(py, corners).reshape([scene.triangles.len(), 3])?;
    columns.dict.set_item("triangles", corners)?;
    Ok(columns.dict)
}

fn of_parameters<'py>(py: Python<'py>, in_force: Option<&ParametersInForce>) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let Some(in_force) = in_force else {
        return Ok(dict);
    };
    for spec in &PARAMETERS {
        dict.set_item(spec.key, in_force.set.get(spec.id) * spec.display_per_si)?;
    }
    Ok(dict)
}
