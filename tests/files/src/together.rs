//! Every subcommand that takes more than one clinical file, as the definitions of the command lines
//! list them, refuses files of two patients or frames, and reports files of two studies.

use clap::{Command, CommandFactory};
use std::any::TypeId;
use std::collections::BTreeSet;
use std::path::PathBuf;
use stylet_dose::Source;
use stylet_files::dicom::Identity;
use stylet_files::dicom::dose::{self, DoseImage, DoseKind, DoseOf};
use stylet_files::dicom::plan::{self, PlanSeed, SeedPlan};
use stylet_files::dicom::structures::write::{self as structures, Outlined, Written};
use stylet_host::core_args::SceneChoice;
use stylet_implant::plan::exchange::seeds_of_source;
use stylet_test_kit::{program, repository, scratch};

/// Names of the definitions; the window is a command of the first.
const PROGRAMS: [&str; 2] = ["host-ui", "stylet-clinic"];

/// Content of a file that an option names.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Structures,
    Seeds,
    Dose,
    Points,
    /// The series in `tests/files/data/dicom`, whose patient all others have as well.
    Images,
}

/// Options for clinical files, by command; `convert` gets a dose.
const CLINICAL: [(&str, &str, Kind); 28] = [
    ("", "scene", Kind::Structures),
    ("", "image", Kind::Images),
    ("procedure", "scene", Kind::Structures),
    ("procedure", "plan", Kind::Seeds),
    ("plan", "scene", Kind::Structures),
    ("plan", "seeds", Kind::Seeds),
    ("convert", "from", Kind::Dose),
    ("convert", "plan", Kind::Seeds),
    ("convert", "like", Kind::Structures),
    ("dicom", "seeds", Kind::Seeds),
    ("dicom", "structures", Kind::Structures),
    ("dicom", "images", Kind::Images),
    ("dicom", "like", Kind::Dose),
    ("dose", "seeds", Kind::Seeds),
    ("dose", "rt_dose", Kind::Dose),
    ("dose", "points", Kind::Points),
    ("dose", "structures", Kind::Structures),
    ("perturb", "plan", Kind::Seeds),
    ("perturb", "structures", Kind::Structures),
    ("compare", "dose", Kind::Dose),
    ("compare", "with", Kind::Dose),
    ("post-implant", "planned", Kind::Seeds),
    ("post-implant", "structures", Kind::Structures),
    ("post-implant", "delivered", Kind::Seeds),
    ("post-implant", "day0", Kind::Seeds),
    ("post-implant", "day0_structures", Kind::Structures),
    ("post-implant", "day30", Kind::Seeds),
    ("post-implant", "day30_structures", Kind::Structures),
];
/// Options for one clinical file alone.
const ALONE: [(&str, &str); 3] = [("find-seeds", "ct"), ("check", "file"), ("picture", "scene")];
/// Options for files and folders that are of no patient: sources, results, recordings, studies.
const OTHERS: [&str; 18] = [
    "class",
    "core",
    "csv",
    "csv_2",
    "errors_of",
    "folder",
    "folders",
    "json",
    "motion",
    "motion_2",
    "openmetrics",
    "out",
    "program",
    "recording",
    "sheets",
    "source",
    "to",
    "watch",
];
/// Further arguments without which a command is not valid, or takes long.
const FURTHER: [(&str, &[&str]); 7] = [
    ("plan", &["--source", "SOURCE", "--out", "OUT.toml"]),
    ("procedure", &["--out", "OUT"]),
    ("convert", &["OUT.dcm"]),
    ("dicom", &["--source", "SOURCE", "--out", "OUT"]),
    ("dose", &["--source", "SOURCE", "--out", "OUT"]),
    ("perturb", &["--source", "SOURCE", "--out", "OUT", "--trials", "2"]),
    ("post-implant", &["--source", "SOURCE", "--out", "OUT"]),
];

/// Returns each command without subcommands of its own.
fn leaves(command: &Command, all: &mut Vec<Command>) {
    all.push(command.clone());
    command.get_subcommands().for_each(|sub| leaves(sub, all));
}

fn takes_a_path(arg: &clap::Arg) -> bool {
    let kind = arg.get_value_parser().type_id();
    kind == TypeId::of::<PathBuf>() || kind == TypeId::of::<SceneChoice>()
}

