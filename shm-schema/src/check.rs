//! Validates values from shared memory before they are used.

use crate::{
    GridInfo, HapticState, MAX_LABEL_CELLS, MAX_NODES, MAX_SEEDS, MAX_STRUCTURES, MOST_MOVED_M, MOST_PLANNED_NEEDLES,
    PRESCRIPTION_RANGE_GY, ParametersInForce, PlanInForce, Rehearsal, SEED_STRENGTH_RANGE_U, SceneHeader, SecondRecord,
    SecondState, SeedPose, SnapshotHeader, TickRecord, Vertex,
};

/// Reason why a value is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("invalid: {0}")]
pub struct Invalid(pub &'static str);

/// Largest coordinate: no scene is larger.
pub const MAX_COORDINATE_M: f64 = 20.0;
const MAX_FORCE_N: f64 = 100.0;
const MAX_SPEED_M_PER_S: f64 = 100.0;

fn within(values: &[f64], limit: f64) -> bool {
    // NaN compares false.
    values.iter().all(|v| v.abs() <= limit)
}

fn ensure(holds: bool, what: &'static str) -> Result<(), Invalid> {
    if holds { Ok(()) } else { Err(Invalid(what)) }
}

/// Validates a state read from the board.
pub fn state(s: &HapticState) -> Result<(), Invalid> {
    ensure(within(&s.tip_in_scene_m, MAX_COORDINATE_M), "tip position")?;
    ensure(within(&s.contact_in_scene_m, MAX_COORDINATE_M), "contact position")?;
    ensure(within(&s.needle_direction, 1.001), "needle direction")?;
    ensure(within(&[s.depth_m, s.puncture_depth_m], MAX_COORDINATE_M), "depth")?;
    ensure(within(&[s.speed_m_per_s], MAX_SPEED_M_PER_S), "speed")?;
    ensure(within(&s.force_on_hand_n, MAX_FORCE_N), "force")?;
    ensure(within(&s.torque_on_hand_nm, MAX_FORCE_N), "torque")?;
    ensure(within(&s.force_terms_n, 1e4), "force terms")?;
    ensure(
        within(&[s.peak_force_n, s.force_scale, s.device_limit_n], MAX_FORCE_N),
        "force limits",
    )?;
    ensure(within(&[s.energy_j, s.warmth_n, s.tissue_force_n], 1e4), "gate figures")?;
    ensure(s.worst_residual.is_finite(), "residual")?;
    ensure(s.least_corner.is_finite(), "corner of an element")?;
    ensure(
        within(&[s.folded_from_m], MAX_COORDINATE_M),
        "displacement of folded tissue",
    )?;
    ensure(s.seed_count as usize <= MAX_SEEDS, "seed count")
}

/// Validates one record of a tick.
pub fn record(r: &TickRecord) -> Result<(), Invalid> {
    ensure(within(&r.tip_in_scene_m, MAX_COORDINATE_M), "tip position")?;
    ensure(within(&r.force_on_hand_n, MAX_FORCE_N), "force")?;
    ensure(within(&[r.depth_m], MAX_COORDINATE_M), "depth")?;
    ensure(within(&[r.speed_m_per_s], MAX_SPEED_M_PER_S), "speed")?;
    ensure(within(&r.force_terms_n, 1e4), "force terms")?;
    ensure(within(&r.world_from_tool, 1.001), "orientation")?;
    took(r.wake_latency_ns, r.work_ns)
}

/// Validates a state of the second device.
pub fn second_state(s: &SecondState) -> Result<(), Invalid> {
    second_motion(
        &s.tip_in_scene_m,
        &s.world_from_tool,
        &s.force_on_hand_n,
        &s.torque_on_hand_nm,
    )?;
    ensure(
        within(&[s.peak_force_n, s.force_scale, s.device_limit_n], MAX_FORCE_N),
        "force limits",
    )?;
    ensure(within(&[s.energy_j, s.warmth_n], 1e4), "gate figures")
}

/// Validates one record of a tick of the second device.
pub fn second_record(r: &SecondRecord) -> Result<(), Invalid> {
    second_motion(
        &r.tip_in_scene_m,
        &r.world_from_tool,
        &r.force_on_hand_n,
        &r.torque_on_hand_nm,
    )?;
    ensure(within(&[r.contact_force_n], 1e4), "force of the contact")?;
    took(r.wake_latency_ns, r.work_ns)
}

fn second_motion(
    tip_m: &[f64; 3],
    world_from_tool: &[f64; 4],
    force_n: &[f64; 3],
    torque_nm: &[f64; 3],
) -> Result<(), Invalid> {
    ensure(within(tip_m, MAX_COORDINATE_M), "tip position")?;
    ensure(within(world_from_tool, 1.001), "orientation")?;
    ensure(within(force_n, MAX_FORCE_N), "force")?;
    ensure(within(torque_nm, MAX_FORCE_N), "torque")
}

fn took(wake_latency_ns: u64, work_ns: u64) -> Result<(), Invalid> {
    ensure(
        wake_latency_ns < 3_600_000_000_000 && work_ns < 3_600_000_000_000,
        "timing",
    )
}

/// Validates a snapshot; `vertices` are those that came with the header, displacements of nodes included.
pub fn snapshot(h: &SnapshotHeader, vertices: &[Vertex]) -> Result<(), Invalid> {
    let sent = u64::from(h.vertex_count) + u64::from(h.node_count);
    ensure(sent == vertices.len() as u64, "vertex or node count")?;
    ensure(h.seed_count as usize <= MAX_SEEDS, "seed count")?;
    ensure(within(&h.tip_in_scene_m, MAX_COORDINATE_M), "tip position")?;
    ensure(within(&h.needle_direction, 1.001), "needle direction")?;
    ensure(within(&h.held_in_scene_m, MAX_COORDINATE_M), "held position")?;
    ensure(within(&h.body_moved_m, MOST_MOVED_M), "place of the body")?;
    ensure(h.residual.is_finite() && h.max_displacement_m.is_finite(), "residual")?;
    seeds(&h.seeds[..h.seed_count as usize])?;
    let limit = MAX_COORDINATE_M as f32;
    ensure(
        vertices.iter().all(|v| v.position_m.iter().all(|c| c.abs() <= limit)),
        "vertex position",
    )
}

/// Validates a scene; `words` are those that came with the header.
pub fn scene(h: &SceneHeader, words: &[u32]) -> Result<(), Invalid> {
    ensure(h.word_count() == Some(words.len()), "vertex or triangle count")?;
    ensure(h.spacing_m > 0.0 && h.spacing_m < 1.0, "spacing")?;
    ensure(h.volume_m3.is_finite(), "volume")?;
    ensure(
        within(&h.lower_m, MAX_COORDINATE_M) && within(&h.upper_m, MAX_COORDINATE_M),
        "bounding box",
    )?;
    ensure(
        within(&h.target_lower_m, MAX_COORDINATE_M) && within(&h.target_upper_m, MAX_COORDINATE_M),
        "bounding box of the targets",
    )?;
    ensure(within(&h.patient_from_scene, MAX_COORDINATE_M), "patient transform")?;
    ensure(h.body_triangle_count <= h.triangle_count, "triangles of the body")?;
    ensure(h.structure_count as usize <= MAX_STRUCTURES, "structure count")?;
    ensure((1..=1024).contains(&h.body_edge), "edge of the body's elements")?;
    for structure in h.structures() {
        let end = structure.first_triangle.checked_add(structure.triangle_count);
        ensure(
            end.is_some_and(|end| end <= h.triangle_count),
            "triangles of a structure",
        )?;
        ensure(
            within(&structure.lower_m, MAX_COORDINATE_M) && within(&structure.upper_m, MAX_COORDINATE_M),
            "bounding box of a structure",
        )?;
    }
    grid(&h.labels, MAX_LABEL_CELLS, "grid of labels")?;
    grid(&h.nodes, MAX_NODES, "grid of displacements")?;
    let (positions, rest) = words.split_at(3 * h.vertex_count as usize);
    let (indices, labels) = rest.split_at(3 * h.triangle_count as usize);
    let limit = MAX_COORDINATE_M as f32;
    ensure(
        positions.iter().all(|&w| f32::from_bits(w).abs() <= limit),
        "vertex position",
    )?;
    ensure(indices.iter().all(|&i| i < h.vertex_count), "triangle index")?;
    let known = |word: &u32| word.to_le_bytes().iter().all(|&b| u32::from(b) <= h.structure_count);
    ensure(labels.iter().all(known), "label of a cell")
}

fn grid(g: &GridInfo, most: usize, what: &'static str) -> Result<(), Invalid> {
    ensure(g.node_count().is_some_and(|n| n <= most), what)?;
    ensure(within(&g.origin_m, MAX_COORDINATE_M), what)?;
    ensure(g.dims == [0; 3] || (g.spacing_m > 0.0 && g.spacing_m < 1.0), what)
}

/// Validates the parameters in force: the limits of the table, and eq. 1.
pub fn parameters(p: &ParametersInForce) -> Result<(), Invalid> {
    ensure(p.set.problems().is_empty(), "parameters")
}

/// Validates the plan in force.
pub fn plan(p: &PlanInForce) -> Result<(), Invalid> {
    ensure(p.seed_count as usize <= MAX_SEEDS, "seed count")?;
    ensure(within(&p.entry_m, MAX_COORDINATE_M), "entry")?;
    ensure(p.generation == 0 || is_unit(&p.direction), "direction")?;
    let of = &p.prescribed;
    ensure(
        of.needle.max(of.last_needle) <= MOST_PLANNED_NEEDLES,
        "number of a needle",
    )?;
    let is_in = |value: f64, [low, high]: [f64; 2]| (low..=high).contains(&value);
    ensure(is_in(of.strength_u, SEED_STRENGTH_RANGE_U), "strength of the seeds")?;
    ensure(is_in(of.dose_gy, PRESCRIPTION_RANGE_GY), "prescribed dose")?;
    ensure(of.source.exact().is_some(), "source")?;
    ensure(
        p.seeds[..p.seed_count as usize]
            .iter()
            .all(|s| within(&s.position_m, MAX_COORDINATE_M)),
        "seed position",
    )
}

/// Validates the result of a rehearsal.
pub fn rehearsal(r: &Rehearsal) -> Result<(), Invalid> {
    ensure(r.seed_count as usize <= MAX_SEEDS, "seed count")?;
    ensure(within(&[r.peak_force_n], MAX_FORCE_N), "peak force")?;
    ensure(
        within(&[r.displacement_before_puncture_m], MAX_COORDINATE_M),
        "displacement",
    )?;
    seeds(&r.seeds[..r.seed_count as usize])
}

fn seeds(seeds: &[SeedPose]) -> Result<(), Invalid> {
    for seed in seeds {
        ensure(within(&seed.position_m, MAX_COORDINATE_M), "seed position")?;
        ensure(within(&seed.dropped_at_m, MAX_COORDINATE_M), "seed drop position")?;
        ensure(within(&seed.axis, 1.001), "seed axis")?;
    }
    Ok(())
}

/// True if the length of `v` is 1 within 0.0005.
pub fn is_unit(v: &[f64; 3]) -> bool {
    let norm2 = v.iter().map(|c| c * c).sum::<f64>();
    (norm2 - 1.0).abs() < 1e-3
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn all_ones_and_not_a_number_are_invalid() {
        let ones = |size: usize| vec![0xff_u8; size];
        let s: HapticState = bytemuck::pod_read_unaligned(&ones(size_of::<HapticState>()));
        assert!(state(&s).is_err());
        let r: TickRecord = bytemuck::pod_read_unaligned(&ones(size_of::<TickRecord>()));
        assert!(record(&r).is_err());
        let s: SecondState = bytemuck::pod_read_unaligned(&ones(size_of::<SecondState>()));
        assert!(second_state(&s).is_err() && second_state(&SecondState::zeroed()).is_ok());
        let r: SecondRecord = bytemuck::pod_read_unaligned(&ones(size_of::<SecondRecord>()));
        assert!(second_record(&r).is_err() && second_record(&SecondRecord::zeroed()).is_ok());
        let r: Rehearsal = bytemuck::pod_read_unaligned(&ones(size_of::<Rehearsal>()));
        assert!(rehearsal(&r).is_err());
        let mut r = Rehearsal::zeroed();
        assert!(rehearsal(&r).is_ok());
        (r.seed_count, r.seeds[1].position_m[2]) = (2, f64::NAN);
        assert_eq!(rehearsal(&r), Err(Invalid("seed position")));
        let h: SnapshotHeader = bytemuck::pod_read_unaligned(&ones(size_of::<SnapshotHeader>()));
        assert!(snapshot(&h, &[]).is_err());
        let h: SceneHeader = bytemuck::pod_read_unaligned(&ones(size_of::<SceneHeader>()));
        assert!(scene(&h, &[]).is_err());
        assert!(state(&HapticState::zeroed()).is_ok());
    }

    #[test]
    fn one_bad_index_or_vertex_is_found() {
        let mut h = SceneHeader::zeroed();
        h.body_edge = 1;
        (h.vertex_count, h.triangle_count, h.spacing_m) = (1, 1, 1e-3);
        let word = 1.0_f32.to_bits();
        assert!(scene(&h, &[word, word, word, 0, 0, 0]).is_ok());
        assert_eq!(scene(&h, &[word, word, word, 0, 1, 0]), Err(Invalid("triangle index")));
        assert_eq!(
            scene(&h, &[word, u32::MAX, word, 0, 0, 0]),
            Err(Invalid("vertex position"))
        );
        let words = [word, word, word, 0, 0, 0];
        (h.structure_count, h.structures[0].triangle_count) = (1, 1);
        assert!(scene(&h, &words).is_ok());
        h.structures[0].first_triangle = 1;
        assert_eq!(scene(&h, &words), Err(Invalid("triangles of a structure")));
        (h.structures[0].first_triangle, h.structures[0].upper_m[1]) = (0, f64::NAN);
        assert_eq!(scene(&h, &words), Err(Invalid("bounding box of a structure")));
        h.structures[0].upper_m[1] = 0.0;
        (h.labels.dims, h.labels.spacing_m) = ([5, 1, 1], 1e-3);
        let labelled = |cells: [u32; 2]| [&words[..], &cells[..]].concat();
        assert!(scene(&h, &labelled([0x0100_0001, 1])).is_ok());
        assert_eq!(scene(&h, &labelled([0x0200_0001, 1])), Err(Invalid("label of a cell")));
        assert_eq!(scene(&h, &words), Err(Invalid("vertex or triangle count")));
        h.nodes.dims = [64, 64, 3];
        assert_eq!(
            scene(&h, &labelled([0, 0])),
            Err(Invalid("grid of displacements")),
            "more nodes than a tick may fill"
        );
        h.nodes.dims = [0; 3];
        h.structure_count = MAX_STRUCTURES as u32 + 1;
        assert_eq!(scene(&h, &labelled([0, 0])), Err(Invalid("structure count")));
    }
}
