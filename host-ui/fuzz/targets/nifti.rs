//! NIfTI-1, packed or not.

#![no_main]

use stylet_files as files;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _answer = files::nifti::read(data, files::Sink::labels(&files::Progress::default()));
});
