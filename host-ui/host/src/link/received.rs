//! A host's view of the core, in its own types.

use std::sync::OnceLock;
use std::time::Duration;
use stylet_shm_schema::{Refusal, Reply, ReplyStatus, SceneHeader, SnapshotHeader, Vertex, check};
use stylet_surfaces::bodies::{Bodies, Segmentation};

/// Status of the core.
#[derive(Clone, Debug, PartialEq)]
pub enum LinkStatus {
    /// No core has announced itself, or it has been silent for long; `why` says what to do.
    Absent {
        /// Instructions for the user.
        why: String,
    },
    /// The heartbeat moves.
    Live,
    /// The heartbeat has not moved.
    Silent {
        /// Time since the last heartbeat.
        since: Duration,
    },
}

impl Default for LinkStatus {
    fn default() -> Self {
        Self::Absent { why: String::new() }
    }
}

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
    pub(super) fn of_vertices(header: &SnapshotHeader, vertices: &[Vertex]) -> Option<Self> {
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

/// The core's answer to a command or an upload: the first tick of the force loop that ran with the change.
pub type Answer = Result<u64, Refusal>;

/// Decodes an answer; `None` if it is inconsistent.
pub(super) fn answer_of(reply: &Reply) -> Option<Answer> {
    Some(match ReplyStatus::from_number(reply.status)? {
        ReplyStatus::Accepted => Ok(reply.effective_tick),
        _ => Err(Refusal {
            reasons: reply.reasons().to_vec(),
            text: reply.text.read(),
        }),
    })
}

/// Reason why something could not be sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LinkError {
    /// There is no core, for this reason.
    #[error("{0}")]
    Absent(String),
    /// The request itself is wrong.
    #[error(transparent)]
    Request(#[from] Refusal),
    /// A volume of another size than its header says, or of more cells than can be sent.
    #[error("the volume has {cells} cells; it must have {expected} for its size, and 1 to {most} can be sent")]
    Volume {
        /// Cells of the volume.
        cells: usize,
        /// Cells for its size.
        expected: usize,
        /// Most cells that can be sent.
        most: usize,
    },
    /// The queue is full.
    #[error("too many requests wait to be sent to rt-core; try again")]
    Busy,
    /// A recording takes the place of a core.
    #[error("a recording is shown; close it first")]
    Playback,
}
