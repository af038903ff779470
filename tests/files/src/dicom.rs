//! DICOM files of another program (pydicom) are read correctly, and that program reads ours the same.

use std::path::{Path, PathBuf};
use std::process::Command;
use stylet_files::dicom::{self, plan};
use stylet_files::{self as files, Voxels};
use stylet_test_kit::{program, scratch};

fn folder() -> PathBuf {
    stylet_test_kit::repository("tests/files/data/dicom")
}

fn python(script: &str, arguments: &[&Path]) -> serde_json::Value {
    let out = Command::new("/usr/bin/python3")
        .args(["-c", script])
        .args(arguments)
        .output()
        .expect("python3 runs");
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "pydicom: {said}");
    serde_json::from_slice(&out.stdout).expect("JSON")
}

fn host_ui(arguments: &[&str], paths: &[&Path]) -> (bool, String) {
    let out = Command::new(program("host-ui"))
        .args(arguments)
        .args(paths)
        .output()
        .expect("host-ui runs");
    let said = format!(
        "{}{}",
        String::from_utf8_lossy(&out.stdout),
        String::from_utf8_lossy(&out.stderr)
    );
    (out.status.success(), said)
}

fn volume_mm3(v: &Voxels, name: &str) -> f64 {
    let label = v.names.iter().find(|(_, n)| *n == name).map(|(l, _)| *l).expect(name);
    let count = v.labels.iter().filter(|&&l| l == label).count();
    count as f64 * v.frame.spacing_m.iter().product::<f64>() * 1e9
}

/// Compares every voxel with 24 x 24 points in it, by the radii with which the phantom was drawn. Voxels about half
/// covered may go either way, and are counted.
fn compare_with_what_was_drawn(v: &Voxels) -> usize {
    type Inside = fn(f64, f64) -> bool;
    // Smaller ones first, with their slices.
    let drawn: [(&str, std::ops::Range<usize>, Inside); 4] = [
        ("Urethra", 0..6, |x, y| (x - 6.0).hypot(y - 10.0) < 1.2),
        ("Rectum", 2..4, |x, y| (1.5..3.0).contains(&(x - 10.0).hypot(y - 10.0))),
        ("Bladder", 5..6, |x, y| (4.0..8.0).contains(&(x - 10.0).hypot(y - 10.0))),
        ("Prostate", 1..5, |x, y| (x - 10.0).hypot(y - 10.0) < 7.0),
    ];
    let mut near_half = 0;
    for (index, label) in v.labels.iter().enumerate() {
        let (i, j, k) = (
            index % v.dims[0],
            index / v.dims[0] % v.dims[1],
            index / v.dims[0] / v.dims[1],
        );
        let share = |inside: Inside| {
            let point = |n: usize| {
                let within = |m: usize| (m as f64 + 0.5) / 24.0 - 0.5;
                inside((i as f64 + within(n % 24)) * 0.5, (j as f64 + within(n / 24)) * 0.6)
            };
            (0..576).filter(|&n| point(n)).count() as f64 / 576.0
        };
        let shares: Vec<(&str, f64)> = drawn
            .iter()
            .filter(|d| d.1.contains(&k))
            .map(|d| (d.0, share(d.2)))
            .collect();
        if shares.iter().any(|(_, s)| (s - 0.5).abs() < 0.05) {
            near_half += 1;
            continue;
        }
        let expected = shares.iter().find(|(_, s)| *s > 0.5).map(|(name, _)| *name);
        assert_eq!(
            v.names.get(label).map(String::as_str),
            expected,
            "voxel {i}, {j}, {k}: {shares:?}"
        );
    }
    near_half
}

