//! A class with the longest names and texts: connected hosts, injected faults, and the list of
//! trainees.

use crate::app::App;
use bytemuck::Zeroable;
use std::time::Instant;
use stylet_host::roster::{Glance, Trainee};
use stylet_shm_schema::Instance;
use stylet_shm_schema::{Exercise, Relayed, Session, Text};

/// Shows every exercise at once, with the longest texts.
pub fn inject_exercises(app: &mut App) {
    let mut session = app.shown.session.unwrap_or_else(Session::zeroed);
    let by_m = [-0.0057, -0.0057, -0.0057];
    for exercise in [
        Exercise::DeviceLost,
        Exercise::StiffTissue { factor: 4.9 },
        Exercise::BodyMoved { by_m },
    ] {
        session.exercises.put(exercise);
    }
    app.shown.session = Some(session);
    app.shown.body_moved_m = by_m;
}

/// Shows eight trainees, at least one for each kind of line.
pub fn trainees(app: &mut App) {
    let name = |n: usize| format!("{n}. Maximiliane Wolfeschlegelsteinhausenbergerdorff of group 2")[..60].to_owned();
    let glance = |n: usize| Glance {
        trainee: Trainee {
            name: if n == 0 { name(n) } else { format!("Trainee {n}") },
            instance: Instance::default(),
        },
        heard: (n > 0).then(Instant::now),
        state: app.shown.state.filter(|_| n > 1),
        session: app.shown.session,
        plan: app.shown.plan,
        relayed: None,
    };
    app.trainees.glances = (0..8).map(glance).collect();
    app.trainees.followed = Some(3);
}

/// Returns a line to another machine, with the longest possible names.
pub fn line_to_a_core(is_heard: bool) -> Relayed {
    Relayed {
        is_heard: u32::from(is_heard),
        snapshot_age_ns: 12_345_000_000,
        round_trip_ns: 1_234_000_000,
        records_lost: 123_456,
        snapshots_lost: 12_345,
        server: Text::new("simulator-of-the-department-of-radiation-oncology.example:65535"),
        name: Text::new("Prof. Dr. Maximiliane Wolfeschlegelsteinhausenbergerdorff"),
        operator: Text::new("Dr. Bartholomew Featherstonehaugh-Cholmondeley, visiting"),
        role: Text::new("instructor"),
        ..Relayed::zeroed()
    }
}

/// Returns a full class, with the longest names.
pub fn whole_class() -> stylet_shm_schema::Class {
    let line = line_to_a_core(true);
    let mut class = stylet_shm_schema::Class {
        count: stylet_shm_schema::MAX_CLASS as u32,
        unlisted: 12_345,
        operator: line.operator,
        asked: line.name,
        ..Zeroable::zeroed()
    };
    for (i, member) in class.members.iter_mut().enumerate() {
        // The names differ, so that rows that scroll cannot be confused.
        let name = format!("{}. {}", i + 1, line.name.read());
        (member.name, member.role) = (Text::new(&name), Text::new("operator"));
        (member.round_trip_ns, member.silent_ns) = (1_234_000_000, 1_999_000_000);
        member.records_lost = 123_456 + i as u64;
    }
    class
}
