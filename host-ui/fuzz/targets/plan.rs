//! RT Plan; a plan that was read can be written and reads back equal.

#![no_main]

use stylet_files as files;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(plan) = files::dicom::read(data).and_then(|o| files::dicom::plan::of(&o)) else {
        return;
    };
    let written = files::dicom::plan::bytes(&plan).expect("a plan that was read can be written");
    let again = files::dicom::read(&written).and_then(|o| files::dicom::plan::of(&o));
    assert_eq!(again.map(|p| p.seeds.len()), Ok(plan.seeds.len()));
});
