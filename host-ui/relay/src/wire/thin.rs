//! A snapshot reduced for a screen: displacements from rest, in half floats, within a limit of bytes.
//!
//! A half float has 11 bits: the error of a displacement is at most 1/2048 of its larger coordinate's power of two, 3.8
//! µm up to 15.6 mm and 7.6 µm up to 31 mm. If a scene does not fit, each message holds one of n positions and the next
//! message the next ones, and the positions in between move with their neighbours; the header, needle, seeds and
//! needles that stay in are complete in each. While no position moves, a member that has all of them receives none: a
//! scene at rest costs a member 1 kB instead of 40.

use super::between::{Bounds, Lattice};
use bytemuck::{Pod, Zeroable};
use half::f16;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::mem::offset_of;
use stylet_shm_schema::check::{self, Invalid};
use stylet_shm_schema::{
    LeftNeedlePose, MAX_LABEL_CELLS, MAX_LEFT_NEEDLES, MAX_NODES, MAX_SEEDS, SceneHeader, SceneId, SeedPose,
    SnapshotHeader, Vertex,
};

/// Most bytes of one snapshot's payload.
pub const MAX_THIN_BYTES: usize = 40_000;
/// Most vertices of a scene.
const MAX_VERTICES: usize = 4 * MAX_LABEL_CELLS;
/// The part of the header before its arrays of seeds and needles.
const PREFIX: usize = offset_of!(SnapshotHeader, seeds);

/// The positions in a message, see [`held_by`]; a stride of 0 means none, since they are unchanged.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Share {
    stride: u32,
    phase: u32,
}

/// The fixed part of a scene: the origins of the displacements.
#[derive(Clone, Debug, Default)]
pub struct Rest {
    id: SceneId,
    vertices: usize,
    /// Vertices, then nodes.
    places_m: Vec<[f32; 3]>,
    bounds: Bounds,
}

impl Rest {
    /// Builds it from a validated scene.
    pub fn of_scene(header: &SceneHeader, words: &[u32]) -> Self {
        let vertices = words.get(..3 * header.vertex_count as usize).unwrap_or_default();
        let vertices = vertices
            .chunks_exact(3)
            .map(|w| [0, 1, 2].map(|a| f32::from_bits(w[a])));
        let mut places_m: Vec<[f32; 3]> = vertices.collect();
        let (count, grid) = (places_m.len(), header.nodes);
        places_m.extend((0..grid.node_count().unwrap_or(0).min(MAX_NODES)).map(|i| {
            let [x, y, _] = grid.dims.map(|n| n as usize);
            let at = [i % x, i / x % y, i / x / y];
            [0, 1, 2].map(|a| (grid.origin_m[a] + at[a] as f64 * grid.spacing_m) as f32)
        }));
        Self {
            id: header.id(),
            vertices: count,
            bounds: Bounds::of(&places_m),
            places_m,
        }
    }

    fn total(&self) -> usize {
        self.places_m.len()
    }

    fn fits(&self, header: &SnapshotHeader) -> bool {
        header.scene_id() == self.id
            && header.vertex_count as usize == self.vertices
            && header.node_count as usize == self.total() - self.vertices
    }

    /// Origin of a position's displacement; for a node the snapshot itself holds the displacement.
    fn origin_m(&self, i: usize) -> [f32; 3] {
        match i < self.vertices {
            true => self.places_m.get(i).copied().unwrap_or_default(),
            false => [0.0; 3],
        }
    }
}

/// A snapshot with its positions in half floats, made once for all members.
pub struct Thin {
    /// Header, seeds and needles.
    head: Vec<u8>,
    places: Vec<[u8; 6]>,
    fingerprint: u64,
}

impl Thin {
    /// Thins a snapshot; `None` if it is of another scene.
    pub fn of(rest: &Rest, header: &SnapshotHeader, vertices: &[Vertex]) -> Option<Self> {
        if !rest.fits(header) || check::snapshot(header, vertices).is_err() {
            return None;
        }
        let seeds = &header.seeds[..header.seed_count as usize];
        let mut head = bytemuck::bytes_of(header)[..PREFIX].to_vec();
        head.extend_from_slice(bytemuck::cast_slice(seeds));
        head.extend_from_slice(bytemuck::cast_slice(header.left()));
        let place = |(i, vertex): (usize, &Vertex)| {
            let origin_m = rest.origin_m(i);
            let [x, y, z] = [0, 1, 2].map(|a| f16::from_f32(vertex.position_m[a] - origin_m[a]).to_le_bytes());
            [x[0], x[1], y[0], y[1], z[0], z[1]]
        };
        let places: Vec<[u8; 6]> = vertices.iter().enumerate().map(place).collect();
        let mut hasher = DefaultHasher::new();
        (rest.id.session_id, rest.id.generation).hash(&mut hasher);
        hasher.write(places.as_flattened());
        Some(Self {
            head,
            fingerprint: hasher.finish(),
            places,
        })
    }

    /// Fingerprint of the scene and all positions: unchanged while none has moved.
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Number of messages that share its positions, with `room` bytes of them in each.
    pub fn stride(&self, room: usize) -> usize {
        let room = room.min(MAX_THIN_BYTES - self.head.len() - size_of::<Share>());
        self.places.len().div_ceil((room / 6).max(1)).max(1)
    }

    /// Returns the payload of the `number`-th message.
    pub fn with_places(&self, number: u64, room: usize) -> Vec<u8> {
        let stride = self.stride(room);
        let phase = (number % stride as u64) as usize;
        let mut bytes = self.before_places(stride, phase);
        for i in held_by(stride, phase, self.places.len()) {
            bytes.extend_from_slice(&self.places[i]);
        }
        bytes
    }

