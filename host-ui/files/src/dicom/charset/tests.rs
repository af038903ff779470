//! Texts of every kind of character set, against what pydicom and the standard's examples give.

use super::*;

fn text(terms: &str, bytes: &[u8]) -> Option<String> {
    decoded(bytes, &Sets::of(terms), true)
}

/// Examples of PS3.5, annexes H to K, and single letters of the other sets.
#[test]
fn names_of_the_standard_are_decoded() {
    let yamada = b"Yamada^Tarou=\x1b$B;3ED\x1b(B^\x1b$BB@O:\x1b(B=\x1b$B$d$^$@\x1b(B^\x1b$B$?$m$&\x1b(B";
    assert_eq!(
        text("\\ISO 2022 IR 87", yamada).unwrap(),
        "Yamada^Tarou=山田^太郎=やまだ^たろう"
    );
    let half = b"\xd4\xcf\xc0\xde^\xc0\xdb\xb3=\x1b$B;3ED\x1b(J^\x1b$BB@O:\x1b(J=\x1b$B$d$^$@\x1b(J^\x1b$B$?$m$&\x1b(J";
    assert_eq!(
        text("ISO 2022 IR 13\\ISO 2022 IR 87", half).unwrap(),
        "ﾔﾏﾀﾞ^ﾀﾛｳ=山田^太郎=やまだ^たろう"
    );
    let hong = b"Hong^Gildong=\x1b$)C\xfb\xf3^\x1b$)C\xd1\xce\xd4\xd7=\x1b$)C\xc8\xab^\x1b$)C\xb1\xe6\xb5\xbf";
    assert_eq!(text("\\ISO 2022 IR 149", hong).unwrap(), "Hong^Gildong=洪^吉洞=홍^길동");
    let zhang = b"Zhang^XiaoDong=\x1b$)A\xd5\xc5^\x1b$)A\xd0\xa1\xb6\xab=";
    assert_eq!(text("\\ISO 2022 IR 58", zhang).unwrap(), "Zhang^XiaoDong=张^小东=");
    let wang = "Wang^XiaoDong=王^小东=";
    assert_eq!(text("ISO_IR 192", wang.as_bytes()).unwrap(), wang);
    let gb = b"Wang^XiaoDong=\xcd\xf5^\xd0\xa1\xb6\xab=";
    assert_eq!(text("GB18030", gb).unwrap(), wang);
    assert_eq!(text("GBK", gb).unwrap(), wang);
    let mixed = b"Buc^J\xe9r\xf4me=\x1b-L\xbb\xee\xda^\x1b-F\xc4\xe9\xef";
    assert_eq!(
        text("ISO 2022 IR 100\\ISO 2022 IR 144\\ISO 2022 IR 126", mixed).unwrap(),
        "Buc^Jérôme=Люк^Διο"
    );
    for (terms, byte, letter) in [
        ("ISO_IR 101", 0xf8, "ř"),
        ("ISO_IR 109", 0xb1, "ħ"),
        ("ISO_IR 110", 0xbf, "ŋ"),
        ("ISO_IR 127", 0xe2, "ق"),
        ("ISO_IR 138", 0xf9, "ש"),
        ("ISO_IR 148", 0xfd, "ı"),
        ("ISO_IR 148", 0xf0, "ğ"),
        ("ISO_IR 166", 0xca, "ส"),
        ("ISO_IR 203", 0xa4, "€"),
    ] {
        assert_eq!(text(terms, &[byte]).as_deref(), Some(letter), "{terms}");
    }
}

/// Guards against names that were read in a set which the file does not declare.
#[test]
fn letters_outside_of_the_declared_sets_are_refused() {
    assert_eq!(text("", b"M\xfcller"), None);
    assert_eq!(text("ISO_IR 999", b"M\xfcller"), None);
    assert_eq!(text("ISO_IR 192", b"M\xfcller"), None);
    assert_eq!(text("ISO_IR 100", b"M\x9cller"), None);
    assert_eq!(text("\\ISO 2022 IR 149", b"\x1b$)C\xfb^"), None);
    assert_eq!(text("ISO_IR 100", b"\x1b%Gx"), None);
    // No letter beyond ASCII, so nothing can be wrong.
    assert_eq!(text("ISO_IR 999", b"Miller").as_deref(), Some("Miller"));
    // A delimiter ends a set; in a structure's name these are letters.
    assert_eq!(text("\\ISO 2022 IR 100", b"\x1b-A\xfc^\xfc"), None);
    let name = decoded(b"\x1b-A\xfc^\xfc", &Sets::of("\\ISO 2022 IR 100"), false);
    assert_eq!(name.as_deref(), Some("ü^ü"));
}
