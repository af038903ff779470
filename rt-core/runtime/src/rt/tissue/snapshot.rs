//! Snapshots of the deformed body, written straight into the memory that the control thread reads.

use super::TissueLoop;
use crate::rt::clock;
use crate::rt::seed;
use nalgebra::Vector3;
use std::sync::atomic::Ordering;
use stylet_shm_schema::{LeftNeedlePose, MAX_BEND_POINTS, MAX_SEEDS, SnapshotHeader, Vertex};
use stylet_sim::line::MAX_LEFT;
use stylet_sim::tissue::StepReport;

/// Ticks between snapshots while the needle moves: 67 Hz, above the rate of most screens. Motion with the needle at
/// rest is shown at 33 Hz, and an undisplaced body at 17 Hz, where each snapshot is the same.
const TICKS_MOVING: u64 = 3;
const TICKS_AT_REST: u64 = 6;
const TICKS_UNDISPLACED: u64 = 12;

/// State shown by the last snapshot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shown {
    tick: u64,
    tip_in_scene: [f64; 3],
    body_moved: [f64; 3],
    direction: [f64; 3],
    seeds: usize,
    left: usize,
    scene_generation: u64,
    /// Some part of the body is displaced.
    is_displaced: bool,
}

impl TissueLoop {
    /// True if the next snapshot is due: sooner after the needle has moved or a seed was dropped.
    fn is_snapshot_due(&self, now: &Shown) -> bool {
        let same = Shown {
            tick: now.tick,
            ..self.shown
        };
        let least = match *now == same {
            false => TICKS_MOVING,
            true if now.is_displaced => TICKS_AT_REST,
            true => TICKS_UNDISPLACED,
        };
        now.tick.wrapping_sub(self.shown.tick) >= least || now.scene_generation != self.shown.scene_generation
    }

    pub(super) fn publish_snapshot(&mut self, woke_ns: u64, report: &StepReport) {
        let work_ns = clock::now_ns().saturating_sub(woke_ns);
        self.state.response.worst_work_ns = self.state.response.worst_work_ns.max(work_ns);
        let now = Shown {
            tick: self.state.response.tick,
            tip_in_scene: self.state.pose.tip_in_scene.into(),
            body_moved: self.state.pose.body_moved_m.into(),
            direction: self.state.pose.direction.into(),
            seeds: self.seeds.len(),
            left: self.left.len(),
            scene_generation: self.world.generation,
            is_displaced: self.is_displaced(report),
        };
        if !self.is_snapshot_due(&now) {
            return;
        }
        // SYNC: stored by the control thread; nothing but the flag is carried.
        if !self.ports.is_watched.load(Ordering::Relaxed) {
            return;
        }
        // Taken out meanwhile, since it is filled from the rest of the world.
        let Some(mut board) = self.world.shown.take() else {
            return;
        };
        board.write(|header, vertices| self.fill(header, vertices, (woke_ns, work_ns), report, now.is_displaced));
        self.world.shown = Some(board);
        self.shown = now;
    }

    /// True also for a displacement that is not a number.
    fn is_displaced(&self, report: &StepReport) -> bool {
        let body = self.world.tissue.deformed();
        report.max_displacement != 0.0 || body.carried.largest_m(body.lattice.spacing_m) != 0.0
    }

