//! `host-ui dose` on a volume written by nibabel, against an evaluation in numpy of the same files.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use stylet_test_kit::{program, scratch};

/// A gland, a urethra and a rectum in voxels of 1.0 x 0.9 x 2.5 mm under an oblique affine, and 40 seeds along tilted
/// needles; prints volume, D90, V100, V150 of the gland, D30 of the urethra, D2cc of the rectum, from 27 points in each
/// voxel.
const WRITE_CASE: &str = r##"
import sys, math, tomllib, numpy as np, nibabel as nib
volume, seeds_file, source_file = sys.argv[1:4]
shape, zooms = (64, 70, 30), np.array([1.0, 0.9, 2.5])
c, s = math.cos(0.2), math.sin(0.2)
rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
affine = np.eye(4); affine[:3, :3] = rotation @ np.diag(zooms); affine[:3, 3] = [-30.0, -40.0, 12.0]
i, j, k = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
x, y, z = ((g - n / 2) * h for g, n, h in zip((i, j, k), shape, zooms))
labels = np.zeros(shape, np.uint8)
labels[(x / 22) ** 2 + (y / 17) ** 2 + (z / 20) ** 2 < 1] = 1
labels[(x ** 2 + (y + 3) ** 2 < 9) & (abs(z) < 20)] = 2
labels[((x / 12) ** 2 + ((y - 24) / 6) ** 2 < 1) & (abs(z) < 25)] = 3
image = nib.Nifti1Image(labels, affine); image.header.set_xyzt_units("mm"); nib.save(image, volume)
seeds = []
for a in (-14, -5, 5, 14):
    for b in (-8, 6):
        for d in np.arange(-14, 15, 7):
            seeds.append((a * math.cos(d / 40) + 0.3, b + d / 20, d))
middle = affine @ np.append(np.array(shape) / 2, 1)
places = np.array(seeds) @ rotation.T + middle[:3]
tilt = np.array([[math.sin(0.02 * n), 0.05, 1] for n in range(len(seeds))]) @ rotation.T
axes = tilt / np.linalg.norm(tilt, axis=1)[:, None]
with open(seeds_file, "w") as f:
    print("# written by a test\nx_mm,y_mm,z_mm,axis_x,axis_y,axis_z", file=f)
    for p, a in zip(places, 3 * axes):
        print(*(f"{v:.9g}" for v in (*p, *a)), sep=",", file=f)
data = tomllib.load(open(source_file, "rb")); src = data["source"]; L = src["active_length_cm"]
G = lambda r, t: np.where(np.sin(t) * r > 1e-6, (np.arctan2(r * np.cos(t) + L / 2, np.maximum(r * np.sin(t), 1e-12))
    - np.arctan2(r * np.cos(t) - L / 2, np.maximum(r * np.sin(t), 1e-12))) / (L * np.maximum(r * np.sin(t), 1e-12)), 1 / (r * r - L * L / 4))
rg, g = data["radial"]["r_cm"], data["radial"]["g_line"]; f2 = data["anisotropy_2d"]; F = np.array(f2["F"])
def aniso(r, deg):
    r = np.clip(r, f2["r_cm"][0], f2["r_cm"][-1]); out = np.zeros_like(r)
    n = np.clip(np.searchsorted(f2["r_cm"], r, side="right") - 1, 0, len(F) - 2)
    rows = np.array([np.interp(deg, f2["theta_deg"], row) for row in F])
    r0, r1 = np.array(f2["r_cm"])[n], np.array(f2["r_cm"])[n + 1]; w = (r - r0) / (r1 - r0)
    at = np.arange(len(r)); return rows[n, at] * (1 - w) + rows[n + 1, at] * w