/// Folder with a file of each kind for one identity.
struct Files {
    folder: PathBuf,
}

impl Files {
    fn of(name: &str, identity: &Identity) -> Self {
        let files = Self {
            folder: scratch(&format!("together-{name}")),
        };
        let put = |kind: Kind, bytes: Vec<u8>| std::fs::write(files.path(kind), bytes).unwrap();
        let square = |side: f64, z: f64| {
            let corner = |[x, y]: [f64; 2]| nalgebra::Vector3::new(x * side, y * side, z);
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(corner)
                .to_vec()
        };
        let body = |side: f64| (0..8).map(|k| square(side, f64::from(k) * 2.5e-3)).collect();
        let outlined = |(name, side): (&str, f64)| Outlined {
            name: name.to_owned(),
            contours: body(side),
        };
        let set = Written {
            uid: "2.25.11",
            identity,
            images: &[],
            structures: &[("Prostate", 15e-3), ("Urethra", 3e-3)].map(outlined),
        };
        put(Kind::Structures, structures::bytes(&set).unwrap());
        let seed = |n: usize| PlanSeed {
            needle: Some(n as u32 / 3 + 1),
            hole: String::new(),
            position_m: [
                (n * n % 7) as f64 * 3e-3 - 9e-3,
                (n % 5) as f64 * 4e-3 - 8e-3,
                (n % 4) as f64 * 5e-3,
            ],
            axis: Some([0.0, 0.0, 1.0]),
            strength_u: 0.5,
            strength_on: None,
        };
        let source = Source::known("6711").unwrap();
        let seeds = SeedPlan {
            uid: "2.25.12".to_owned(),
            ..seeds_of_source(&source, (0..12).map(seed).collect(), Some(145.0), identity.clone())
        };
        put(Kind::Seeds, plan::bytes(&seeds).unwrap());
        let image = DoseImage {
            dims: [3, 3, 3],
            origin_m: [0.0; 3],
            spacing_m: [2e-3; 3],
            dose_gy: &[100.0; 27],
            kind: &DoseKind::default(),
        };
        let of = DoseOf {
            uid: "2.25.13",
            identity,
            plan: "2.25.12",
            structure_set: None,
            histograms: &[],
        };
        put(Kind::Dose, dose::bytes(&image, &of).unwrap());
        put(
            Kind::Points,
            format!("{}x_mm,y_mm,z_mm\n1,2,3\n", identity.comments()).into_bytes(),
        );
        files
    }

    fn path(&self, kind: Kind) -> PathBuf {
        match kind {
            Kind::Images => repository("tests/files/data/dicom"),
            kind => self.folder.join(format!("{kind:?}")).with_extension(match kind {
                Kind::Points => "csv",
                _ => "dcm",
            }),
        }
    }
}

/// Runs a command with the files of `others`, except for one option; returns whether it succeeded,
/// and its messages.
fn run(command: &Command, options: &[(&clap::Arg, Kind)], odd: &str, others: &Files, of_odd: &Files) -> (bool, String) {
    let name = command.get_name();
    let out = others.folder.join("out");
    let _ = std::fs::remove_dir_all(&out);
    std::fs::create_dir_all(&out).unwrap();
    let mut process = std::process::Command::new(program("host-ui"));
    if !PROGRAMS.contains(&name) {
        process.arg(name);
    }
    for (arg, kind) in options {
        // The series is one: where it is the odd one, all others are.
        let is_odd = (arg.get_id() == odd)
            != options
                .iter()
                .any(|(arg, kind)| arg.get_id() == odd && *kind == Kind::Images);
        let file = if is_odd { of_odd.path(*kind) } else { others.path(*kind) };
        if let Some(long) = arg.get_long() {
            process.arg(format!("--{long}"));
        }
        process.arg(file);
    }
    let further = FURTHER
        .iter()
        .find(|(of, _)| *of == name)
        .map_or(&[][..], |(_, further)| further);
    for word in further {
        match *word {
            "SOURCE" => process.arg(repository("sources/i125_6711.toml")),
            word if word.starts_with("OUT") => process.arg(out.join(word.replace("OUT", "result"))),
            word => process.arg(word),
        };
    }
    if command.get_arguments().any(|arg| arg.get_id() == "instance") {
        process.args(["--instance", "no-core-of-together"]);
    }
    // No window may open.
    process.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let done = process.output().unwrap();
    let said = [done.stdout, done.stderr].concat();
    (done.status.success(), String::from_utf8_lossy(&said).into_owned())
}

