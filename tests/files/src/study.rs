//! Files of one study that reference each other, checked by another program (pydicom) against a table from the
//! standard.

use std::path::{Path, PathBuf};
use std::process::Command;
use stylet_test_kit::{program, repository, scratch};

fn data(name: &str) -> PathBuf {
    repository("tests/files/data").join(name)
}

fn host_ui(arguments: &[&Path]) -> (bool, String) {
    let out = Command::new(program("host-ui"))
        .args(arguments)
        .output()
        .expect("host-ui runs");
    let said = [out.stdout, out.stderr].concat();
    (out.status.success(), String::from_utf8_lossy(&said).into_owned())
}

fn python(arguments: &[&Path]) -> (bool, serde_json::Value) {
    let out = Command::new("/usr/bin/python3")
        .args(arguments)
        .output()
        .expect("python3 runs");
    let said = String::from_utf8_lossy(&out.stderr);
    let found = serde_json::from_slice(&out.stdout).unwrap_or_else(|_| panic!("pydicom: {said}"));
    (out.status.success(), found)
}

fn script(text: &str, arguments: &[&Path]) -> serde_json::Value {
    let (done, found) = python(&[&[Path::new("-c"), Path::new(text)], arguments].concat());
    assert!(done, "{found:#}");
    found
}

const SEEDS: &str = "\
x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u,strength_date,needle,hole
-1,4,36,0,0,1,0.5,2026-10-01,3,D4
-1,4,41,0,0,1,0.5,2026-10-01,3,D4
2,5,38,0,0,1,0.45,2026-10-15,7,E5
4,5,39,,,,0.45,,,
";

/// The seeds of [`SEEDS`] with a source that knows all axes.
fn seeds(folder: &Path) -> PathBuf {
    let path = folder.join("seeds.csv");
    std::fs::write(&path, SEEDS).expect("written");
    path
}

/// Writes a study into a folder of the test; returns structure set, plan and dose.
fn study(name: &str, seeds: &Path, structures: &Path, more: &[&Path]) -> [PathBuf; 3] {
    let out = scratch(name).join("study");
    let source = repository("sources/i125_6711.toml");
    let arguments = [
        Path::new("dicom"),
        Path::new("--source"),
        &source,
        Path::new("--seeds"),
        seeds,
        Path::new("--structures"),
        structures,
        Path::new("--out"),
        &out,
    ];
    let (done, said) = host_ui(&[&arguments, more].concat());
    assert!(done, "{said}");
    ["structure_set.dcm", "plan.dcm", "dose.dcm"].map(|file| out.join(file))
}

fn images() -> Vec<PathBuf> {
    (0..6).map(|n| data(&format!("dicom/image{n}.dcm"))).collect()
}

fn check(files: &[PathBuf], images: &[PathBuf]) -> (bool, serde_json::Value) {
    let checker = data("check_study.py");
    let paths: Vec<&Path> = std::iter::once(&checker)
        .chain(files)
        .chain(images)
        .map(PathBuf::as_path)
        .collect();
    python(&paths)
}

/// Exported files used to reference only the plan, each with its own patient, study and frame.
#[test]
fn the_files_of_a_study_are_complete_and_reference_each_other() {
    let folder = scratch("study-seeds");
    let files = study("study-linked", &seeds(&folder), &data("dicom/structures.dcm"), &[]);
    let (done, found) = check(&files, &images());
    assert!(done, "{found:#}");
    assert!(found["looked_at"].as_u64().is_some_and(|n| n > 400), "{found:#}");
    // Patient, study and frame are those of the given structure set; needles, holes and dates those of the seeds.
    let text = r#"
import json, sys, pydicom
given, plan = pydicom.dcmread(sys.argv[1]), pydicom.dcmread(sys.argv[2])
keys = ["PatientID", "PatientName", "StudyInstanceUID", "FrameOfReferenceUID"]
channels = plan.ApplicationSetupSequence[0].ChannelSequence
sources = {int(s.SourceNumber): s for s in plan.SourceSequence}
print(json.dumps({"same": [str(given[k].value) == str(plan[k].value) for k in keys], "seeds": [
    [c.get("SourceApplicatorNumber"), c.get("SourceApplicatorID"), str(sources[int(c.ReferencedSourceNumber)].SourceStrengthReferenceDate),
     float(sources[int(c.ReferencedSourceNumber)].ReferenceAirKermaRate)] for c in channels]}))
"#;
    let found = script(text, &[&data("dicom/structures.dcm"), &files[1]]);
    assert_eq!(found["same"], serde_json::json!([true, true, true, true]));
    let today = found["seeds"][3][2].clone();
    assert_eq!(
        found["seeds"],
        serde_json::json!([
            [3, "D4", "20261001", 0.5],
            [3, "D4", "20261001", 0.5],
            [7, "E5", "20261015", 0.45],
            [null, null, today, 0.45]
        ])
    );
    // Reads the output again: plan and dose, the dose as computed.
    let again = scratch("study-again").join("dose.json");
    let (done, said) = host_ui(&[Path::new("compare"), &files[2], &files[2], Path::new("--json"), &again]);
    assert!(done && said.contains("0.000000 Gy"), "{said}");
}