total = src["dose_rate_constant"] / 100 * src["half_life_days"] * 24 / math.log(2)
def dose(points):
    sum = np.zeros(len(points))
    for p, a in zip(places, axes):
        d = (points - p) / 10; r = np.maximum(np.linalg.norm(d, axis=1), 0.04); t = np.arccos(np.clip(d @ a / r, -1, 1))
        deg = np.degrees(np.minimum(t, np.pi - t))
        sum += 0.5 * total * G(r, t) / G(np.array(1.0), np.array(np.pi / 2)) * np.exp(np.interp(r, rg, np.log(g))) * aniso(r, deg)
    return sum
def doses(label):
    at = np.argwhere(labels == label).astype(float)
    parts = [dose((at + np.array(o) / 3) @ (rotation @ np.diag(zooms)).T + affine[:3, 3])
             for o in np.ndindex(3, 3, 3) for o in [np.array(o) - 1]]
    return np.sort(np.concatenate(parts))[::-1], len(at) * zooms.prod() / 1000
d, cc = doses(1); u, _ = doses(2); w, wcc = doses(3)
print(cc, d[int(0.9 * len(d))], (d >= 145).mean() * 100, (d >= 217.5).mean() * 100, u[int(0.3 * len(u))], w[int(2 / wcc * len(w))])
"##;

pub struct Case {
    pub folder: PathBuf,
    /// Volume (cc), D90, V100, V150 of the gland; D30 of the urethra; D2cc of the rectum.
    pub expected: [f64; 6],
}

pub fn source() -> PathBuf {
    stylet_test_kit::repository("sources/i125_6711.toml")
}

pub fn case(name: &str) -> Case {
    let folder = scratch(name);
    let out = Command::new("/usr/bin/python3")
        .args(["-c", WRITE_CASE])
        .args([folder.join("case.nii.gz"), folder.join("seeds.csv"), source()])
        .output()
        .expect("python3 runs");
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success(), "numpy, nibabel: {said}");
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    let numbers: Vec<f64> = text.split_whitespace().map(|n| n.parse().expect("a number")).collect();
    Case {
        folder,
        expected: numbers.try_into().expect("six numbers"),
    }
}

pub const NAMES: [&str; 6] = ["--name", "1=Prostate", "--name", "2=Urethra", "--name", "3=Rectum"];

pub fn host(arguments: &[&str], files: &[(&str, PathBuf)]) -> Command {
    let mut command = Command::new(program("host-ui"));
    command.args(arguments);
    for (option, file) in files {
        command.arg(option).arg(file);
    }
    command
}

pub fn run(command: &mut Command) -> Output {
    command.output().expect("host-ui runs")
}

pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("written")).expect("JSON")
}

#[test]
fn metrics_of_a_plan_agree_with_numpy() {
    let case = case("dose-case");
    let out = case.folder.join("dose");
    let mut command = host(
        &[
            &["dose", "--strength-u", "0.5", "--metric", "D2cc", "--metric", "V145Gy"],
            NAMES.as_slice(),
        ]
        .concat(),
        &[
            ("--source", source()),
            ("--seeds", case.folder.join("seeds.csv")),
            ("--structures", case.folder.join("case.nii.gz")),
            ("--out", out.clone()),
        ],
    );
    let ended = run(&mut command);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    println!("{}", String::from_utf8_lossy(&ended.stdout));
    let result = json(&out.join("metrics.json"));
    let of = |i: usize, name: &str, unit: &str| {
        result["structures"][i]["metrics"][name][unit]
            .as_f64()
            .unwrap_or_else(|| panic!("{name} of {i}: {result:#}"))
    };
    let [cc, d90, v100, v150, d30, d2cc] = case.expected;
    println!("numpy: {:?}", case.expected);
    // NIfTI keeps the edges of its voxels in f32.
    assert!((result["structures"][0]["volume_cc"].as_f64().expect("a number") / cc - 1.0).abs() < 1e-6);
    for (what, found, expected) in [
        ("D90", of(0, "D90", "gy"), d90),
        ("D30 of the urethra", of(1, "D30", "gy"), d30),
        ("D2cc of the rectum", of(2, "D2cc", "gy"), d2cc),
    ] {
        assert!((found / expected - 1.0).abs() < 2e-3, "{what}: {found} and {expected}");
    }
    for (what, found, expected) in [
        ("V100", of(0, "V100", "percent"), v100),
        ("V150", of(0, "V150", "percent"), v150),
    ] {
        assert!((found - expected).abs() < 0.2, "{what}: {found} and {expected}");
    }
    assert_eq!(of(0, "V100", "cc"), of(0, "V145Gy", "cc"));
    assert_eq!(result["target"]["name"], "Prostate");
    let fit = |key: &str| {
        result["target"][key]
            .as_f64()
            .unwrap_or_else(|| panic!("{key}: {result:#}"))
    };
    assert!((fit("homogeneity") - (1.0 - v150 / v100)).abs() < 5e-3);
    // COIN from its definition; the volume at the prescription lies in and around the gland.
    let share = v100 / 100.0;
    let coin = share * share * cc / fit("volume_at_prescription_cc");
    assert!(
        (fit("conformity") - coin).abs() < 5e-3,
        "{} and {coin}",
        fit("conformity")
    );
    assert!(
        std::fs::read_to_string(out.join("dvh.svg"))
            .expect("a picture")
            .contains("Prostate")
    );
    let dvh = std::fs::read_to_string(out.join("dvh.csv")).expect("a table");
    assert!(dvh.starts_with("structure,dose_from_gy,dose_to_gy,") && dvh.contains("\nRectum,"));
}

