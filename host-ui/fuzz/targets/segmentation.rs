//! DICOM Segmentation, also packed by RLE.

#![no_main]

use stylet_files as files;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _answer = files::dicom::segmentation::read(data);
});