/// Checks the checker, which must find errors.
#[test]
fn a_study_that_lacks_any_one_attribute_is_found_out() {
    let folder = scratch("study-seeds-red");
    let files = study("study-red", &seeds(&folder), &data("dicom/structures.dcm"), &[]);
    let text = r#"
import json, sys
sys.path.insert(0, sys.argv[1]); import check_study as check, pydicom
tables = [check.STRUCTURE_SET, check.RT_PLAN, check.RT_DOSE]
def places(item, table):
    for key, kind, *rest in table:
        condition = next((r for r in rest if callable(r)), None)
        if kind[0] in "12" and key in item and (condition is None or condition(item, item) or kind == "1C"):
            yield item, key, kind
        inner = next((r for r in rest if isinstance(r, list)), None)
        if inner and key in item:
            yield from places(item[key].value[0], inner)
tried, unseen = 0, []
for path, table in zip(sys.argv[2:], tables):
    file = pydicom.dcmread(path)
    for item, key, kind in list(places(file, table)):
        # Conditions of others hang on these: without them nothing else is needed.
        kept = item[key]; del item[key]; missing = []
        check.attributes(file, table, file, "", missing)
        item[key] = kept; tried += 1
        if not missing: unseen.append(key)
print(json.dumps({"tried": tried, "unseen": unseen}))
"#;
    let folder = data("");
    let found = script(text, &[&folder, &files[0], &files[1], &files[2]]);
    assert!(found["tried"].as_u64().is_some_and(|n| n > 120), "{found}");
    // Required only for characters beyond ASCII, or for beta sources; each may be present otherwise.
    let optional = ["SpecificCharacterSet", "SourceStrengthUnits"];
    let unseen: Vec<_> = found["unseen"].as_array().expect("a list").iter().collect();
    assert!(unseen.iter().all(|key| optional.iter().any(|o| key == o)), "{unseen:?}");
    // A reference that leads nowhere.
    let broken = scratch("study-broken").join("dose.dcm");
    let text = r#"
import json, sys, pydicom
ds = pydicom.dcmread(sys.argv[1]); ds.ReferencedRTPlanSequence[0].ReferencedSOPInstanceUID = "1.2.3"; ds.save_as(sys.argv[2]); print("{}")
"#;
    script(text, &[&files[2], &broken]);
    let (done, found) = check(&[files[0].clone(), files[1].clone(), broken], &[]);
    assert!(
        !done && found["wrong"].as_array().is_some_and(|w| w.len() == 1),
        "{found:#}"
    );
}

/// `convert` used to make a new patient, study and frame for every file.
#[test]
fn files_without_dicom_among_them_get_one_patient_study_and_frame() {
    let folder = scratch("study-plain");
    let labels = folder.join("labels.seg.nrrd");
    let (done, said) = host_ui(&[Path::new("convert"), &data("dicom/structures.dcm"), &labels]);
    assert!(done, "{said}");
    let seeds = seeds(&folder);
    let (done, found) = check(&study("study-made", &seeds, &labels, &[]), &[]);
    assert!(done, "{found:#}");
    // With the images of the patient, whose identity is then used.
    let series = folder.join("series");
    std::fs::create_dir_all(&series).expect("a folder");
    for image in images() {
        std::fs::copy(&image, series.join(image.file_name().expect("a name"))).expect("copied");
    }
    let files = study("study-on-images", &seeds, &labels, &[Path::new("--images"), &series]);
    let (done, found) = check(&files, &images());
    assert!(done, "{found:#}");
    // One of another patient is refused.
    let other = folder.join("other.dcm");
    let text = r#"
import sys, pydicom
ds = pydicom.dcmread(sys.argv[1]); ds.PatientID = "P7"; ds.save_as(sys.argv[2]); print("{}")
"#;
    script(text, &[&data("dicom/plan_pairs.dcm"), &other]);
    let source = repository("sources/i125_6711.toml");
    let out = folder.join("refused");
    let (done, said) = host_ui(&[
        Path::new("dicom"),
        Path::new("--source"),
        &source,
        Path::new("--seeds"),
        &other,
        Path::new("--structures"),
        &data("dicom/structures.dcm"),
        Path::new("--out"),
        &out,
    ]);
    assert!(
        !done && said.contains("it is of patient \"P7\" and not of \"P6\""),
        "{said}"
    );
    assert!(!out.exists(), "nothing is written");
}