#[test]
fn dose_at_points_and_over_a_time_comes_as_csv() {
    let folder = scratch("dose-points");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).expect("written");
        folder.join(name)
    };
    let seeds = write(
        "seeds.csv",
        "x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u\n1,2,3,0,0,2,2\n",
    );
    let points = write("points.csv", "x_mm,y_mm,z_mm\n11,2,3\n");
    let dose = |more: &[&str]| {
        // Results are not added to earlier ones.
        let _ = std::fs::remove_dir_all(folder.join("out"));
        let files = [
            ("--source", source()),
            ("--seeds", seeds.clone()),
            ("--points", points.clone()),
            ("--out", folder.join("out")),
        ];
        let ended = run(&mut host(&[&["dose"], more].concat(), &files));
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let text = std::fs::read_to_string(folder.join("out/dose_points.csv")).expect("written");
        let line = text.lines().nth(1).expect("a point").to_owned();
        assert_eq!(text.lines().next(), Some("x_mm,y_mm,z_mm,dose_gy"));
        line.split(',')
            .nth(3)
            .expect("a dose")
            .parse::<f64>()
            .expect("a number")
    };
    let all = dose(&[]);
    assert!((all - 2.0 * 19.847).abs() < 2e-3, "{all}");
    assert!((dose(&["--to-days", "59.4"]) / all - 0.5).abs() < 1e-5);
    assert!((dose(&["--from-days", "59.4", "--to-days", "118.8"]) / all - 0.25).abs() < 1e-5);
    assert!((dose(&["--measured-days-before", "59.4"]) / all - 0.5).abs() < 1e-5);
}

