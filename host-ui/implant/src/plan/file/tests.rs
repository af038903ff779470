//! A plan that was written reads back equal; a broken one is refused with every problem.

use super::*;
use crate::readers::{SeedDefaults, read_seeds};

/// Returns a quarter turn about x, and a shift: patient y is the scene's -z.
fn frames() -> PatientFrame {
    PatientFrame::of_wire(&[1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.01, -0.02, 0.03])
}

fn plan() -> ImplantPlan {
    let template = Template {
        middle_m: [0.05, 0.04, -0.01],
        columns: [-1.0, 0.0, 0.0],
        rows: [0.0, 1.0, 0.0],
        inwards: [0.0, 0.0, 1.0],
        pitch_m: 5e-3,
    };
    let plan = ImplantPlan {
        template,
        source: "6711".to_owned(),
        prescription_gy: 145.0,
        needles: Vec::new(),
    };
    let plan = plan.with_needle("E7".parse().unwrap(), 0.08).unwrap();
    let plan = plan.with_strand(0, 3, 0.08, 0.45).unwrap();
    let plan = plan.with_needle("I9".parse().unwrap(), 0.07).unwrap();
    let plan = plan.with_seed(1, 0.071, 0.5).unwrap();
    plan.with_seed(1, 0.052, 0.6).unwrap()
}

fn same(a: &ImplantPlan, b: &ImplantPlan) {
    let numbers = |p: &ImplantPlan| -> Vec<f64> {
        let t = &p.template;
        let template = [t.middle_m, t.columns, t.rows, t.inwards].concat();
        let of_needle = |n: &Needle| {
            let seeds = n.seeds.iter().flat_map(|s| [s.along_m, s.strength_u]);
            [n.entry_m, n.direction]
                .concat()
                .into_iter()
                .chain([n.depth_m, n.retract_to_m])
                .chain(seeds)
                .collect::<Vec<_>>()
        };
        template
            .into_iter()
            .chain(p.needles.iter().flat_map(of_needle))
            .collect()
    };
    let (one, other) = (numbers(a), numbers(b));
    assert_eq!(one.len(), other.len());
    for (x, y) in one.iter().zip(&other) {
        assert!((x - y).abs() < 1e-8, "{x} {y}");
    }
    let holes = |p: &ImplantPlan| p.needles.iter().map(|n| n.hole).collect::<Vec<_>>();
    assert_eq!(holes(a), holes(b));
}

#[test]
fn the_plan_of_one_needle_is_that_needle() {
    let mut whole = plan();
    whole.needles.truncate(1);
    let needle = whole.planned(0).expect("a needle");
    let one = ImplantPlan::of_one_needle(&needle, whole.template);
    same(&one, &whole);
    assert_eq!((&*one.source, one.prescription_gy), ("6711", 145.0));
}

#[test]
fn a_plan_round_trip_keeps_the_patient_frame() {
    let text = to_text(&plan(), &frames()).unwrap();
    // The scene's z is the patient's -y: the needle goes posterior.
    assert!(text.contains("direction = [0.0, -1.0, 0.0]"), "{text}");
    let again = from_text(&text, &frames()).unwrap();
    same(&plan(), &again);
    let pitch_m = again.needles[0].loading.pitch_m().expect("a strand");
    assert!((pitch_m - 0.01).abs() < 1e-12);
    assert_eq!(again.needles[1].loading, Loading::Loose);
}

#[test]
fn a_broken_plan_is_refused_with_every_problem() {
    let good = to_text(&plan(), &frames()).unwrap();
    assert!(from_text("", &frames()).is_err());
    assert!(from_text(&good.replace("source =", "sauce ="), &frames()).is_err());
    let mut wrong = good.replace("\"E7\"", "\"Z7\"").replace("0.45", "nan");
    wrong = wrong.replace("prescription_gy = 145.0", "prescription_gy = 0.0");
    wrong = wrong.replacen("direction = [0.0, -1.0, 0.0]", "direction = [0.0, -2.0, 0.0]", 1);
    let why = from_text(&wrong, &frames()).unwrap_err().to_string();
    for words in ["prescription_gy is 0", "needle 1: direction", "Z7", "strength_u is NaN"] {
        assert!(why.contains(words), "{words}: {why}");
    }
    for end in (0..good.len()).step_by(37) {
        let _ = from_text(&good[..end], &frames());
    }
}