#[test]
fn every_command_compares_its_clinical_files() {
    let own = Identity::of_path(&repository("tests/files/data/dicom"))
        .unwrap()
        .unwrap();
    assert!(!own.patient_id.is_empty() && !own.frame_of_reference.is_empty() && !own.study.is_empty());
    let same = Files::of("same", &own);
    let other_patient = Identity {
        patient_id: "OTHER".to_owned(),
        ..own.clone()
    };
    let other_frame = Identity {
        frame_of_reference: "1.2.3.9".to_owned(),
        ..own.clone()
    };
    let other_study = Identity {
        study: "1.2.3.8".to_owned(),
        ..own.clone()
    };
    let mixed = [
        (Files::of("patient", &other_patient), "patient \""),
        (Files::of("frame", &other_frame), "frame of reference is"),
        (Files::of("study", &other_study), "another study"),
    ];
    let mut all = Vec::new();
    leaves(&host_ui::cli::Cli::command(), &mut all);
    leaves(&stylet_clinic::cli::Cli::command(), &mut all);
    let mut checked = BTreeSet::new();
    for command in &all {
        let name = command.get_name();
        let key = if PROGRAMS.contains(&name) { "" } else { name };
        let of_option = |id: &str| {
            CLINICAL
                .iter()
                .find(|(of, option, _)| *of == key && *option == id)
                .map(|(.., kind)| *kind)
        };
        let mut options = Vec::new();
        for arg in command.get_arguments().filter(|arg| takes_a_path(arg)) {
            let id = arg.get_id().as_str();
            match of_option(id) {
                Some(kind) => options.push((arg, kind)),
                None => assert!(
                    ALONE.contains(&(key, id)) || OTHERS.contains(&id),
                    "host-ui {name}: is {id} a clinical file? If so, name it in CLINICAL and compare it with `together`"
                ),
            }
        }
        if options.len() < 2 {
            assert!(
                options.is_empty(),
                "host-ui {name}: one clinical file belongs into ALONE"
            );
            continue;
        }
        checked.insert(key.to_owned());
        for (arg, _) in &options {
            let odd = arg.get_id().as_str();
            for (files, reported) in &mixed {
                let is_note = *reported == "another study";
                if is_note && (key.is_empty() || odd.starts_with("day")) {
                    // The window would open; images of other days are of other studies.
                    continue;
                }
                let (done, said) = run(command, &options, odd, &same, files);
                assert!(said.contains(reported), "host-ui {name}, other {odd}: {said}");
                assert!(is_note || !done, "host-ui {name}, other {odd}: {said}");
            }
        }
    }
    let named: BTreeSet<String> = CLINICAL.iter().map(|(of, ..)| (*of).to_owned()).collect();
    assert_eq!(checked, named);
}

/// A scene file names volume, image and plan itself.
#[test]
fn the_files_of_a_scene_file_are_compared() {
    let own = Identity::of_path(&repository("tests/files/data/dicom"))
        .unwrap()
        .unwrap();
    let other = Identity {
        patient_id: "OTHER".to_owned(),
        ..own.clone()
    };
    let (own, other) = (Files::of("scene", &own), Files::of("scene-other", &other));
    for (volume, plan, is_refused) in [(&own, &own, false), (&own, &other, true)] {
        let scene = own.folder.join("scene.toml");
        let [volume, plan] = [volume.path(Kind::Structures), plan.path(Kind::Seeds)];
        let text = format!("[volume]\nfile = {volume:?}\n[plan]\nfile = {plan:?}\n");
        std::fs::write(&scene, text).unwrap();
        let mut process = std::process::Command::new(program("host-ui"));
        let done = process.args(["scene", "check"]).arg(&scene).output().unwrap();
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(said.contains("patient \"OTHER\""), is_refused, "{said}");
        assert_eq!(done.status.success(), !is_refused, "{said}");
    }
}