#[test]
fn what_is_wrong_is_reported_once_with_its_file_and_line() {
    let folder = scratch("dose-wrong");
    let good = "x_mm,y_mm,z_mm,strength_u\n1,2,3,0.5\n";
    let run_with = |seeds: &str, more: &[&str]| {
        let file = folder.join("seeds.csv");
        std::fs::write(&file, seeds).expect("written");
        let files = [("--source", source()), ("--seeds", file), ("--out", folder.join("out"))];
        let ended = run(&mut host(&[&["dose"], more].concat(), &files));
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(!said.contains("panicked"), "{said}");
        (ended.status.success(), said)
    };
    let mut wrong = Vec::new();
    for (seeds, more, reported) in [
        ("", [].as_slice(), "line 1: the header lacks x_mm, y_mm, z_mm"),
        ("x_mm,y_mm\n1,2\n", &[], "line 1: the header lacks z_mm"),
        ("x_mm,y_mm,z_mm,colour\n", &[], "the column \"colour\" is unknown"),
        ("x_mm,y_mm,z_mm\n", &[], "no line beside its header"),
        ("x_mm,y_mm,z_mm\n1,2,3\n", &[], "line 2: no strength"),
        (
            "# c\nx_mm,y_mm,z_mm,strength_u\n1,2,3,1\n\n1,oh,3,1\n",
            &[],
            "line 5: y_mm is \"oh\"",
        ),
        (
            "x_mm,y_mm,z_mm,strength_u\n1,2,3\n",
            &[],
            "line 2: it has 3 fields and the header 4",
        ),
        ("x_mm,y_mm,z_mm,strength_u\n1,2,1e9,1\n", &[], "line 2: 1000000000 mm"),
        ("x_mm,y_mm,z_mm,strength_u\n1,2,nan,1\n", &[], "line 2: z_mm is \"nan\""),
        (
            "x_mm,y_mm,z_mm,strength_u\n1,2,3,-1\n",
            &[],
            "line 2: a strength of -1 U",
        ),
        (
            "x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u\n1,2,3,0,0,0,1\n",
            &[],
            "line 2: the axis has the length 0",
        ),
        (
            "x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u\n1,2,3,0,,1,1\n",
            &[],
            "line 2: the axis is not complete",
        ),
        (
            "x_mm,y_mm,z_mm,strength_u,activity_mci\n1,2,3,1,1\n",
            &[],
            "line 2: both",
        ),
        (good, &["--to-days", "-1"], "--to-days -1: give 0"),
        (
            good,
            &["--structures", "/nowhere.nii", "--metric", "Q5"],
            "\"Q5\" is not a metric",
        ),
        (
            good,
            &["--structures", "/nowhere.nii"],
            "/nowhere.nii: it cannot be opened",
        ),
        (
            good,
            &["--structures", "/nowhere.nii", "--name", "x=y"],
            "--name x=y: write LABEL=NAME",
        ),
        (good, &["--points", "/nowhere.csv"], "/nowhere.csv: it cannot be opened"),
        (good, &["--spacing-mm", "0"], "--spacing-mm 0: give 0.05 to 100"),
    ] {
        let (went_well, said) = run_with(seeds, more);
        if went_well || !said.contains(reported) || said.matches("stylet-clinic:").count() != 1 {
            wrong.push(format!(
                "{seeds:?} {more:?}, taken {went_well}: not {reported:?} once in {said:?}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let (_, said) = run_with("x_mm,y_mm,z_mm,strength_u\n1,2,a,1\n1,b,3,1\n", &[]);
    assert!(said.contains("line 2: z_mm") && said.contains("line 3: y_mm"), "{said}");
    let (went_well, said) = run_with(good, &["--spacing-mm", "5"]);
    assert!(went_well, "{said}");
    let grid = std::fs::read_to_string(folder.join("out/dose_grid.csv")).expect("written");
    assert_eq!(grid.lines().count(), 1 + 9 * 9 * 9);
}

/// They used to panic: `host-ui scene check FILE | head -1`, `rt-core cost | head -1`.
#[test]
fn a_command_whose_output_nobody_reads_ends_without_a_panic() {
    use std::os::unix::process::ExitStatusExt;
    let folder = stylet_test_kit::repository("tests/files/corpus/nifti");
    let mut check = host(&["scene", "check"], &[]);
    check.arg(folder.join("itk_u8.nii.gz"));
    let mut cost = Command::new(program("rt-core"));
    cost.arg("cost");
    for mut command in [check, cost] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let ended = command.stdout(writer).output().expect("the program runs");
        let said = String::from_utf8_lossy(&ended.stderr);
        assert!(
            !said.contains("panicked") && ended.status.signal() == Some(libc::SIGPIPE),
            "{:?}: {said}",
            ended.status
        );
    }
}
