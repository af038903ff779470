//! Lines that are prepared, and when a needle gets one.

use super::*;
use crate::rt::wiring::{Capacities, HapticPorts, TissuePorts, Wiring};
use bytemuck::Zeroable;
use stylet_sim::scene::{Labels, TissueKind};

/// Rings as in a run, with no loop at the other ends.
fn rings() -> (ControlPorts, HapticPorts, TissuePorts) {
    let wiring = Wiring::new(Capacities::RUN, None, None);
    (wiring.control, wiring.haptic, wiring.tissue)
}

/// Returns a record of a needle along z.
fn needle_at(tip_in_scene_m: [f64; 3], flags: u32) -> TickRecord {
    TickRecord {
        tip_in_scene_m,
        world_from_tool: [0.0, 0.0, 0.0, 1.0],
        flags,
        ..TickRecord::zeroed()
    }
}

/// Builds a cube of 2 mm elements.
fn cube(edge: usize) -> SceneSource {
    let labels = Labels {
        dims: [edge; 3],
        spacing_m: 2e-3,
        cells: vec![1; edge.pow(3)],
        structures: Vec::new(),
    };
    SceneSource::of_labels("cube", &labels)
}

const INTO_BODY: [f64; 3] = [0.0, 0.0, 1.0];

/// A second needle had to wait for its line as the first had, though the plan named both.
#[test]
fn the_lines_of_both_planned_needles_are_there_when_they_come() {
    let mut lines = LinePreparer::new(Arc::new(cube(6)), TissueKind::Fem, Work::AtOnce);
    let (mut rings, mut haptic, _tissue) = rings();
    let entries_m = [[5e-3, 5e-3, 0.0], [7e-3, 5e-3, 0.0]];
    lines.expect_planned(Some((entries_m[0], INTO_BODY)));
    lines.expect_next(entries_m[1], INTO_BODY);
    for _ in 0..3 {
        lines.pass(0, Some(&needle_at([0.5, 0.5, -0.1], flags::IN_CONTACT)), 1, &mut rings);
    }
    assert_eq!(lines.kept.len(), 2, "both are prepared while a needle is in tissue");
    assert!(haptic.lines.pop().is_err(), "and no loop has them yet");
    for ((entry_m, left), now_ns) in entries_m.into_iter().zip([1, 0]).zip([0, 2 * STEADY_NS]) {
        let outside = needle_at([entry_m[0], entry_m[1], -0.02], 0);
        lines.pass(now_ns, Some(&outside), 1, &mut rings);
        assert!(haptic.lines.pop().is_err(), "it may still move on");
        lines.pass(now_ns + STEADY_NS, Some(&outside), 1, &mut rings);
        let line = haptic
            .lines
            .pop()
            .expect("handed over as soon as the needle stands there");
        assert!(line.is_met_by(&outside.tip_in_scene_m.into(), &INTO_BODY.into()));
        assert_eq!((lines.kept.len(), lines.under_way.is_some()), (left, false));
    }
    assert_eq!(lines.generation, 2, "none was solved for twice");
}

/// A plan whose needle misses the body must not cause endless retries, nor drop the line in use.
#[test]
fn an_axis_without_tissue_is_tried_once() {
    let mut lines = LinePreparer::new(Arc::new(cube(4)), TissueKind::Fem, Work::AtOnce);
    let (mut rings, ..) = rings();
    lines.expect_planned(Some(([0.1, 0.1, 0.0], INTO_BODY)));
    for now_ns in 0..20 {
        lines.pass(
            now_ns,
            Some(&needle_at([0.5, 0.5, -0.1], flags::IN_CONTACT)),
            1,
            &mut rings,
        );
    }
    assert_eq!((lines.without.len(), lines.generation), (1, 1));
}
