//! RT Structure Set without its images.

#![no_main]

use std::path::Path;
use stylet_files as files;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _answer = files::dicom::read(data).and_then(|o| files::dicom::structures::read(&o, Path::new("")));
});
