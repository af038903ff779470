//! The sources of the program, and the import of published tables.

use stylet_dose::Source;
use stylet_dose::source::sheet::{Given, Imported, import};
use stylet_dose::source::{Model, Reference};

/// IAI-125A as a consensus sheet, with dose rates by tests/oracles/along_away.py.
fn sheet() -> String {
    let file = stylet_test_kit::repository("tests/dose/data/along_away.csv");
    std::fs::read_to_string(file).expect("the sheet is there")
}

fn given() -> Given {
    Given {
        model: Model {
            model: "S1".to_owned(),
            nuclide: "I-125".to_owned(),
            half_life_days: 59.4,
            physical_length_cm: Some(0.45),
            physical_diameter_cm: Some(0.08),
            ..Model::default()
        },
        reference: Reference {
            publication: "Author, Journal 1, 2 (2020)".to_owned(),
            ..Reference::default()
        },
        ..Given::default()
    }
}

fn imported(sheet: &str) -> Imported {
    import(&[sheet.to_owned()], given()).expect("the sheet fits")
}

fn replaced(of: &str, by: &str) -> String {
    let text = sheet();
    assert!(text.contains(of), "{of} is not in the sheet");
    text.replacen(of, by, 1)
}

#[test]
fn every_source_of_the_program_names_its_publication_and_checks() {
    let models: Vec<String> = Source::all_known().map(|source| source.model).collect();
    assert_eq!(models, ["6711", "IAI-125A", "200"]);
    for model in &models {
        let reference = Source::named(model).expect("known").reference.expect("has a reference");
        for part in [
            Some(reference.publication),
            reference.doi,
            reference.half_life,
            reference.checked,
        ] {
            assert!(part.is_some_and(|text| !text.is_empty()), "{model}");
        }
        assert!(Source::file_of(model).is_some_and(|text| Source::parse(text).is_ok()));
    }
    let unknown = Source::named("6712").expect_err("no such model").to_string();
    assert!(unknown.ends_with("known are 6711, IAI-125A, 200"), "{unknown}");
}

#[test]
fn an_imported_sheet_gives_the_source_that_it_was_made_of() {
    let (found, shipped) = (imported(&sheet()), Source::named("IAI-125A").expect("known"));
    let expected = Source {
        model: "S1".to_owned(),
        strength_per_activity_u_per_mci: None,
        prescription_gy: None,
        reference: found.source.reference.clone(),
        ..shipped
    };
    assert_eq!(found.source, expected);
    assert_eq!(Source::parse(&found.text).expect("a source file"), expected);
    assert!(
        found.text.contains("publication = \"Author, Journal 1, 2 (2020)\""),
        "{}",
        found.text
    );
    let comparison = found.comparison.expect("there is a table");
    println!("{comparison}");
    // 14 by 13 places, one of them inside the capsule, with six digits.
    assert_eq!((comparison.entries.len(), comparison.within_tolerance()), (181, 181));
    assert!(comparison.entries.iter().all(|entry| entry.percent().abs() < 6e-4));
}

#[test]
fn semicolons_tabs_and_decimal_commas_give_the_same_source() {
    let expected = imported(&sheet()).source;
    for (mark, point) in [(";", ","), (";", "."), ("\t", ",")] {
        let text = sheet().replace(',', mark).replace('.', point);
        assert_eq!(imported(&text).source, expected, "{mark} {point}");
    }
    let titled = format!(
        "\u{feff}Title; with, marks\n{}",
        sheet().replace("Theta/deg", "q (\u{fffd})")
    );
    assert_eq!(imported(&titled).source, expected);
}

