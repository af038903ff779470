//! The procedure in a label volume written by another program, and unusable volumes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, program, scratch, until};

/// An irregular gland in 300x200x180 voxels of 0.4x0.5x0.9 mm under an oblique affine, written by nibabel;
/// prints its centre of mass in patient mm, from the voxels and the affine alone.
const WRITE_VOLUME: &str = r#"
import sys, numpy as np, nibabel as nib
shape, zooms = (300, 200, 180), np.array([0.4, 0.5, 0.9])
def turn(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    r = np.eye(3); i, j = [k for k in range(3) if k != axis]
    r[i, i], r[i, j], r[j, i], r[j, j] = c, -s, s, c
    return r
rotation = turn(0, 0.25) @ turn(1, -0.15) @ turn(2, 0.3)
affine = np.eye(4); affine[:3, :3] = rotation @ np.diag(zooms); affine[:3, 3] = [-42.0, 17.0, -63.0]
i, j, k = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
x, y, z = ((g - c) * s for g, c, s in zip((i, j, k), (158, 95, 92), zooms))
bump = 1 + 0.15 * np.sin(0.2 * z + 1) * np.cos(2 * np.arctan2(y, x))
gland = (x / 21) ** 2 + (y / 17) ** 2 + (z / 22) ** 2 < bump ** 2
gland &= ~((x > 8) & (y > 8) & (z > 5))
image = nib.Nifti1Image(gland.astype(np.uint8), affine)
image.header.set_xyzt_units("mm")
nib.save(image, sys.argv[1])
voxels = np.argwhere(gland)
centre = affine @ np.append(voxels.mean(axis=0), 1)
print(*centre[:3], len(voxels) * zooms.prod())
"#;

fn write_volume(path: &Path) -> [f64; 4] {
    let out = Command::new("/usr/bin/python3")
        .args(["-c", WRITE_VOLUME])
        .arg(path)
        .output()
        .expect("python3 runs");
    assert!(
        out.status.success(),
        "nibabel: {}",
        String::from_utf8_lossy(&out.stderr)
    );
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    let numbers: Vec<f64> = text.split_whitespace().map(|n| n.parse().expect("a number")).collect();
    numbers.try_into().expect("centre and volume")
}

fn procedure(core: &Core, scene: &Path, out: &Path) -> Output {
    Command::new(program("host-ui"))
        .args(["procedure", "--instance", core.instance.name(), "--scene"])
        .arg(scene)
        .arg("--out")
        .arg(out)
        .output()
        .expect("host-ui runs")
}

#[test]
fn the_procedure_runs_in_an_oblique_anisotropic_volume_at_its_place() {
    where_the_machine_runs(|| {
        let folder = scratch("volume");
        let file = folder.join("gland.nii.gz");
        let [x, y, z, volume_mm3] = write_volume(&file);
        let mut core = Core::start();
        let out = folder.join("out");
        let run = procedure(&core, &file, &out);
        let said = format!(
            "{}{}",
            String::from_utf8_lossy(&run.stdout),
            String::from_utf8_lossy(&run.stderr)
        );
        assert!(run.status.success(), "{said}");
        let result: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(out.join("result.json")).expect("result.json"))
                .expect("JSON");
        assert_eq!(result["seeds"].as_array().map(Vec::len), Some(5), "{result:#}");

        // The surface sent back by the core, in patient mm, against nibabel's voxels.
        let link = core.host();
        let scene = link.scene().expect("live");
        let t = scene.header.patient_from_scene;
        let to_patient_mm = |p: [f64; 3]| {
            [0, 1, 2].map(|r| (t[3 * r] * p[0] + t[3 * r + 1] * p[1] + t[3 * r + 2] * p[2] + t[9 + r]) * 1e3)
        };
        let centre = centre_of_volume(&scene.rest_m, &scene.triangles);
        let found = to_patient_mm(centre);
        let off_mm = ((found[0] - x).powi(2) + (found[1] - y).powi(2) + (found[2] - z).powi(2)).sqrt();
        println!(
            "gland centre off by {off_mm:.3} mm, {} elements",
            scene.header.element_count
        );
        // Half of the smallest voxel side.
        assert!(off_mm < 0.2, "centre {found:?} mm, voxels say {x} {y} {z}");
        let volume_error = (scene.header.volume_m3 * 1e9 - volume_mm3).abs() / volume_mm3;
        assert!(volume_error < 0.02, "volume off by {volume_error}");
    });
}

/// Centre of the body inside a closed surface (divergence theorem).
fn centre_of_volume(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> [f64; 3] {
    let (mut centre, mut volume) = ([0.0; 3], 0.0);
    for t in triangles {
        let [a, b, c] = t.map(|i| points[i as usize].map(f64::from));
        let cross = [
            b[1] * c[2] - b[2] * c[1],
            b[2] * c[0] - b[0] * c[2],
            b[0] * c[1] - b[1] * c[0],
        ];
        let six = a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2];
        volume += six;
        for axis in 0..3 {
            centre[axis] += six * (a[axis] + b[axis] + c[axis]) / 4.0;
        }
    }
    centre.map(|c| c / volume)
}

#[test]
fn unusable_volumes_get_one_clear_message_and_the_scene_goes_on() {
    where_the_machine_runs(|| {
        let folder = scratch("bad-volumes");
        let good = folder.join("good.nii");
        write_volume(&good);
        let bytes = std::fs::read(&good).expect("written");
        let mut files: Vec<(&str, PathBuf)> = Vec::new();
        let mut add = |name: &'static str, content: &[u8]| {
            let path = folder.join(format!("{name}.nii"));
            std::fs::write(&path, content).expect("written");
            files.push((name, path));
        };
        add("empty", &[]);
        add("cut-off", &bytes[..bytes.len() / 2]);
        add(
            "wrong",
            b"this is a letter, not a volume, and it goes on for a while "
                .repeat(20)
                .as_slice(),
        );
        let mut absurd = bytes.clone();
        // dim[1..=3] = 32767: 35 TB of voxels are claimed.
        for axis in 0..3 {
            absurd[42 + 2 * axis..44 + 2 * axis].copy_from_slice(&32767_i16.to_le_bytes());
        }
        add("absurd", &absurd);
        let mut nothing = bytes.clone();
        nothing[352..].fill(0);
        add("no-gland", &nothing);
        files.push(("missing", folder.join("there-is-no-such-file.nii")));

        let mut core = Core::start();
        let mut link = core.host();
        let before = link.scene().expect("live").header;
        for (name, path) in &files {
            let run = procedure(&core, path, &folder.join("out"));
            let said = String::from_utf8_lossy(&run.stderr).into_owned();
            println!("{name}: {}", said.trim());
            assert!(!run.status.success(), "{name} was taken");
            assert!(!said.contains("panicked"), "{name}: {said}");
            let messages = said.lines().filter(|l| l.starts_with("host-ui:")).count();
            assert_eq!(messages, 1, "{name}: {said}");
            assert!(
                said.contains(&*path.file_name().expect("named").to_string_lossy()),
                "{name} is not named: {said}"
            );
        }
        let tick = link.state().expect("live").tick;
        let goes_on = until(Duration::from_secs(3), || {
            link.poll();
            link.state().is_some_and(|s| s.tick > tick + 500)
        });
        assert!(goes_on && core.is_running());
        let after = link.scene().expect("live").header;
        assert_eq!(
            (before.generation, before.element_count),
            (after.generation, after.element_count)
        );
    });
}