#[test]
fn a_structure_set_lies_on_the_grid_of_its_tilted_images() {
    for name in ["structures.dcm", "structures_implicit.dcm"] {
        let v = files::read_voxels(&folder().join(name), &files::Progress::default()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(v.dims, [40, 36, 6]);
        let side = v.frame.spacing_m.map(|s| (s * 1e9).round() / 1e6);
        assert_eq!(side, [0.5, 0.6, 2.0]);
        // The first pixel of the lowest image, LPS to RAS.
        let off = v.frame.origin_m * 1e3 - nalgebra::Vector3::new(9.0, 14.0, 33.0);
        assert!(off.norm() < 1e-6, "{off:?}");
        // The third axis points to the head and forwards: (0, -sin, cos) in LPS.
        let normal = v.frame.directions.column(2).into_owned();
        let tilt = 0.35_f64;
        assert!((normal - nalgebra::Vector3::new(0.0, tilt.sin(), tilt.cos())).norm() < 1e-6);
        let near_half = compare_with_what_was_drawn(&v);
        println!("{name}: {near_half} voxels are covered by half");
        // All others are compared.
        assert!(near_half * 50 < v.labels.len());
        let notes = v.frame.warning.expect("notes");
        assert!(
            notes.contains("Isocentre is left out: ContourGeometricType (3006,0042) is POINT"),
            "{notes}"
        );
        assert!(notes.contains("Prostate ("), "{notes}");
    }
}

#[test]
fn a_structure_set_that_we_write_has_its_volumes_in_pydicom() {
    let out = scratch("dicom-structures");
    let (from, to) = (out.join("a.nrrd"), out.join("set.dcm"));
    let v = files::read_voxels(&folder().join("structures.dcm"), &files::Progress::default()).expect("read");
    files::convert::write_labels(&v, &from, None).expect("written");
    let (done, said) = host_ui(&["convert"], &[&from, &to]);
    assert!(done, "{said}");
    let script = r#"
import json, sys, numpy as np, pydicom
ds = pydicom.dcmread(sys.argv[1])
names = {int(r.ROINumber): str(r.ROIName) for r in ds.StructureSetROISequence}
areas = {}
for drawn in ds.ROIContourSequence:
    total, planes = 0.0, {}
    for c in drawn.ContourSequence:
        p = np.array(c.ContourData, float).reshape(-1, 3); assert len(p) == c.NumberOfContourPoints
        # Holes run the other way round, so that signed areas add up.
        n = sum(np.cross(a - p[0], b - p[0]) for a, b in zip(p, np.roll(p, -1, 0))) / 2
        total = total + n
    areas[names[int(drawn.ReferencedROINumber)]] = float(np.linalg.norm(total))
print(json.dumps({"areas": areas, "class": ds.SOPClassUID.name, "meta": ds.file_meta.TransferSyntaxUID.name}))
"#;
    let found = python(script, &[&to]);
    assert_eq!(found["class"], "RT Structure Set Storage");
    for name in v.names.values().filter(|n| *n != "Isocentre") {
        let drawn = found["areas"][name].as_f64().expect(name) * 2.0;
        let voxels = volume_mm3(&v, name);
        assert!((drawn / voxels - 1.0).abs() < 1e-6, "{name}: {drawn} and {voxels} mm3");
    }
}

#[test]
fn plans_of_pydicom_are_read_with_place_direction_and_strength() {
    for name in ["plan_pairs.dcm", "plan_single.dcm"] {
        let bytes = std::fs::read(folder().join(name)).expect("a file");
        let plan = dicom::read(&bytes)
            .and_then(|o| plan::of(&o))
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(plan.prescription_gy, Some(145.0));
        assert_eq!(
            (plan.source.isotope.as_str(), plan.source.half_life_days),
            ("I-125", 59.4)
        );
        let found: Vec<_> = plan
            .seeds
            .iter()
            .map(|s| {
                (
                    s.hole.as_str(),
                    s.position_m.map(|v| (v * 1e6).round() / 1e3),
                    s.strength_u,
                )
            })
            .collect();
        assert_eq!(
            found,
            [
                ("D4", [-1.0, -2.0, 3.0], 0.5),
                ("D4", [-1.0, -2.0, 13.0], 0.5),
                ("E5", [4.25, -5.0, 6.0], 0.62)
            ],
            "{name}"
        );
        let axis = plan.seeds[0].axis.expect("an axis");
        assert!((axis[1] + 0.6).abs() < 1e-6 && (axis[2] - 0.8).abs() < 1e-6, "{axis:?}");
    }
    let bytes = std::fs::read(folder().join("plan_hdr.dcm")).expect("a file");
    let why = dicom::read(&bytes)
        .and_then(|o| plan::of(&o))
        .map(|p| p.label)
        .expect_err("refused")
        .to_string();
    assert!(why.contains("only permanent implants are read"), "{why}");
}

#[test]
fn a_csv_plan_is_the_same_in_pydicom_and_after_reimport() {
    let out = scratch("dicom-plan");
    let (csv, dcm, back) = (out.join("seeds.csv"), out.join("plan.dcm"), out.join("back.csv"));
    let mut text = String::from("x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u\n");
    for i in 0..100 {
        let t = f64::from(i);
        let (x, y, z) = (t * 0.37 - 20.0, (t * 0.7).sin() * 18.123456, 5.0 + t * 0.31);
        text += &format!(
            "{x},{y},{z},{},{},{},{}\n",
            t.sin() * 0.6,
            t.cos() * 0.6,
            0.8,
            [0.5, 0.432][i as usize % 2]
        );
    }
    std::fs::write(&csv, &text).expect("written");
    let source = stylet_test_kit::repository("sources/i125_6711.toml");
    let (done, said) = host_ui(&["convert", "--source", &source.to_string_lossy()], &[&csv, &dcm]);
    assert!(done, "{said}");
    let (done, said) = host_ui(&["convert"], &[&dcm, &back]);
    assert!(done, "{said}");
    let script = r#"
import json, sys, pydicom
ds = pydicom.dcmread(sys.argv[1])
assert ds.SOPClassUID.name == "RT Plan Storage" and ds.BrachyTreatmentTechnique == "PERMANENT"
sources = {int(s.SourceNumber): s for s in ds.SourceSequence}
seeds = []
for c in ds.ApplicationSetupSequence[0].ChannelSequence:
    a, b = c.BrachyControlPointSequence
    assert list(a.ControlPoint3DPosition) == list(b.ControlPoint3DPosition) and c.NumberOfControlPoints == 2
    s = sources[int(c.ReferencedSourceNumber)]
    assert s.SourceIsotopeName == "I-125" and abs(float(s.SourceIsotopeHalfLife) - 59.4) < 1e-9
    assert s.SourceStrengthUnits == "AIR_KERMA_RATE"
    p, d = [float(v) for v in a.ControlPoint3DPosition], [float(v) for v in a.ControlPointOrientation]
    # To RAS, as the table has it.
    seeds.append([-p[0], -p[1], p[2], -d[0], -d[1], d[2], float(s.ReferenceAirKermaRate)])
print(json.dumps(seeds))
"#;
    let in_pydicom = python(script, &[&dcm]);
    let rows = |text: &str| -> Vec<Vec<f64>> {
        // Needle and hole follow, here empty.
        let numbers = |l: &str| l.split(',').take(7).map(|n| n.parse().expect("a number")).collect();
        let lines = text.lines().filter(|l| !l.starts_with('#'));
        lines.skip(1).map(numbers).collect()
    };
    let (written, imported) = (rows(&text), rows(&std::fs::read_to_string(&back).expect("back.csv")));
    assert_eq!((written.len(), imported.len()), (100, 100));
    for (i, was) in written.iter().enumerate() {
        for column in 0..7 {
            let tolerance = if (3..6).contains(&column) { 2e-7 } else { 1e-9 };
            let other = in_pydicom[i][column].as_f64().expect("a number");
            assert!(
                (imported[i][column] - was[column]).abs() < tolerance,
                "seed {i}, column {column}"
            );
            assert!(
                (other - was[column]).abs() < tolerance,
                "pydicom: seed {i}, column {column}: {other}"
            );
        }
    }
}

#[test]
fn a_dose_written_is_the_same_dose_in_pydicom() {
    let out = scratch("dicom-dose");
    let (csv, dcm) = (out.join("dose_grid.csv"), out.join("dose.dcm"));
    let mut text = String::from("x_mm,y_mm,z_mm,dose_gy\n");
    for index in 0..5 * 4 * 3 {
        let (i, j, k) = (index % 5, index / 5 % 4, index / 20);
        let (x, y, z) = (
            f64::from(i) * 2.0 - 3.0,
            f64::from(j) * 1.5 + 10.0,
            f64::from(k) * 4.0 - 7.0,
        );
        text += &format!("{x:.4},{y:.4},{z:.4},{:.6}\n", 10.0 + x + 0.1 * y * y - 0.3 * z);
    }
    std::fs::write(&csv, &text).expect("written");
    let (done, said) = host_ui(&["convert"], &[&csv, &dcm]);
    assert!(!done && said.contains("needs --plan"), "{said}");
    let plan = folder().join("plan_pairs.dcm");
    let (done, said) = host_ui(&["convert", "--plan", &plan.to_string_lossy()], &[&csv, &dcm]);
    assert!(done, "{said}");
    let script = r#"
import json, sys, numpy as np, pydicom
ds, plan = pydicom.dcmread(sys.argv[1]), pydicom.dcmread(sys.argv[2])
assert ds.SOPClassUID.name == "RT Dose Storage" and ds.DoseUnits == "GY"
assert ds.FrameOfReferenceUID == plan.FrameOfReferenceUID and ds.PatientID == plan.PatientID
assert ds.ReferencedRTPlanSequence[0].ReferencedSOPInstanceUID == plan.SOPInstanceUID
dose = np.frombuffer(ds.PixelData, "<u4").reshape(int(ds.NumberOfFrames), ds.Rows, ds.Columns) * float(ds.DoseGridScaling)
corner, (dy, dx) = np.array(ds.ImagePositionPatient, float), [float(v) for v in ds.PixelSpacing]
assert [float(v) for v in ds.ImageOrientationPatient] == [1, 0, 0, 0, 1, 0]
rows = []
for k, offset in enumerate(ds.GridFrameOffsetVector):
    for j in range(ds.Rows):
        for i in range(ds.Columns):
            p = corner + [i * dx, j * dy, float(offset)]
            rows.append([-p[0], -p[1], p[2], dose[k, j, i]])
print(json.dumps(rows))
"#;
    let found = python(script, &[&dcm, &plan]);
    let found = found.as_array().expect("rows");
    assert_eq!(found.len(), 60);
    for row in found {
        let [x, y, z, gy] = [0, 1, 2, 3].map(|i| row[i].as_f64().expect("a number"));
        let expected = 10.0 + x + 0.1 * y * y - 0.3 * z;
        assert!((gy - expected).abs() < 1e-6, "{row}: {expected}");
    }
}

/// Files that other programs read otherwise than Stylet did, without a word: 88,919 Gy in place of 80 Gy, and frames
/// 6 mm away. The same dose in little endian is read.
#[test]
fn doses_that_programs_read_differently_are_refused() {
    let read = |name: &str| {
        let path = stylet_test_kit::repository("tests/oracles/clinic/disagreements").join(name);
        dicom::dose::of_file(&path)
            .map(|dose| dose.dose_gy.iter().copied().fold(0.0, f64::max))
            .map_err(|why| why.to_string())
    };
    let largest_gy = read("dose_little_endian_32.dcm").expect("readable");
    assert!((largest_gy - 160.0).abs() < 1e-3, "{largest_gy}");
    for (name, reason) in [
        ("dose_big_endian_32_words.dcm", "32 bits in big endian"),
        ("dose_big_endian_32_numpy.dcm", "32 bits in big endian"),
        (
            "dose_absolute_coronal.dcm",
            "no meaning in this ImageOrientationPatient",
        ),
        (
            "dose_absolute_feet_first.dcm",
            "no meaning in this ImageOrientationPatient",
        ),
    ] {
        let why = read(name).expect_err(name);
        assert!(why.contains(reason), "{name}: {why}");
    }
}
