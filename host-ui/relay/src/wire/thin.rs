//! A snapshot as a screen needs it: what moved from rest, in half floats, within a bound of bytes.
//!
//! A half float has 11 bits: a displacement is wrong by at most 1/2048 of its larger coordinate's power of two, 3.8 um up to
//! 15.6 mm and 7.6 um up to 31 mm. Where all of a scene does not fit, each message holds every n-th place and the next
//! message the next ones; the header, needle, seeds and needles that stay in are whole in each.

use bytemuck::{Pod, Zeroable};
use half::f16;
use std::mem::offset_of;
use stylet_shm_schema::check::{self, Invalid};
use stylet_shm_schema::{
    LeftNeedlePose, MAX_LABEL_CELLS, MAX_LEFT_NEEDLES, MAX_NODES, MAX_SEEDS, SceneHeader, SceneId, SeedPose,
    SnapshotHeader, Vertex,
};

/// Bytes of the payload of one snapshot at most.
pub const MAX_THIN_BYTES: usize = 40_000;
/// Vertices of a scene at most.
const MAX_VERTICES: usize = 4 * MAX_LABEL_CELLS;
/// The part of the header before its arrays of seeds and needles.
const PREFIX: usize = offset_of!(SnapshotHeader, seeds);

/// Which places a message holds: `phase`, `phase + stride`, and so on.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Share {
    stride: u32,
    phase: u32,
}

/// What stands still in a scene: the places from which displacements count.
#[derive(Clone, Debug, Default)]
pub struct Rest {
    id: SceneId,
    vertices_m: Vec<[f32; 3]>,
    nodes: usize,
}

impl Rest {
    /// Of a scene that was checked.
    pub fn of_scene(header: &SceneHeader, words: &[u32]) -> Self {
        let places = words.get(..3 * header.vertex_count as usize).unwrap_or_default();
        Self {
            id: header.id(),
            vertices_m: places
                .chunks_exact(3)
                .map(|w| [0, 1, 2].map(|a| f32::from_bits(w[a])))
                .collect(),
            nodes: header.nodes.node_count().unwrap_or(0),
        }
    }

    fn total(&self) -> usize {
        self.vertices_m.len() + self.nodes
    }

    fn fits(&self, header: &SnapshotHeader) -> bool {
        header.scene_id() == self.id
            && header.vertex_count as usize == self.vertices_m.len()
            && header.node_count as usize == self.nodes
    }

    fn place_m(&self, i: usize) -> [f32; 3] {
        self.vertices_m.get(i).copied().unwrap_or_default()
    }
}

/// The payload of the `number`-th snapshot, with `room` bytes of places; nothing for one of another scene.
pub fn encode_snapshot(
    rest: &Rest,
    header: &SnapshotHeader,
    vertices: &[Vertex],
    number: u64,
    room: usize,
) -> Option<Vec<u8>> {
    if !rest.fits(header) || check::snapshot(header, vertices).is_err() {
        return None;
    }
    let seeds = &header.seeds[..header.seed_count as usize];
    let mut bytes = bytemuck::bytes_of(header)[..PREFIX].to_vec();
    bytes.extend_from_slice(bytemuck::cast_slice(seeds));
    bytes.extend_from_slice(bytemuck::cast_slice(header.left()));
    let room = room.min(MAX_THIN_BYTES - bytes.len() - size_of::<Share>());
    let stride = vertices.len().div_ceil((room / 6).max(1)).max(1);
    let phase = (number % stride as u64) as usize;
    let share = Share {
        stride: stride as u32,
        phase: phase as u32,
    };
    bytes.extend_from_slice(bytemuck::bytes_of(&share));
    for (i, vertex) in vertices.iter().enumerate().skip(phase).step_by(stride) {
        let place = rest.place_m(i);
        for (at, rest) in vertex.position_m.iter().zip(place) {
            bytes.extend_from_slice(&f16::from_f32(at - rest).to_le_bytes());
        }
    }
    Some(bytes)
}

/// The displacements that the far side knows, by place.
#[derive(Clone, Debug, Default)]
pub struct Displacements {
    of: SceneId,
    moved_m: Vec<[f32; 3]>,
}

/// The snapshot in `body`, whole: places that it does not hold are as they were in an earlier one. `None` for one of another
/// scene.
pub fn decode_snapshot(
    rest: &Rest,
    known: &mut Displacements,
    body: &[u8],
) -> Result<Option<(SnapshotHeader, Vec<Vertex>)>, Invalid> {
    let (prefix, body) = body.split_at_checked(PREFIX).ok_or(Invalid("header of a snapshot"))?;
    let mut header = SnapshotHeader::zeroed();
    bytemuck::bytes_of_mut(&mut header)[..PREFIX].copy_from_slice(prefix);
    let (seeds, left) = (header.seed_count as usize, header.left_count as usize);
    let total = u64::from(header.vertex_count) + u64::from(header.node_count);
    if seeds > MAX_SEEDS || left > MAX_LEFT_NEEDLES || total > (MAX_VERTICES + MAX_NODES) as u64 {
        return Err(Invalid("counts of a snapshot"));
    }
    let lengths = (seeds * size_of::<SeedPose>(), left * size_of::<LeftNeedlePose>());
    let (seed_bytes, body) = body.split_at_checked(lengths.0).ok_or(Invalid("seeds"))?;
    let (left_bytes, body) = body
        .split_at_checked(lengths.1)
        .ok_or(Invalid("needles that stay in"))?;
    let (share, body) = body.split_at_checked(size_of::<Share>()).ok_or(Invalid("share"))?;
    bytemuck::cast_slice_mut(&mut header.seeds[..seeds]).copy_from_slice(seed_bytes);
    bytemuck::cast_slice_mut(&mut header.left[..left]).copy_from_slice(left_bytes);
    let share: Share = bytemuck::pod_read_unaligned(share);
    if share.stride == 0 || share.phase >= share.stride {
        return Err(Invalid("share of a snapshot"));
    }
    let (stride, phase, total) = (share.stride as usize, share.phase as usize, total as usize);
    if body.len() != 6 * total.saturating_sub(phase).div_ceil(stride) {
        return Err(Invalid("length of a snapshot"));
    }
    if !rest.fits(&header) {
        return Ok(None);
    }
    if known.of != rest.id || known.moved_m.len() != rest.total() {
        (known.of, known.moved_m) = (rest.id, vec![[0.0; 3]; rest.total()]);
    }
    for (at, halves) in known
        .moved_m
        .iter_mut()
        .skip(phase)
        .step_by(stride)
        .zip(body.chunks_exact(6))
    {
        *at = [0, 2, 4].map(|b| f16::from_le_bytes([halves[b], halves[b + 1]]).to_f32());
    }
    let whole = known.moved_m.iter().enumerate().map(|(i, moved)| {
        let place = rest.place_m(i);
        Vertex {
            position_m: [0, 1, 2].map(|a| place[a] + moved[a]),
        }
    });
    let vertices: Vec<Vertex> = whole.collect();
    if let Err(invalid) = check::snapshot(&header, &vertices) {
        // What is invalid is not kept for the next one.
        *known = Displacements::default();
        return Err(invalid);
    }
    Ok(Some((header, vertices)))
}
