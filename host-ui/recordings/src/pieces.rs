//! What the core publishes, as a host and a recording have it.

use std::sync::{Arc, OnceLock};
use stylet_shm_schema::{
    Event, HapticState, ParametersInForce, PlanInForce, SceneHeader, SecondRecord, Session, SnapshotHeader, TickRecord,
    Vertex, check,
};
use stylet_surfaces::bodies::{Bodies, Segmentation};

/// The rest surface of the running scene.
#[derive(Clone, Debug)]
pub struct SceneModel {
    /// Counts, bounding boxes, structures.
    pub header: SceneHeader,
    /// Vertices at rest, m.
    pub rest_m: Vec<[f32; 3]>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// One for each cell of `header.labels`: 0 outside, else one more than the index among the header's structures.
    pub labels: Vec<u8>,
    bodies: OnceLock<Bodies>,
}

impl SceneModel {
    /// Builds a scene from these parts.
    pub fn new(header: SceneHeader, rest_m: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>, labels: Vec<u8>) -> Self {
        Self {
            header,
            rest_m,
            triangles,
            labels,
            bodies: OnceLock::new(),
        }
    }

    /// Returns the drawn surfaces, if a call of [`SceneModel::bodies`] has made them.
    pub fn bodies_made(&self) -> Option<&Bodies> {
        self.bodies.get()
    }

    /// Returns the drawn surfaces. The first call makes them, which takes too long for a frame.
    pub fn bodies(&self) -> &Bodies {
        self.bodies.get_or_init(|| {
            Bodies::of(Segmentation {
                header: &self.header,
                labels: &self.labels,
                rest_m: &self.rest_m,
                triangles: &self.triangles,
            })
        })
    }

    /// Returns the label at a place at rest, scene frame, m; 0 outside the body.
    pub fn label_at(&self, rest_m: [f64; 3]) -> u8 {
        let grid = &self.header.labels;
        let cell = [0, 1, 2].map(|a| ((rest_m[a] - grid.origin_m[a]) / grid.spacing_m).round());
        let dims = grid.dims.map(f64::from);
        if (0..3).any(|a| !(0.0..dims[a]).contains(&cell[a])) {
            return 0;
        }
        let [x, y, z] = cell.map(|c| c as usize);
        let n = (z * grid.dims[1] as usize + y) * grid.dims[0] as usize + x;
        self.labels.get(n).copied().unwrap_or(0)
    }

    /// Encodes the words behind the core's header: vertices, triangles, labels of the cells.
    pub fn words(&self) -> Vec<u32> {
        let positions = self.rest_m.iter().flatten().map(|c| c.to_bits());
        let indices = self.triangles.iter().flatten().copied();
        let cells = self.labels.chunks(4).map(|four| {
            let at = |n: usize| four.get(n).copied().unwrap_or(0);
            u32::from_le_bytes([at(0), at(1), at(2), at(3)])
        });
        positions.chain(indices).chain(cells).collect()
    }

    /// Returns the same scene under another run of the core.
    #[must_use]
    pub fn of_session(&self, session_id: u64) -> Self {
        let header = SceneHeader {
            session_id,
            ..self.header
        };
        Self::new(header, self.rest_m.clone(), self.triangles.clone(), self.labels.clone())
    }

    /// Decodes the core's data; `None` if it is inconsistent.
    pub fn of_words(header: &SceneHeader, words: &[u32]) -> Option<Self> {
        check::scene(header, words).ok()?;
        let (positions, rest) = words.split_at(3 * header.vertex_count as usize);
        let (indices, cells) = rest.split_at(3 * header.triangle_count as usize);
        let mut labels: Vec<u8> = cells.iter().flat_map(|word| word.to_le_bytes()).collect();
        labels.truncate(header.labels.node_count().unwrap_or(0));
        let place = |w: &[u32]| [0, 1, 2].map(|a| f32::from_bits(w[a]));
        Some(Self::new(
            *header,
            positions.chunks_exact(3).map(place).collect(),
            indices.chunks_exact(3).map(|w| [w[0], w[1], w[2]]).collect(),
            labels,
        ))
    }
}

/// The deformed body of one tissue tick.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Tick, needle, seeds.
    pub header: SnapshotHeader,
    /// Vertices of the surface, m.
    pub positions_m: Vec<[f32; 3]>,
    /// Displacement from rest at each node of the scene's grid.
    pub displacements_m: Vec<[f32; 3]>,
}

impl Snapshot {
    /// Builds a snapshot from its parts; `None` if they are inconsistent.
    pub fn of_parts(
        mut header: SnapshotHeader,
        positions_m: Vec<[f32; 3]>,
        displacements_m: Vec<[f32; 3]>,
    ) -> Option<Self> {
        header.vertex_count = u32::try_from(positions_m.len()).ok()?;
        header.node_count = u32::try_from(displacements_m.len()).ok()?;
        let all = positions_m.iter().chain(&displacements_m);
        let vertices: Vec<Vertex> = all.map(|&position_m| Vertex { position_m }).collect();
        check::snapshot(&header, &vertices).ok()?;
        Some(Self {
            header,
            positions_m,
            displacements_m,
        })
    }

    /// Decodes the core's data; `None` if it is inconsistent.
    pub fn of_vertices(header: &SnapshotHeader, vertices: &[Vertex]) -> Option<Self> {
        check::snapshot(header, vertices).ok()?;
        let (surface, inside) = vertices.split_at(header.vertex_count as usize);
        let places = |part: &[Vertex]| part.iter().map(|v| v.position_m).collect();
        Some(Self {
            header: *header,
            positions_m: places(surface),
            displacements_m: places(inside),
        })
    }
}

/// A recorded message of the core.
pub enum Piece {
    /// A tick of the force loop.
    Tick(Box<TickRecord>),
    /// An event.
    Event(Box<Event>),
    /// A tick of the second device's loop.
    Second(Box<SecondRecord>),
    /// Fields of the state that ticks do not hold.
    State(Box<HapticState>),
    /// Scene from now on.
    Scene(Arc<SceneModel>),
    /// Plan from now on.
    Plan(Box<PlanInForce>),
    /// Parameters from now on.
    Parameters(Box<ParametersInForce>),
    /// Snapshot of the tissue.
    Snapshot(Box<Snapshot>),
}

/// The first run of the core in a recording.
pub struct Played {
    /// Announcement of the core, as far as recorded.
    pub session: Session,
    /// Messages in time order, ns since the first.
    pub pieces: Vec<(u64, Piece)>,
    /// Why reading ended before the end of the file, if it did.
    pub cut_off: Option<String>,
}

impl Played {
    /// Duration, ns.
    pub fn length_ns(&self) -> u64 {
        self.pieces.last().map_or(0, |(time_ns, _)| *time_ns)
    }
}
