// Every decoder of network data, as the two sides call them; for the fuzzer, which includes this file, and for the
// tests of its corpus.

use bytemuck::Zeroable;
use stylet_relay::control::Order;
use stylet_relay::wire::{self, Displacements, Hello, Kind, Rest, Ticks};
use stylet_shm_schema::{
    Command, Event, HapticState, ParametersInForce, PlanInForce, Rehearsal, Reply, Request, SceneHeader, Session,
    SnapshotHeader, check,
};

/// Decodes the bytes as one message, at the server's end and at a member's. Accepted values are valid by the checks of
/// shared memory. True if the message was accepted.
pub fn take(bytes: &[u8]) -> bool {
    let Ok(message) = wire::decode(bytes) else {
        return false;
    };
    let body = message.body;
    match message.kind {
        Kind::Session => wire::one::<Session>(body).is_ok(),
        Kind::State => wire::one::<HapticState>(body).is_ok_and(|state| check::state(&state).is_ok()),
        Kind::Records => records(body),
        Kind::Newest => wire::state_and_records(body).is_ok_and(|(state, batch)| {
            wire::one::<HapticState>(state).is_ok_and(|state| check::state(&state).is_ok()) && records(batch)
        }),
        Kind::Snapshot => snapshot(body),
        Kind::Scene => scene(body),
        Kind::Event => wire::one::<Event>(body).is_ok(),
        Kind::Parameters => wire::one::<ParametersInForce>(body).is_ok_and(|p| check::parameters(&p).is_ok()),
        Kind::Plan => wire::one::<PlanInForce>(body).is_ok_and(|plan| check::plan(&plan).is_ok()),
        Kind::Reply => wire::one::<Reply>(body).is_ok_and(|reply| !reply.text.read().contains('\0')),
        Kind::Rehearsal => wire::one::<Rehearsal>(body).is_ok_and(|r| check::rehearsal(&r).is_ok()),
        Kind::Class => wire::class_of(body).is_ok_and(|class| !wire::class_words(&class).is_empty()),
        Kind::Echo => wire::one::<u64>(body).is_ok(),
        Kind::Missing | Kind::Again => wire::one::<Ticks>(body).is_ok(),
        Kind::Hello => wire::one::<Hello>(body).is_ok(),
        Kind::Command => wire::one::<Command>(body).is_ok_and(|command| Request::decode(&command).is_ok()),
        Kind::Upload => wire::part(body).is_ok(),
        Kind::Lease => std::str::from_utf8(body).ok().and_then(Order::of_line).is_some(),
        Kind::Refused => wire::words(body).is_ok(),
        Kind::Seen => true,
    }
}

fn records(body: &[u8]) -> bool {
    let records = wire::unpack(body);
    records.is_ok_and(|batch| batch.iter().all(|record| check::record(record).is_ok()))
}

fn scene(body: &[u8]) -> bool {
    let Ok((header, words)) = wire::scene(body) else {
        return false;
    };
    // A snapshot of the scene, as far as possible.
    let _ = Rest::of_scene(&header, &words);
    true
}

/// Decodes against a scene with the counts of the snapshot, if it is small, and against none.
fn snapshot(body: &[u8]) -> bool {
    let mut known = Displacements::default();
    let of_none = wire::decode_snapshot(&Rest::default(), &mut known, body);
    match wire::decode_snapshot(&rest_of(body), &mut known, body) {
        Ok(Some((header, vertices))) => {
            assert!(check::snapshot(&header, &vertices).is_ok());
            true
        }
        _ => of_none.is_ok(),
    }
}

const SMALL: u32 = 4096;

fn rest_of(body: &[u8]) -> Rest {
    let mut stated = SnapshotHeader::zeroed();
    let length = body.len().min(size_of::<SnapshotHeader>());
    bytemuck::bytes_of_mut(&mut stated)[..length].copy_from_slice(&body[..length]);
    let mut scene = SceneHeader::zeroed();
    (scene.session_id, scene.generation) = (stated.session_id, stated.scene_generation);
    scene.vertex_count = stated.vertex_count.min(SMALL);
    scene.nodes.dims = [stated.node_count.min(SMALL), 1, 1];
    Rest::of_scene(&scene, &vec![0; 3 * scene.vertex_count as usize])
}
