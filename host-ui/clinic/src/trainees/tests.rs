//! Debriefs of known values, read, compared and shown.

use super::*;
use serde_json::json;
use std::path::Path;
use stylet_host::moments::STOPPED;

/// Writes the part of `score::to_json` that a class needs.
fn debrief(folder: &Path, name: &str, session: &str, mean_error_mm: f64, d90_gy: f64) {
    let score = json!({
        "title": "Scene pelvis", "prescription_gy": 160.0, "seeds_planned": 40, "seeds_lost": 1,
        "mean_error_mm": mean_error_mm, "worst_error_mm": 2.0 * mean_error_mm,
        "delivered": {
            "structures": [
                { "name": "Urethra", "metrics": { "D90": 1.0 } },
                { "name": "Prostate", "metrics": { "D90": d90_gy, "V100": 93.5 } },
            ],
            "target": { "name": "Prostate" },
        },
        "motion": { "duration_s": 90.0, "peak_force_n": 6.5 },
        "moments": [
            { "at_s": 1.0, "kind": "mark", "text": STOPPED },
            { "at_s": 2.0, "kind": "mark", "text": "apex" },
            { "at_s": 3.0, "kind": "exercise", "text": "device lost" },
            { "at_s": 3.1, "kind": "fault", "text": "the device is not connected" },
            { "at_s": 9.0, "kind": "exercise", "text": "all exercises ended" },
        ],
    });
    let folder = folder.join(name).join(session);
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("score.json"), score.to_string()).expect("written");
}

fn class() -> (tempfile::TempDir, Class) {
    let folder = tempfile::tempdir().expect("a folder");
    for (n, error_mm) in [5.0, 4.1, 3.0, 1.9, 1.0].into_iter().enumerate() {
        debrief(
            folder.path(),
            "Otto",
            &format!("2026110{}T090000Z", n + 1),
            error_mm,
            144.0,
        );
    }
    for (n, error_mm) in [2.0, 4.0].into_iter().enumerate() {
        debrief(
            folder.path(),
            "Ida Ö.",
            &format!("2026110{}T100000Z", n + 1),
            error_mm,
            176.0,
        );
    }
    let broken = folder.path().join("Otto").join("20261109T090000Z");
    std::fs::create_dir_all(&broken).expect("a folder");
    std::fs::write(broken.join("score.json"), "{ \"mean_error_mm\": 1 }").expect("written");
    let class = Class::read(&[folder.path().to_owned()]).expect("read");
    (folder, class)
}

#[test]
fn debriefs_are_read_and_other_files_named() {
    let (_folder, class) = class();
    assert_eq!(class.attempts.len(), 7);
    let trainees = class.trainees();
    assert_eq!(
        trainees
            .iter()
            .map(|(name, own)| (*name, own.len()))
            .collect::<Vec<_>>(),
        [("Ida Ö.", 2), ("Otto", 5)]
    );
    let first = &trainees[1].1[0];
    assert_eq!(
        *first,
        Attempt {
            trainee: "Otto".to_owned(),
            session: "20261101T090000Z".to_owned(),
            title: "Scene pelvis".to_owned(),
            mean_error_mm: 5.0,
            worst_error_mm: 10.0,
            seeds: [40, 1],
            d90_percent: Some(90.0),
            v100_percent: Some(93.5),
            duration_s: 90.0,
            peak_force_n: 6.5,
            stops: 1,
            faults: 1,
            exercises: 1,
        }
    );
    assert_eq!(class.left_out.len(), 1);
    assert!(
        class.left_out[0].contains("no debrief of Stylet"),
        "{:?}",
        class.left_out
    );
}

#[test]
fn the_page_compares_trainees() {
    let (_folder, class) = class();
    let page = page(&class);
    for words in ["Ida Ö.", "Otto", "2 trainees, 7 procedures", "20261109T090000Z"] {
        assert!(page.contains(words), "{words:?} is missing");
    }
    // Mean 3, standard deviation 1.6140 of five, standard error 0.7218, t 2.776.
    assert!(
        page.contains("<small>1.00 to 5.00</small>"),
        "the interval of Otto's mean error"
    );
    // Counts are integers, and a session is named by its local time.
    assert!(
        page.contains("<td class=\"n\">1</td>") && !page.contains(">1.0</td>"),
        "counts"
    );
    let first = stylet_base::format::local_time("20261101T090000Z").expect("a time");
    assert!(page.contains(&first) && !page.contains(">20261101T090000Z"), "{first}");
    assert_eq!(page.matches("<polyline").count(), 6, "three curves of each trainee");
    assert!(!page.contains("src=") && !page.contains("href="), "it stands by itself");
}

#[test]
fn the_table_has_a_row_for_each_procedure() {
    let (_folder, class) = class();
    let mut table = Vec::new();
    write_table(&class, &mut table).expect("written");
    let text = String::from_utf8(table).expect("UTF-8");
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 8);
    assert_eq!(lines[3], "Otto,20261101T090000Z,5,10,90,93.5,1.5,6.5,1,1,1,1,40");
}

#[test]
fn a_folder_without_a_debrief_is_refused_with_the_expected_layout() {
    let folder = tempfile::tempdir().expect("a folder");
    let why = Class::read(&[folder.path().to_owned()]).expect_err("empty").to_string();
    assert!(why.contains("NAME/DATE/score.json"), "{why}");
}

/// Guards against a spreadsheet that computed a trainee's name, which is that of a folder.
#[test]
fn a_name_that_is_a_formula_is_text_in_the_table() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["=1+1", "@SUM(A1)", "-2+3", "+A1", "\t=1", "Ida"] {
        debrief(folder.path(), name, "20261101T090000Z", 1.0, 144.0);
    }
    let class = Class::read(&[folder.path().to_owned()]).expect("read");
    let mut bytes = Vec::new();
    write_table(&class, &mut bytes).expect("written");
    let mut rows = csv::Reader::from_reader(&*bytes);
    let names = rows.records().map(|row| row.expect("a row")[0].to_owned());
    assert_eq!(
        names.collect::<Vec<_>>(),
        ["'\t=1", "'+A1", "'-2+3", "'=1+1", "'@SUM(A1)", "Ida"]
    );
}