/// Every `convert` used to make up patient, study and frame; needles, holes and dates were lost in a table.
#[test]
fn conversions_keep_patient_study_and_frame_names_needles_and_dates() {
    let out = scratch("study-kept");
    let convert = |from: &Path, to: &Path, more: &[&Path]| {
        let (done, said) = host_ui(&[&[Path::new("convert"), from, to], more].concat());
        assert!(done, "{said}");
    };
    let source = repository("sources/i125_6711.toml");
    let given = out.join("given.dcm");
    let text = r#"
import sys, pydicom
ds = pydicom.dcmread(sys.argv[1])
for n, s in enumerate(ds.SourceSequence): s.SourceStrengthReferenceDate, s.SourceStrengthReferenceTime = f"2026090{n + 1}", "000000"
for c in ds.ApplicationSetupSequence[0].ChannelSequence: c.SourceApplicatorNumber = {"D4": 11, "E5": 4}[c.SourceApplicatorID]
ds.PatientBirthDate, ds.PatientSex, ds.StudyDate, ds.StudyID = "19500102", "M", "20260830", "S7"
ds.save_as(sys.argv[2]); print("{}")
"#;
    script(text, &[&data("dicom/plan_pairs.dcm"), &given]);
    let (csv, plan, copy) = (out.join("seeds.csv"), out.join("plan.dcm"), out.join("copy.dcm"));
    convert(&given, &csv, &[]);
    convert(&csv, &plan, &[Path::new("--source"), &source]);
    convert(&given, &copy, &[]);
    let (set, labels, back) = (out.join("set.dcm"), out.join("set.nrrd"), out.join("back.dcm"));
    convert(&data("dicom/structures.dcm"), &set, &[]);
    convert(&data("dicom/structures.dcm"), &labels, &[]);
    convert(&labels, &back, &[Path::new("--like"), &set]);
    let text = r#"
import json, sys, pydicom
files = [pydicom.dcmread(p) for p in sys.argv[1:]]
keys = ["PatientID", "PatientName", "StudyInstanceUID", "FrameOfReferenceUID"]
more = keys + ["PatientBirthDate", "PatientSex", "StudyDate", "StudyID"]
same = [all(str(f.get(k)) == str(files[0].get(k)) for k in (more if n < 3 else keys)) for n, f in enumerate(files)]
def seeds(f):
    sources = {int(s.SourceNumber): s for s in f.SourceSequence}
    # Two control points at one place are one seed.
    return [[c.get("SourceApplicatorNumber"), c.get("SourceApplicatorID"), [float(v) for v in p], float(s.ReferenceAirKermaRate), s.SourceStrengthReferenceDate]
            for c in f.ApplicationSetupSequence[0].ChannelSequence for s in [sources[int(c.ReferencedSourceNumber)]]
            for p in sorted({tuple(map(float, q.ControlPoint3DPosition)) for q in c.BrachyControlPointSequence})]
names = lambda f: [str(r.ROIName) for r in f.StructureSetROISequence if r.ROIName != "Isocentre"]
print(json.dumps({"same": same, "seeds": [seeds(f) for f in files[:3]], "names": [names(f) for f in files[3:]]}))
"#;
    let found = script(
        text,
        &[&given, &plan, &copy, &data("dicom/structures.dcm"), &set, &back],
    );
    assert_eq!(found["same"], serde_json::json!([true, true, true, true, true, true]));
    for copy in [1, 2] {
        assert_eq!(found["seeds"][copy], found["seeds"][0]);
    }
    for copy in [1, 2] {
        assert_eq!(found["names"][copy], found["names"][0]);
    }
}

