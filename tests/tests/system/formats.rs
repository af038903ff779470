//! One gland with urethra and rectum, in every format, runs in a core as the same structures at the same place.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use stylet_shm_schema::role;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, program, scratch, until};

/// A gland, a urethra through it and a rectum next to it, 0.8 x 0.9 x 1.5 mm, oblique; prints centres in patient mm and
/// volumes.
const WRITE: &str = r#"
import json, sys, numpy as np, nibabel as nib
shape, zooms = (80, 75, 45), np.array([0.8, 0.9, 1.5])
def turn(axis, angle):
    c, s = np.cos(angle), np.sin(angle); r = np.eye(3); i, j = [k for k in range(3) if k != axis]
    r[i, i], r[i, j], r[j, i], r[j, j] = c, -s, s, c
    return r
affine = np.eye(4); affine[:3, :3] = turn(0, 0.2) @ turn(1, -0.1) @ turn(2, 0.25) @ np.diag(zooms); affine[:3, 3] = [-30, 12, -40]
i, j, k = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
x, y, z = ((g - c) * s for g, c, s in zip((i, j, k), (40, 42, 22), zooms))
labels = np.zeros(shape, np.uint8)
labels[(x / 19) ** 2 + (y / 15) ** 2 + (z / 20) ** 2 < 1] = 1
labels[(np.hypot(x - 1, y - 2) < 3.5) & (abs(z) < 26)] = 2
labels[(np.hypot(x / 1.3, y + 25) < 7) & (abs(z) < 28)] = 5
image = nib.Nifti1Image(labels, affine); image.header.set_xyzt_units("mm"); nib.save(image, sys.argv[1])
out = {}
for label in (1, 2, 5):
    v = np.argwhere(labels == label)
    out[str(label)] = [*(affine @ np.append(v.mean(axis=0), 1))[:3], len(v) * zooms.prod()]
print(json.dumps(out))
"#;

const SCENE: &str = r#"
name = "three structures"
[volume]
file = "FILE"
[[structure]]
label = 1
called = "Prostate"
[[structure]]
label = 2
called = "Urethra"
young_kpa = 40
[[structure]]
label = 5
called = "Rectum"
stretch = [0.65, 1.55]
shear_deg = 23
"#;

fn convert(from: &Path, to: &Path) {
    let out = Command::new(program("host-ui"))
        .arg("convert")
        .args([from, to])
        .output()
        .expect("host-ui runs");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}

/// Writes it as NRRD with names, MetaImage, NIfTI with a scene file each, and DICOM contours.
fn formats(folder: &Path) -> Vec<PathBuf> {
    let by_scene_file = |file: &str| {
        let path = folder.join(format!("{file}.toml"));
        std::fs::write(&path, SCENE.replace("FILE", file)).expect("written");
        path
    };
    let nifti = folder.join("labels.nii.gz");
    convert(&nifti, &folder.join("labels.mha"));
    convert(&nifti, &folder.join("labels.nrrd"));
    // Names come from the header of an NRRD; the label volume of a contour set has them too.
    let text = "Segment0_Name:=Prostate\nSegment0_LabelValue:=1\nSegment1_Name:=Urethra\nSegment1_LabelValue:=2\n\
                Segment2_Name:=Rectum\nSegment2_LabelValue:=5\n\n";
    let bytes = std::fs::read(folder.join("labels.nrrd")).expect("written");
    let end = bytes.windows(2).position(|w| w == b"\n\n").expect("a header") + 1;
    let named = [&bytes[..end], text.as_bytes(), &bytes[end + 1..]].concat();
    std::fs::write(folder.join("labels.seg.nrrd"), named).expect("written");
    convert(&folder.join("labels.seg.nrrd"), &folder.join("labels.dcm"));
    vec![
        by_scene_file("labels.nii.gz"),
        by_scene_file("labels.mha"),
        folder.join("labels.seg.nrrd"),
        folder.join("labels.dcm"),
    ]
}

