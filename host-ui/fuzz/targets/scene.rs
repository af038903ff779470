//! Scene files.

#![no_main]

use stylet_files as files;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    if let Ok(text) = std::str::from_utf8(data) {
        let _answer = files::scene::parse(text);
    }
});