#[test]
fn written_seeds_read_back_equal() {
    let folder = std::env::temp_dir().join(format!("stylet-plan-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("seeds.csv");
    std::fs::write(&file, seeds_to_csv(&plan(), &frames())).unwrap();
    let read = read_seeds(&file, SeedDefaults::default()).unwrap().rows;
    for (a, b) in plan().seeds().iter().zip(&read) {
        let there = frames().patient_from_scene(a.position_m);
        assert!(
            (0..3).all(|i| (there[i] - b.position_m[i]).abs() < 1e-9),
            "{there:?} {b:?}"
        );
        assert!((b.axis.unwrap()[1] + 1.0).abs() < 1e-9 && a.strength_u == b.strength_u);
    }
    let plan = plan();
    let rows = read_seeds(&file, SeedDefaults::default()).unwrap();
    let imported = import(&file, rows, &frames(), plan.template, "6711", 145.0).unwrap();
    same(&plan, &imported);
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Imports a table.
fn imported(name: &str, csv: &str) -> Result<ImplantPlan, String> {
    let file = std::env::temp_dir().join(format!("stylet-plan-{name}-{}.csv", std::process::id()));
    std::fs::write(&file, csv).unwrap();
    let rows = read_seeds(&file, SeedDefaults::default());
    std::fs::remove_file(&file).unwrap();
    let rows = rows.map_err(|why| why.to_string())?;
    import(&file, rows, &frames(), plan().template, "6711", 145.0).map_err(|why| why.to_string())
}

#[test]
fn two_needles_through_one_hole_stay_two_in_a_table() {
    let plan = plan().with_needle("C3".parse().unwrap(), 0.06).unwrap();
    let mut plan = plan.with_seed(2, 0.061, 0.5).unwrap();
    let (hole, entry_m) = (plan.needles[1].hole, plan.needles[1].entry_m);
    (plan.needles[2].hole, plan.needles[2].entry_m) = (hole, entry_m);
    let csv = seeds_to_csv(&plan, &frames());
    assert!(csv.starts_with("x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u,needle,hole\n"));
    assert!(csv.ends_with(",0.5,3,I9\n"), "{csv}");
    same(&plan, &imported("two", &csv).unwrap());
    // Without the numbers the line decides, and the hole is found by it.
    let lines = csv.lines().map(|line| line.rsplitn(3, ',').last().unwrap());
    let by_line = imported("lines", &lines.collect::<Vec<_>>().join("\n")).unwrap();
    let holes: Vec<_> = by_line.needles.iter().map(|n| n.hole.unwrap().to_string()).collect();
    assert_eq!(holes, ["E7", "I9"]);
    assert_eq!(by_line.needles[1].seeds.len(), 3);
}

#[test]
fn a_table_whose_needles_contradict_its_places_is_refused() {
    let csv = seeds_to_csv(&plan(), &frames());
    for (from, to, reported) in [
        (",2,I9", ",1,E7", "needle 1: its seeds are not on one line"),
        (",2,I9", ",2,J9", "needle 2: its seeds are 5.0 mm off hole J9"),
        (",2,I9", ",2,Z9", "needle 2: \"Z9\" is not a hole"),
        (",2,I9", ",0,I9", "needle is \"0\", not a whole number from 1"),
        (",2,I9", ",two,I9", "needle is \"two\""),
    ] {
        let why = imported("wrong", &csv.replace(from, to)).unwrap_err().to_string();
        assert!(why.contains(reported), "{reported}: {why}");
    }
}
