//! Messages from the network, at the server's end and at a member's.

#![no_main]

mod decoders {
    include!("../../tests/decoders/mod.rs");
}

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    decoders::take(data);
});
