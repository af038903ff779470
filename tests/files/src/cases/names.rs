//! Names in other character sets, and paths without a folder.

use super::objects::{ball, put, put_images, save, save_ct, structure_set};
use super::{Case, Right};
use dicom_dictionary_std::tags;
use std::path::Path;

pub fn cases() -> Vec<Case> {
    [sets(), paths()].into_iter().flatten().collect()
}

/// Makes a structure set whose patient's name has these bytes in this character set.
fn named(set: &'static str, name: &'static [u8]) -> impl Fn(&Path) {
    move |folder| {
        let path = folder.join("rs.dcm");
        let mut object = structure_set(&[("1", "Prostate", ball([0.0; 3], 14.5))]);
        let in_place = "N".repeat(name.len() + name.len() % 2);
        put(&mut object, tags::PATIENT_NAME, &in_place);
        save(&path, object);
        // The writer of this test knows few sets, so the bytes are put where it wrote others.
        let padded = |bytes: &[u8]| [bytes, &b" "[..bytes.len() % 2]].concat();
        let set = padded(set.as_bytes());
        let element = [
            b"\x08\x00\x05\x00CS".as_slice(),
            &(set.len() as u16).to_le_bytes(),
            &set,
        ]
        .concat();
        let bytes = std::fs::read(&path).expect("written");
        let bytes = replaced(&bytes, b"\x08\x00\x05\x00CS\x0a\x00ISO_IR 192", &element);
        std::fs::write(&path, replaced(&bytes, in_place.as_bytes(), &padded(name))).expect("written");
    }
}

fn replaced(bytes: &[u8], old: &[u8], new: &[u8]) -> Vec<u8> {
    let at = bytes
        .windows(old.len())
        .position(|window| window == old)
        .expect("the bytes are there");
    [&bytes[..at], new, &bytes[at + old.len()..]].concat()
}

fn sets() -> Vec<Case> {
    let kind = "Character sets";
    let read = |file, set, name: &'static [u8], right| {
        let right = Right::Holds("labels.nrrd", "dicom_patient_name:=", right);
        Case::new(kind, file, "convert rs.dcm labels.nrrd", right, named(set, name))
    };
    let refused = |file, set, name: &'static [u8], words| {
        Case::new(
            kind,
            file,
            "convert rs.dcm labels.nrrd",
            Right::Refused(words),
            named(set, name),
        )
    };
    vec![
        read(
            "Japanese (`ISO 2022 IR 87`, PS3.5 H.3.1)",
            "\\ISO 2022 IR 87",
            b"Yamada^Tarou=\x1b$B;3ED\x1b(B^\x1b$BB@O:\x1b(B=\x1b$B$d$^$@\x1b(B^\x1b$B$?$m$&\x1b(B",
            "Yamada^Tarou=山田^太郎=やまだ^たろう",
        )
        .before("`...=$B;3ED(B^$BB@O:(B`, as UTF-8 in all files"),
        read(
            "Korean (`ISO 2022 IR 149`, PS3.5 I.2)",
            "\\ISO 2022 IR 149",
            b"Hong^Gildong=\x1b$)C\xfb\xf3^\x1b$)C\xd1\xce\xd4\xd7=\x1b$)C\xc8\xab^\x1b$)C\xb1\xe6\xb5\xbf",
            "Hong^Gildong=洪^吉洞=홍^길동",
        )
        .before("raw escapes"),
        read(
            "Turkish (`ISO_IR 148`)",
            "ISO_IR 148",
            b"\xc7avu\xfeo\xf0lu^I\xfe\xfdl",
            "Çavuşoğlu^Işıl",
        )
        .before("wrong letters"),
        read(
            "Chinese (`GB18030`, PS3.5 J.3)",
            "GB18030",
            b"Wang^XiaoDong=\xcd\xf5^\xd0\xa1\xb6\xab",
            "Wang^XiaoDong=王^小东",
        ),
        read(
            "Greek and Latin by escapes (`ISO 2022 IR 100`, `ISO 2022 IR 126`)",
            "ISO 2022 IR 100\\ISO 2022 IR 126",
            b"Ren\xe9^\x1b-F\xc4\xe9\xef\xed\xf5\xf3\xe9\xef\xf2",
            "René^Διονυσιος",
        ),
        read(
            "Cyrillic (`ISO_IR 144`)",
            "ISO_IR 144",
            b"\xb8\xd2\xd0\xdd\xde\xd2^\xbf\xf1\xe2\xe0",
            "Иванов^Пётр",
        ),
        refused(
            "a set that DICOM does not define",
            "ISO_IR 999",
            b"M\xfcller",
            "SpecificCharacterSet",
        ),
        refused(
            "letters beyond ASCII without a set",
            "ISO_IR 6",
            b"M\xfcller",
            "PatientName",
        ),
        refused("half a letter of UTF-8", "ISO_IR 192", b"M\xc3", "PatientName"),
    ]
}

fn paths() -> Vec<Case> {
    let kind = "Paths without a folder";
    let make = |folder: &Path| {
        let mut set = structure_set(&[("1", "Prostate", ball([0.0; 3], 14.5))]);
        let heights: Vec<f64> = (-8..=8).map(|k| f64::from(k) * 2.5).collect();
        put_images(&mut set, &save_ct(folder, &heights));
        save(&folder.join("rs.dcm"), set);
        let seeds = "x_mm,y_mm,z_mm,strength_u\n0,0,0,0.5\n";
        std::fs::write(folder.join("seeds.csv"), seeds).expect("written");
    };
    // The grid of the images: 64 x 64 pixels, 17 slices.
    let case = |file, commands, words| Case::new(kind, file, commands, Right::Says(words), make);
    vec![
        Case::new(kind, "`rs.dcm` beside its images", "convert rs.dcm labels.nrrd", Right::Holds("labels.nrrd", "sizes:", " 128 128 17"), make)
            .before("\"its images are not beside it\", another grid"),
        case("a slice of a CT", "scene check rs.dcm", &["Prostate"]).shows(&["Prostate ("]),
        Case::new(
            kind,
            "`rs.dcm` for a study",
            "dicom --source source --seeds seeds.csv --structures rs.dcm --out out; convert out/structure_set.dcm labels.nrrd",
            Right::Says(&[]),
            make,
        )
        .before("a structure set without images"),
        Case::new(kind, "one file of a series, without seeds", "find-seeds 000.dcm --out out", Right::Refused("brighter"), make),
    ]
}