    /// Returns the payload for a member that has these positions.
    pub fn without_places(&self) -> Vec<u8> {
        self.before_places(0, 0)
    }

    fn before_places(&self, stride: usize, phase: usize) -> Vec<u8> {
        let share = Share {
            stride: stride as u32,
            phase: phase as u32,
        };
        [&self.head, bytemuck::bytes_of(&share)].concat()
    }
}

/// Selects one of each `stride` consecutive positions, and the next one in the next `stride`: otherwise neighbours in a
/// grid, whose rows have any length, could all fall to one message.
fn held_by(stride: usize, phase: usize, total: usize) -> impl Iterator<Item = usize> + Clone {
    let of_group = move |group: usize| group * stride + (phase + group) % stride;
    let groups = if stride == 0 { 0 } else { total.div_ceil(stride) };
    (0..groups).map(of_group).filter(move |i| *i < total)
}

fn is_held_by(stride: usize, phase: usize, i: usize) -> bool {
    i % stride == (phase + i / stride) % stride
}

/// Displacements known to the far side, by position.
#[derive(Debug, Default)]
pub struct Displacements {
    of: SceneId,
    held: Vec<Held>,
}

/// The last received displacement of a position and its time; a guess from its neighbours until it is received.
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    moved_m: [f32; 3],
    time_ns: u64,
    is_guess: bool,
}

impl Held {
    /// Age in s at `time_ns`.
    fn age_s(&self, time_ns: u64) -> f32 {
        time_ns.saturating_sub(self.time_ns) as f32 * 1e-9
    }

    /// Returns the change from this to the next, with the time between.
    fn change(&self, next: &Self) -> [f32; 4] {
        let [x, y, z] = [0, 1, 2].map(|a| next.moved_m[a] - self.moved_m[a]);
        [x, y, z, self.age_s(next.time_ns)]
    }

    /// Extrapolates to `time_ns`, given the neighbours' `change`: no further than they moved if the time is longer.
    fn moved_on_m(&self, [x, y, z, time_s]: [f32; 4], time_ns: u64) -> [f32; 3] {
        let share = match time_s > 0.0 {
            true => (self.age_s(time_ns) / time_s).min(1.0),
            false => 0.0,
        };
        let change_m = [x, y, z];
        [0, 1, 2].map(|a| self.moved_m[a] + share * change_m[a])
    }
}

/// Decodes a whole snapshot: missing positions are taken from earlier ones and moved with their neighbours. `None` for
/// another scene, and for a snapshot without positions that are not known.
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
    if share.phase > share.stride.saturating_sub(1) {
        return Err(Invalid("share of a snapshot"));
    }
    let (stride, phase, total) = (share.stride as usize, share.phase as usize, total as usize);
    if !rest.fits(&header) {
        return Ok(None);
    }
    if body.len() != 6 * held_by(stride, phase, total).count() {
        return Err(Invalid("length of a snapshot"));
    }
    let are_known = known.of == rest.id && known.held.len() == rest.total();
    if stride == 0 && !are_known {
        return Ok(None);
    }
    let halves = |b: &[u8]| [0, 2, 4].map(|i| f16::from_le_bytes([b[i], b[i + 1]]).to_f32());
    let moved = body.chunks_exact(6).map(halves);
    if !are_known {
        let places = held_by(stride, phase, total);
        *known = Displacements::guess(rest, header.time_ns, places.zip(moved.clone()));
    }
    let vertices = known.take(rest, header.time_ns, (stride, phase), moved);
    if let Err(invalid) = check::snapshot(&header, &vertices) {
        // Invalid data is not kept for the next one.
        *known = Displacements::default();
        return Err(invalid);
    }
    Ok(Some((header, vertices)))
}

impl Displacements {
    /// Guesses the displacements of a scene without earlier data from the neighbours that are known.
    fn guess(rest: &Rest, time_ns: u64, moved: impl Iterator<Item = (usize, [f32; 3])> + Clone) -> Self {
        let mut lattice = Lattice::new(&rest.bounds, moved.clone().count());
        moved.for_each(|(i, [x, y, z])| lattice.add(rest.places_m[i], [x, y, z, 0.0]));
        let guessed = rest.places_m.iter().map(|place_m| {
            let [x, y, z, _] = lattice.at(*place_m);
            Held {
                moved_m: [x, y, z],
                time_ns,
                is_guess: true,
            }
        });
        Self {
            of: rest.id,
            held: guessed.collect(),
        }
    }

    /// Updates all positions from those in a message.
    fn take(
        &mut self,
        rest: &Rest,
        time_ns: u64,
        (stride, phase): (usize, usize),
        moved: impl ExactSizeIterator<Item = [f32; 3]>,
    ) -> Vec<Vertex> {
        if stride == 0 {
            self.held.iter_mut().for_each(|held| held.time_ns = time_ns);
        }
        // A message with all positions leaves none in between.
        let mut changes = Lattice::new(&rest.bounds, if stride > 1 { moved.len() } else { 1 });
        for (i, moved_m) in held_by(stride, phase, rest.total()).zip(moved) {
            let next = Held {
                moved_m,
                time_ns,
                is_guess: false,
            };
            let before = std::mem::replace(&mut self.held[i], next);
            if stride > 1 && !before.is_guess {
                changes.add(rest.places_m[i], before.change(&next));
            }
        }
        let places = self.held.iter().enumerate().map(|(i, held)| {
            let origin_m = rest.origin_m(i);
            let moved_m = match stride > 1 && changes.has_moved() && !is_held_by(stride, phase, i) {
                true => held.moved_on_m(changes.at(rest.places_m[i]), time_ns),
                false => held.moved_m,
            };
            Vertex {
                position_m: [0, 1, 2].map(|a| origin_m[a] + moved_m[a]),
            }
        });
        places.collect()
    }
}
