//! A needle that meets a face at an angle: in a block and in the paper's gland, on its line and without one.

use super::*;
use crate::rows::{Row, keep};
use stylet_sim::scene::{Labels, Role, Structure};

const SPEED_M_PER_S: f64 = 0.05;
/// Depth of the tip behind the entry at the end.
const DEPTH_M: f64 = 30e-3;
/// Distance before the entry at which the needle begins.
const BEFORE_M: f64 = 10e-3;
/// The gate's limit for each tick.
const SLEW_N: f64 = 0.5 + 1e-9;

/// Makes 80 x 48 x 40 mm of gland.
fn block() -> SceneSource {
    let mut gland = Structure::soft("gland", 1);
    gland.role = Role::Target;
    let labels = Labels {
        dims: [40, 24, 20],
        spacing_m: 2e-3,
        cells: vec![1; 40 * 24 * 20],
        structures: vec![gland],
    };
    SceneSource::of_labels("block", &labels)
}

/// Outcome of an insertion, forces against the hand.
struct Found {
    /// Largest before the membrane gave way, along the needle.
    held_n: f64,
    /// Force at the end, along the needle.
    rest_n: f64,
    /// Largest force across the needle, relative to that along it, where the force is at least a newton.
    across: f64,
    step_n: f64,
    punctures: u32,
    moved_m: f64,
    left_m: f64,
    depth_m: f64,
}

/// Inserts through `point` on the face, or close to it, in `direction`, and withdraws.
fn insert(
    source: &SceneSource,
    kind: TissueKind,
    point: Vector3<f64>,
    direction: Vector3<f64>,
    on_line: bool,
) -> Found {
    let scene = source.build().expect("valid");
    let limits = TissueParameters::default().validate().expect("defaults are valid");
    let world = Box::new(World::new(scene, kind, limits, 1).expect("can be used"));
    let body = LineBody::of_source(source, kind)
        .expect("can be solved")
        .expect("has lines");
    let line = body
        .prepare(1, point.into(), direction.into(), false, &[], &mut || true)
        .expect("through the body");
    let entry = Vector3::from(line.hand.line().entry_m);
    let start = entry - direction * BEFORE_M;
    let hand = (Hand::steady(), LinkFaults::default());
    let force = ForceParameters::default();
    let mut session = if on_line {
        Session::on_line(world, (start, line), hand, force)
    } else {
        Session::over_link(world, start, hand, force, HAPTIC_TICKS_PER_TISSUE_TICK)
    };
    session.aim(direction);
    session.go_to(start, SPEED_M_PER_S);
    session.run(1.5);
    session.go_to(entry + direction * DEPTH_M, SPEED_M_PER_S);
    let inwards = session.run(2.0);
    let moved_m = largest_m(&session);
    let depth_m = inwards.last().expect("ticks").depth_m;
    let punctures = session.chain().needle.punctures;
    session.go_to(start, SPEED_M_PER_S);
    let out = session.run(8.0);
    let forces = || inwards.iter().chain(&out).map(|o| o.wrench.force_n);
    let steps = forces().zip(forces().skip(1)).map(|(a, b)| (b - a).norm());
    let across = forces().filter(|f| f.norm() >= 1.0).map(|f| {
        let along_n = f.dot(&direction);
        (f - direction * along_n).norm() / along_n.abs()
    });
    let held = inwards
        .iter()
        .take_while(|o| !o.puncture)
        .map(|o| -o.wrench.force_n.dot(&direction));
    Found {
        held_n: held.fold(0.0, f64::max),
        rest_n: -inwards.last().expect("ticks").wrench.force_n.dot(&direction),
        across: across.fold(0.0, f64::max),
        step_n: steps.fold(0.0, f64::max),
        punctures,
        moved_m,
        left_m: largest_m(&session),
        depth_m,
    }
}

fn largest_m(session: &Session) -> f64 {
    let body = session.world().tissue.deformed();
    let elements = 0..body.lattice.element_count() as u32;
    let sizes = elements.map(|e| Vector3::from(body.displacement(e)).norm());
    sizes.fold(0.0, f64::max) * body.lattice.spacing_m
}

fn tilted(degrees: f64) -> Vector3<f64> {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    Vector3::new(sine, 0.0, cosine)
}

/// The needle stopped within a nanometre before the face, as when the entry lies on an encoder step, and met nothing
/// from there on. Its resting place in the tissue depends on friction and cutting alone, whatever the angle.
#[test]
fn a_face_met_at_an_angle_is_felt_as_one_met_squarely() {
    let gland = SceneSource::Builtin("paper".to_owned());
    let lattice = gland.build().expect("built in").lattice;
    let (low, high) = lattice.bounds_m();
    let middle = (Vector3::from(low) + Vector3::from(high)) / 2.0;
    let block = block();
    let on_face = Vector3::new(15e-3, 24e-3, 0.0);
    // A point on the needle's path, and the distance before it at which the path begins.
    let places = [
        ("a block's face met at 45 degrees", &block, on_face, 0.0, 45.0),
        (
            "a block's face grazed, at 75 degrees from its normal",
            &block,
            on_face,
            0.0,
            75.0,
        ),
        (
            "the gland of `paper` met through its middle at 45 degrees",
            &gland,
            middle,
            60e-3,
            45.0,
        ),
    ];
    for (kind, on_line) in [
        (TissueKind::ChainMail, true),
        (TissueKind::ChainMail, false),
        (TissueKind::Fem, true),
        (TissueKind::Fem, false),
    ] {
        for (case, source, through, before_m, degrees) in places {
            let [square, found] = [0.0, degrees].map(|degrees| {
                let along = tilted(degrees);
                insert(source, kind, through - along * before_m, along, on_line)
            });
            let ratio = [found.held_n / square.held_n, found.rest_n / square.rest_n];
            let model = match (kind, on_line) {
                (TissueKind::Fem, true) => "fem, needle line",
                (TissueKind::Fem, false) => "fem, off the line",
                (_, true) => "chainmail, needle line",
                (_, false) => "chainmail, off the line",
            };
            let is_near = |ratio: f64| (ratio - 1.0).abs() <= 0.1;
            keep(&Row {
                number: 40,
                case,
                model,
                should: "membrane and rest as squarely to 10 %; force along the needle to 5 %; at most 0.5 N a tick; out again and at rest",
                happened: format!(
                    "gives way at {:.2} N ({:.2} N squarely), {:.2} N at {:.1} mm ({:.2} N at {:.1} mm); across {:.1} %; largest step {:.3} N; {:.1} mm of displacement, {:.3} mm left",
                    found.held_n,
                    square.held_n,
                    found.rest_n,
                    found.depth_m * 1e3,
                    square.rest_n,
                    square.depth_m * 1e3,
                    found.across * 1e2,
                    found.step_n,
                    found.moved_m * 1e3,
                    found.left_m * 1e3
                ),
                met: found.punctures == 1
                    && ratio.into_iter().all(is_near)
                    && found.across <= 0.05
                    && found.step_n <= SLEW_N
                    && found.left_m < 0.05e-3
                    && found.moved_m < 20e-3,
                warning: if on_line { "" } else { "the window says NO LINE" },
            });
        }
    }
}
