//! A slice of an image series.

#![no_main]

use host_ui_fuzz::files;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _answer = files::dicom::image_geometry(data);
});