/// RT Dose used to be unreadable.
#[test]
fn a_dose_of_pydicom_is_read_whichever_way_its_rows_and_frames_run() {
    let out = scratch("study-dose");
    let text = r#"
import json, sys, numpy as np, pydicom
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, generate_uid
def gy(p): return 20 + 0.4 * p[0] - 0.2 * p[1] + 0.1 * p[2]
for name, row, column, bits, absolute in (("a", [1, 0, 0], [0, 1, 0], 16, True), ("b", [0, 1, 0], [0, 0, -1], 32, False), ("c", [-1, 0, 0], [0, 1, 0], 32, False)):
    ds = Dataset(); ds.SOPClassUID, ds.SOPInstanceUID = "1.2.840.10008.5.1.4.1.1.481.2", generate_uid()
    ds.file_meta = FileMetaDataset(); ds.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    ds.file_meta.MediaStorageSOPClassUID, ds.file_meta.MediaStorageSOPInstanceUID = ds.SOPClassUID, ds.SOPInstanceUID
    ds.is_little_endian, ds.is_implicit_VR = True, False
    ds.PatientID, ds.StudyInstanceUID, ds.FrameOfReferenceUID = "P", generate_uid(), generate_uid()
    columns, rows, frames, first = 5, 4, 3, np.array([3.0, -2.0, 7.0])
    across = np.cross(row, column); offsets = np.arange(frames) * 2.5
    ds.Columns, ds.Rows, ds.NumberOfFrames = columns, rows, frames
    ds.ImagePositionPatient, ds.ImageOrientationPatient = list(first), [*row, *column]
    ds.PixelSpacing, ds.SliceThickness = [1.5, 1.25], 2.5
    ds.GridFrameOffsetVector = list(offsets + (first[2] if absolute else 0))
    ds.DoseUnits, ds.DoseType, ds.DoseSummationType, ds.DoseGridScaling = "GY", "PHYSICAL", "PLAN", 0.001 if bits == 16 else 1e-6
    ds.BitsAllocated = ds.BitsStored = bits; ds.HighBit, ds.PixelRepresentation = bits - 1, 0
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME2"
    place = lambda i, j, k: first + np.array(row) * i * 1.25 + np.array(column) * j * 1.5 + across * offsets[k]
    values = [gy(place(i, j, k)) / float(ds.DoseGridScaling) for k in range(frames) for j in range(rows) for i in range(columns)]
    ds.PixelData = np.rint(values).astype("<u2" if bits == 16 else "<u4").tobytes()
    ds.save_as(f"{sys.argv[1]}/{name}.dcm", write_like_original=False)
    plan = pydicom.dcmread(sys.argv[2])
    for key in ("PatientID", "StudyInstanceUID", "FrameOfReferenceUID"): setattr(plan, key, getattr(ds, key))
    plan.save_as(f"{sys.argv[1]}/{name}_plan.dcm")
print("{}")
"#;
    script(text, &[&out, &data("dicom/plan_pairs.dcm")]);
    for name in ["a", "b", "c"] {
        let (from, to) = (out.join(format!("{name}.dcm")), out.join(format!("{name}.csv")));
        let (done, said) = host_ui(&[Path::new("convert"), &from, &to]);
        assert!(done, "{said}");
        let table = std::fs::read_to_string(&to).expect("written");
        let rows: Vec<Vec<f64>> = table
            .lines()
            .filter(|l| !l.starts_with('#'))
            .skip(1)
            .map(|l| l.split(',').map(|n| n.parse().expect("a number")).collect())
            .collect();
        assert_eq!(rows.len(), 60, "{name}");
        for row in &rows {
            // To LPS, as in the phantom.
            let expected = 20.0 - 0.4 * row[0] + 0.2 * row[1] + 0.1 * row[2];
            assert!((row[3] - expected).abs() < 6e-4, "{name}: {row:?}, {expected}");
        }
        // It is the same dose after a table and DICOM again.
        let again = out.join(format!("{name}_again.dcm"));
        let plan = out.join(format!("{name}_plan.dcm"));
        let (done, said) = host_ui(&[Path::new("convert"), &to, &again, Path::new("--plan"), &plan]);
        assert!(done, "{said}");
        let (done, said) = host_ui(&[
            Path::new("compare"),
            &from,
            &again,
            Path::new("--threshold"),
            Path::new("0"),
        ]);
        assert!(done && said.contains("60 voxels compared, 0 outside"), "{said}");
        let largest = said.lines().find(|l| l.starts_with("largest")).expect("a line");
        let gy: f64 = largest
            .split_whitespace()
            .nth(1)
            .expect("a number")
            .parse()
            .expect("a number");
        assert!(gy.abs() < 1e-6, "{said}");
    }
}
