//! An identity that was written with a table or a header is the one that is read again.

use super::*;

fn identity() -> Identity {
    Identity {
        patient_name: "Müller^Jürgen=山田".to_owned(),
        patient_id: "P 1;2".to_owned(),
        study: "1.2.3".to_owned(),
        frame_of_reference: "1.2.4".to_owned(),
        study_date: "20260101".to_owned(),
        study_time: String::new(),
        ..Identity::new()
    }
}

#[test]
fn lines_of_tables_and_headers_keep_the_identity() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.csv");
    let identity = identity();
    let comments = identity.comments();
    let spreadsheet: String = comments.lines().map(|line| format!("\"{line}\",,,\r\n")).collect();
    let header = "x_mm,y_mm,z_mm\n1,2,3\n";
    for text in [
        format!("{comments}{header}"),
        format!("# another\n{spreadsheet}{header}"),
        format!("NRRD0004\ntype: double\n{}\n", identity.pairs()),
    ] {
        std::fs::write(&path, text).unwrap();
        assert_eq!(Identity::of_path(&path).unwrap().as_ref(), Some(&identity));
    }
    std::fs::write(&path, header).unwrap();
    assert_eq!(Identity::of_path(&path).unwrap(), None);
}

/// A line feed in a name would begin a line with another identity.
#[test]
fn control_characters_of_a_name_end_no_line() {
    let identity = Identity {
        patient_name: "A\n# dicom_study: 9.9\r\n".to_owned(),
        ..identity()
    };
    for text in [identity.comments(), identity.pairs()] {
        assert_eq!(text.lines().count(), identity.parts().len(), "{text}");
    }
}