    fn fill(
        &self,
        header: &mut SnapshotHeader,
        vertices: &mut [Vertex],
        (woke_ns, work_ns): (u64, u64),
        report: &StepReport,
        is_displaced: bool,
    ) {
        let vertex_count = self.world.scene.surface.vertex_elements.len();
        let body = self.world.tissue.deformed();
        // Both always succeed: a vertex is three f32, and the board was made for this scene.
        if let Ok(positions) = bytemuck::try_cast_slice_mut::<Vertex, [f32; 3]>(vertices)
            && let Some((surface, inside)) = positions.split_at_mut_checked(vertex_count)
        {
            let scene = &self.world.scene;
            if is_displaced {
                body.write_surface(&scene.surface, surface);
                body.write_displacements(&scene.nodes.elements, inside);
            } else {
                surface
                    .iter_mut()
                    .zip(&scene.surface.rest_m)
                    .for_each(|(slot, rest_m)| *slot = *rest_m);
                inside.fill([0.0; 3]);
            }
            self.move_with_body(surface, inside);
        }
        let spacing_m = self.world.scene.body.spacing_m;
        *header = SnapshotHeader {
            session_id: self.session_id,
            scene_generation: self.world.generation,
            tissue_tick: self.state.response.tick,
            time_ns: woke_ns,
            tip_in_scene_m: self.in_scene(self.state.pose.tip_in_scene.into()),
            needle_direction: self.state.pose.direction.into(),
            held_in_scene_m: self.state.held.map_or([0.0; 3], |h| self.in_scene(h.position_m)),
            residual: report.residual,
            max_displacement_m: f64::from(report.max_displacement) * spacing_m,
            work_ns,
            passes: report.passes,
            moved_elements: report.moved,
            held_element: self.state.held.map_or(u32::MAX, |h| h.element),
            phase: self.state.pose.phase as u32,
            vertex_count: vertex_count as u32,
            node_count: self.world.scene.nodes.elements.len() as u32,
            bend_count: 0,
            bend_spacing_m: 0.0,
            bend_m: [[0.0; 3]; MAX_BEND_POINTS],
            left_count: self.left.len() as u32,
            reserved: 0,
            body_moved_m: self.state.pose.body_moved_m.into(),
            seed_count: self.seeds.len() as u32,
            seeds: [bytemuck::Zeroable::zeroed(); MAX_SEEDS],
            left: [bytemuck::Zeroable::zeroed(); MAX_LEFT],
        };
        for (slot, left) in header.left.iter_mut().zip(&self.left) {
            let line = &left.line.line;
            *slot = LeftNeedlePose {
                number: left.line.generation,
                entry_m: self.in_scene(line.entry_m),
                direction: line.axes[0],
                tip_m: self.in_scene(line.point_m(left.used.tip_m, [0.0; 2])),
            };
        }
        self.fill_bend(header);
        for (slot, pose) in header.seeds.iter_mut().zip(seed::poses(&self.seeds, body)) {
            *slot = pose;
        }
    }

    /// Converts a point of the body, which an exercise may have moved, to the scene frame.
    fn in_scene(&self, place_m: [f64; 3]) -> [f64; 3] {
        let by_m = self.state.pose.body_moved_m;
        [0, 1, 2].map(|a| {
            if by_m[a] == 0.0 {
                place_m[a]
            } else {
                place_m[a] + by_m[a]
            }
        })
    }

    fn move_with_body(&self, surface_m: &mut [[f32; 3]], displacements_m: &mut [[f32; 3]]) {
        let by_m = self.state.pose.body_moved_m;
        if by_m == Vector3::zeros() {
            return;
        }
        for value_m in surface_m.iter_mut().chain(displacements_m) {
            *value_m = [0, 1, 2].map(|a| value_m[a] + by_m[a] as f32);
        }
    }

    /// Fills in points along a bent needle.
    fn fill_bend(&self, header: &mut SnapshotHeader) {
        let (Some(bent), Some(line)) = (self.state.loads.bent, &self.line) else {
            return;
        };
        header.bend_count = MAX_BEND_POINTS as u32;
        header.bend_spacing_m = bent.needle.length_m / (MAX_BEND_POINTS - 1) as f64;
        for (n, bend_m) in header.bend_m.iter_mut().enumerate() {
            let off_m = self.state.loads.deflection_m(n as f64 * header.bend_spacing_m);
            *bend_m = [0, 1, 2].map(|a| off_m[0] * line.line.axes[1][a] + off_m[1] * line.line.axes[2][a]);
        }
    }
}
