//! Packets that the force process receives from its bridge: any bytes may come.

#![no_main]

use libfuzzer_sys::fuzz_target;
use stylet_shm_schema::{Command, Request, UploadHeader};
use stylet_wall::packet::{Alive, Kind, parse};

fuzz_target!(|bytes: &[u8]| {
    let Some(packet) = parse(bytes, None) else { return };
    match packet.kind {
        Kind::Command => {
            if let Some(command) = packet.value::<Command>() {
                let _ = Request::decode(&command);
            }
        }
        Kind::Upload => drop(packet.value::<UploadHeader>()),
        Kind::Alive => drop(packet.value::<Alive>()),
        _ => {}
    }
});