#[test]
fn what_does_not_fit_is_refused_with_its_place() {
    let two_constants = sheet() + ",L   =,0.99,,cGy/(h U)\n";
    for (text, expected) in [
        (replaced("cGy/(h U)", "Gy/(h U)"), "has the unit gy/(hu)"),
        (replaced(",0.3,cm", ",3,mm"), "active length 3 must be in cm"),
        (replaced("r (cm)", "r (mm)"), "'r (mm)': distances must be in cm"),
        (replaced("y / cm", "y / mm"), "'y / mm': distances must be in cm"),
        (replaced("Theta/deg", "Theta/rad"), "angles in degrees"),
        (replaced(",90,1.0", ",85,1.0"), "theta_deg goes from 0 to 85"),
        (replaced(",5,0.411", ",-5,0.411"), "theta_deg, entry 2 = -5"),
        (replaced("1,1,,40", "1,1.02,,40"), "g_line is 1.0200 at r = 1 cm"),
        (
            replaced("90,1.0,1.0", "90,1.0,1.1"),
            "F is 1.1000 at r = 1 cm, theta = 90 deg",
        ),
        (
            replaced("5,0.411,0.465", "5,0.411,"),
            "F is empty at 5 degrees and r = 1 cm",
        ),
        (replaced("0.75,1.035", "0.75,"), "g(r) is empty at r = 0.75 cm"),
        (replaced("gL(r)", "gP(r)"), "needs gL(r), for the line"),
        (replaced("r (cm),gL(r)", "r (cm),"), "no table with the headings"),
        (
            replaced("L   =,0.981", ","),
            "dose rate constant, cGy/(h U): there is none",
        ),
        (two_constants, "more than one value of the dose rate constant"),
        (String::new(), "no table with the headings"),
    ] {
        let why = import(&[text], given()).expect_err(expected).to_string();
        assert!(why.contains(expected), "{expected}: {why}");
    }
    assert!(
        import(&[sheet(), sheet()], given()).is_ok(),
        "the same sheet twice is one"
    );
    let other = [sheet(), replaced("0.15,1.053", "0.15,1.054")];
    let why = import(&other, given()).expect_err("two tables of g").to_string();
    assert!(why.contains("more than one table of g(r)"), "{why}");
}

#[test]
fn what_is_filled_in_or_left_out_is_noted() {
    let expected = imported(&sheet()).source;
    let has = |notes: &[String], part: &str| assert!(notes.iter().any(|note| note.contains(part)), "{part}: {notes:?}");
    // As in sheets of ESTRO: a row r = 0, and a heading that was copied from another source.
    let found = imported(&replaced("gL(r)", "gL(r) L = 0.5 cm").replace(",0.1,1.04,", ",0,1.04,"));
    has(&found.notes, "names another active length, 0.5 cm, than 0.3 cm");
    has(&found.notes, "g(0) is left out");
    let found = imported(&replaced("gL(r)", "g(r)"));
    has(&found.notes, "does not name its geometry; it is used for the line");
    assert_eq!(found.source.tables, expected.tables);
    let found = imported(&replaced("0,0.352,0.406", "0,,").replace("0.578,0.612", "0.578,-"));
    has(
        &found.notes,
        "3 empty entries of F have the value of the nearest radius",
    );
    let f = found.source.tables.anisotropy_2d.expect("has F");
    assert_eq!([0, 1, 2, 5].map(|row| f.values[row * 11]), [0.493, 0.493, 0.493, 0.578]);
    let found = imported(&replaced("Theta/deg,0.5", "Theta/deg,0"));
    has(&found.notes, "F(0, theta) is left out");
    let other = Given {
        dose_rate_constant: Some(0.99),
        ..given()
    };
    let found = import(&[sheet()], other).expect("fits");
    has(&found.notes, "the given 0.99 is used; the sheet has 0.981");
    has(&found.notes, "g has 0.1 to 10 cm: nearer it keeps its first value");
    assert!((found.comparison.expect("compared").mean_percent() - 0.917).abs() < 1e-3);
}

#[test]
fn a_deviation_is_reported_with_its_size_and_place() {
    let found = imported(&replaced("0.549781", "0.523601"))
        .comparison
        .expect("compared");
    let worst = found.worst().expect("has entries");
    assert_eq!(
        (worst.along_cm, worst.away_cm, found.within_tolerance()),
        (1.0, 0.75, 180)
    );
    assert!((worst.percent() - 5.0).abs() < 1e-3, "{}", worst.percent());
    let said = found.to_string();
    assert!(
        said.starts_with("180 of 181 dose rates within the 2 % of TG-43U1"),
        "{said}"
    );
    assert!(said.contains("worst +5.00 % at 1 cm along, 0.75 cm away"), "{said}");
    let other_unit = replaced("0.981,,cGy", "0.00981,,cGy");
    let said = imported(&other_unit).comparison.expect("compared").to_string();
    assert!(said.contains("are they in cGy/h for 1 U?"), "{said}");
}
