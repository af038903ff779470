//! Tissue outlines in a far window during fast motion, against the true positions in that tissue tick.

use crate::fixture::{Keys, Named, core, join, until};
use crate::host::{Host, go, still_moving_m};
use crate::watch::{quantile, settle};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use stylet_ports::{self as service, Node};
use stylet_relay::keys::{Role, Validity};
use stylet_relay::now_ns;
use stylet_relay::wire::{Displacements, MAX_THIN_BYTES, Rest, Thin, decode_snapshot};
use stylet_shm_schema::Instance;
use stylet_shm_schema::{SnapshotHeader, Vertex};
use stylet_test_kit::witness::where_the_machine_runs;

/// Age in ms, header and positions of each snapshot, by its tissue tick.
type Shown = BTreeMap<u64, (f64, Box<SnapshotHeader>, Vec<Vertex>)>;

fn rest(instance: &Instance) -> Rest {
    let node = Node::join(instance).expect("shared memory");
    let port = service::scene::subscriber(&node).expect("a port");
    let mut rest = None;
    until(Duration::from_secs(5), || {
        let scene = port.receive();
        rest = scene.map(|scene| Rest::of_scene(scene.header(), scene.values()));
        rest.is_some()
    });
    rest.expect("a scene")
}

fn shown(instance: &Instance, until: Instant) -> Shown {
    let node = Node::join(instance).expect("shared memory");
    let port = service::snapshots::subscriber(&node).expect("a port");
    let mut shown = Shown::new();
    while Instant::now() < until {
        while let Some(sample) = port.receive() {
            let age_ms = now_ns().saturating_sub(sample.header().time_ns) as f64 * 1e-6;
            let header = Box::new(*sample.header());
            shown.insert(header.tissue_tick, (age_ms, header, sample.values().to_vec()));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    shown
}

fn apart_mm(a: &Vertex, b: &Vertex) -> f64 {
    let squares = (0..3).map(|i| f64::from(a.position_m[i] - b.position_m[i]).powi(2));
    squares.sum::<f64>().sqrt() * 1e3
}

/// Largest error of any position in any snapshot, and largest root mean square in one, over the positions that have
/// moved by then.
#[derive(Default)]
struct Errors {
    most_mm: f64,
    rms_mm: f64,
}

impl Errors {
    fn add(&mut self, errors_mm: &[f64]) {
        let squares: f64 = errors_mm.iter().map(|e| e * e).sum();
        self.rms_mm = self.rms_mm.max((squares / errors_mm.len().max(1) as f64).sqrt());
        self.most_mm = errors_mm.iter().copied().fold(self.most_mm, f64::max);
    }
}

/// The former method: each message moved its own positions, and the others stayed at their last values.
struct Standing {
    places: Vec<Vertex>,
    stride: usize,
    number: usize,
}

impl Standing {
    fn new(places: &[Vertex]) -> Self {
        let room = MAX_THIN_BYTES - 1000;
        Self {
            places: places.to_vec(),
            stride: places.len().div_ceil(room / 6),
            number: 0,
        }
    }

    fn take(&mut self, places: &[Vertex]) {
        let phase = self.number % self.stride;
        (phase..places.len())
            .step_by(self.stride)
            .for_each(|i| self.places[i] = places[i]);
        self.number += 1;
    }
}

#[test]
fn positions_moved_with_their_neighbours_are_closer_to_the_tissue() {
    let (near, far) = (Named::new(), Named::new());
    let _core = core(&near, &["--scene", "pelvis"]);
    let keys = Keys::new();
    let served = keys.serve(&near);
    let joined = join(&keys.invite("anna", Role::Observer, Validity::days(1)), &far);
    let (mut host, mut local) = (Host::new(&far), Host::new(&near));
    let both_see = host.sees_the_core(Duration::from_secs(20)) && local.sees_the_core(Duration::from_secs(20));
    assert!(both_see, "{}{}", served.log(), joined.log());
    settle(&far);
    let (scene, rest) = (local.scene.expect("seen"), rest(&near.0));
    let local = RefCell::new(local);
    where_the_machine_runs(|| {
        let mut local = local.borrow_mut();
        local.ask(&go(&scene, 0.1, 0.1)).expect("beside the core");
        std::thread::sleep(Duration::from_millis(500));
        until(Duration::from_secs(5), || still_moving_m(&mut local) < 1e-5);
        let end = Instant::now() + Duration::from_millis(2300);
        let (here, there) = std::thread::scope(|scope| {
            let here = scope.spawn(|| shown(&near.0, end));
            let there = scope.spawn(|| shown(&far.0, end));
            // By then every position was in two messages.
            std::thread::sleep(Duration::from_millis(800));
            local.ask(&go(&scene, 0.0, 0.2)).expect("beside the core");
            (here.join().expect("ran"), there.join().expect("ran"))
        });
        let resting = &here.values().next_back().expect("snapshots").2;
        let errors = |of: &[Vertex], truth: &[Vertex]| -> Vec<f64> {
            let moves = |i: &usize| apart_mm(&truth[*i], &resting[*i]) > 0.1;
            let moving = (0..truth.len()).filter(moves);
            moving.map(|i| apart_mm(&of[i], &truth[i])).collect()
        };
        // The same snapshots, each in one message of the largest size, decoded in both ways.
        let (mut known, mut standing) = (Displacements::default(), Standing::new(resting));
        let (mut drawn_mm, mut standing_mm) = (Errors::default(), Errors::default());
        for (number, (_, header, truth)) in here.values().enumerate() {
            let body = Thin::of(&rest, header, truth)
                .expect("of this scene")
                .with_places(number as u64, MAX_THIN_BYTES);
            let decoded = decode_snapshot(&rest, &mut known, &body).expect("valid");
            let (_, drawn) = decoded.expect("of this scene");
            standing.take(truth);
            // Until each position was in two messages.
            if number >= 2 * standing.stride {
                drawn_mm.add(&errors(&drawn, truth));
                standing_mm.add(&errors(&standing.places, truth));
            }
        }
        let (mut far_mm, mut ages_ms) = (Errors::default(), Vec::new());
        for (tick, (age_ms, _, drawn)) in &there {
            if let Some((_, _, truth)) = here.get(tick) {
                far_mm.add(&errors(drawn, truth));
                ages_ms.push(*age_ms);
            }
        }
        println!(
            "{} places in {} messages, {} snapshots beside the core; {} on the far side, p50 {:.0}, at most {:.0} ms old",
            resting.len(),
            standing.stride,
            here.len(),
            ages_ms.len(),
            quantile(&mut ages_ms.clone(), 0.5),
            quantile(&mut ages_ms, 1.0)
        );
        for (name, errors) in [
            ("moved with those around them", &drawn_mm),
            ("standing between", &standing_mm),
            ("on the far side", &far_mm),
        ] {
            println!(
                "{name}: RMS at most {:.3} mm, a place at most {:.3} mm",
                errors.rms_mm, errors.most_mm
            );
        }
        assert!(
            standing.stride > 1 && standing_mm.most_mm > 0.5,
            "too slow to show anything"
        );
        assert!(drawn_mm.rms_mm < standing_mm.rms_mm, "{} mm", drawn_mm.rms_mm);
    });
}
