//! MetaImage; a detached header finds the file itself as its data.

#![no_main]

use stylet_files as files;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _answer = files::metaimage::read(data, &|_| Ok(data.to_vec()), files::Sink::labels(&files::Progress::default()));
});