#[test]
fn every_format_gives_the_same_structures_at_the_same_place() {
    where_the_machine_runs(|| {
        let folder = scratch("formats");
        let out = Command::new("/usr/bin/python3")
            .args(["-c", WRITE])
            .arg(folder.join("labels.nii.gz"))
            .output()
            .expect("python3 runs");
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let truth: serde_json::Value = serde_json::from_slice(&out.stdout).expect("JSON");
        let mut core = Core::start();
        let mut link = core.host();
        for path in formats(&folder) {
            let name = path.file_name().expect("named").to_string_lossy().into_owned();
            let volume =
                stylet_files::read(&path, None, &stylet_files::Progress::default()).unwrap_or_else(|e| panic!("{e}"));
            let before = link.scene().expect("live").header.generation;
            let id = link.upload(&volume).expect("sent");
            let shown = until(Duration::from_secs(60), || {
                link.poll();
                if let Some(answer) = link.reply(id) {
                    assert!(answer.is_ok(), "{name}: {answer:?}");
                }
                link.scene().is_some_and(|s| s.header.generation != before)
            });
            assert!(shown && core.is_running(), "{name}");
            let header = link.scene().expect("live").header;
            let t = header.patient_from_scene;
            assert_eq!(header.structures().len(), 3, "{name}");
            for (structure, label) in header.structures().iter().zip(["1", "2", "5"]) {
                let expected_role = if label == "1" { role::TARGET } else { role::SPARE };
                assert_eq!(structure.role, expected_role, "{name}: {}", structure.name.read());
                let expected: Vec<f64> = truth[label]
                    .as_array()
                    .expect("four")
                    .iter()
                    .map(|v| v.as_f64().expect("a number"))
                    .collect();
                let volume_mm3 = f64::from(structure.element_count) * (header.spacing_m * 1e3).powi(3);
                assert!(
                    (volume_mm3 / expected[3] - 1.0).abs() < 0.03,
                    "{name}, {}: {volume_mm3} and {} mm3",
                    structure.name.read(),
                    expected[3]
                );
                let centre = centre_of_cells(&volume, structure.label as u8);
                let patient_mm = [0, 1, 2].map(|r| {
                    (t[3 * r] * centre[0] + t[3 * r + 1] * centre[1] + t[3 * r + 2] * centre[2] + t[9 + r]) * 1e3
                });
                let off_mm = (0..3)
                    .map(|a| (patient_mm[a] - expected[a]).powi(2))
                    .sum::<f64>()
                    .sqrt();
                println!("{name}: {} is off by {off_mm:.3} mm", structure.name.read());
                // Half of the smallest side of a voxel.
                assert!(
                    off_mm < 0.4,
                    "{name}, {}: {patient_mm:?} and {expected:?}",
                    structure.name.read()
                );
            }
        }
    });
}

fn centre_of_cells(v: &stylet_files::LabelVolume, label: u8) -> [f64; 3] {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for (index, _) in v.cells.iter().enumerate().filter(|(_, c)| **c == label) {
        let at = [
            index % v.dims[0],
            index / v.dims[0] % v.dims[1],
            index / v.dims[0] / v.dims[1],
        ];
        (0..3).for_each(|a| sum[a] += (at[a] as f64 + 0.5) * v.spacing_m);
        count += 1.0;
    }
    sum.map(|s| s / count)
}

#[test]
fn a_scene_file_that_cannot_be_used_is_refused_and_the_scene_goes_on() {
    where_the_machine_runs(|| {
        let folder = scratch("bad-scene");
        let scene = folder.join("bad.toml");
        std::fs::write(&scene, "[volume]\nfile = \"none.nrrd\"\n[needle]\nspeed = 3\n").expect("written");
        let mut core = Core::start();
        let mut link = core.host();
        let before = link.scene().expect("live").header.generation;
        let run = Command::new(program("host-ui"))
            .args(["procedure", "--instance", core.instance.name(), "--scene"])
            .arg(&scene)
            .output()
            .expect("host-ui runs");
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(
            !run.status.success() && said.contains("unknown field `speed`"),
            "{said}"
        );
        link.poll();
        assert!(core.is_running());
        assert_eq!(link.scene().expect("live").header.generation, before);
    });
}
