//! Headers written by hand, good and broken.

use super::*;
use crate::Progress;

fn read(bytes: &[u8], data_file: DataReader) -> Result<Voxels, ContentError> {
    super::read(bytes, data_file, Sink::labels(&Progress::default()))
}

fn no_file(name: &str) -> Result<Vec<u8>, ContentError> {
    Err(format!("no file {name}").into())
}

const GOOD: &str = "NRRD0004\ntype: uchar\ndimension: 3\nspace: RAS\nsizes: 2 2 1\n\
                    space directions: (1,0,0) (0,2,0) (0,0,3)\nencoding: text\nspace origin: (1,2,3)\n\n0 1 2 3\n";

fn with(from: &str, to: &str) -> Vec<u8> {
    assert!(GOOD.contains(from), "{from}");
    GOOD.replace(from, to).into_bytes()
}

fn why(bytes: &[u8]) -> String {
    read(bytes, &no_file).map(|v| v.dims).expect_err("refused").to_string()
}

#[test]
fn text_and_raw_hold_the_same_labels() {
    let good = read(GOOD.as_bytes(), &no_file).unwrap();
    assert_eq!(
        (good.labels.as_slice(), good.dims),
        ([0, 1, 2, 3].as_slice(), [2, 2, 1])
    );
    assert_eq!(good.frame.spacing_m, [1e-3, 2e-3, 3e-3]);
    assert_eq!(good.frame.origin_m, Vector3::new(1e-3, 2e-3, 3e-3));
    let head = String::from_utf8(with("encoding: text", "encoding: raw\nline skip: 1\nbyte skip: 2")).unwrap();
    let mut raw = head.replace("0 1 2 3\n", "a comment\nxx").into_bytes();
    raw.extend([0, 1, 2, 3]);
    assert_eq!(read(&raw, &no_file).unwrap(), good);
    let mut end = String::from_utf8(with("encoding: text", "encoding: raw\nbyte skip: -1"))
        .unwrap()
        .into_bytes();
    end.extend([0, 1, 2, 3]);
    assert_eq!(read(&end, &no_file).unwrap(), good);
    let big = with("uchar", "unsigned short\nendian: big");
    let big = String::from_utf8(big).unwrap().replace("text", "raw");
    let mut big = big.replace("0 1 2 3\n", "").into_bytes();
    big.extend([0, 0, 0, 1, 0, 2, 0, 3]);
    assert_eq!(read(&big, &no_file).unwrap(), good);
}

#[test]
fn each_wrong_header_is_refused_with_its_reason() {
    let mut wrong = Vec::new();
    for (from, to, expected) in [
        (
            "sizes: 2 2 1",
            "sizes: 1000000 1000000 1",
            "claims 1000000 x 1000000 x 1 voxels",
        ),
        ("sizes: 2 2 1", "sizes: 18446744073709551615 9 9", "claims"),
        ("sizes: 2 2 1", "sizes: 2 2 0", "at least 1"),
        ("sizes: 2 2 1", "sizes: 2 2", "3 whole numbers"),
        (
            "sizes: 2 2 1",
            "sizes: 200 200 100",
            "the header requires 4000000 bytes",
        ),
        ("sizes: 2 2 1", "sizes: 2 2 1\nsizes: 2 2 1", "there twice"),
        ("0 1 2 3", "0 1 2", "3 of 4 values"),
        ("0 1 2 3", "0 1 2 3 4", "more than the 4 values"),
        ("0 1 2 3", "0 1 2 300", "the value 300"),
        ("0 1 2 3", "0 1 2 x", "contains \"x\""),
        ("uchar", "block", "a type of whole numbers"),
        ("uchar", "double\nendian: middle", "\"little\" or \"big\""),
        ("encoding: text", "encoding: bz2", "encoding \"bz2\" is not read"),
        ("encoding: text", "encoding: zip", "encoding \"zip\" is not read"),
        ("encoding: text", "encoding: raw", "8 are there"),
        (
            "encoding: text",
            "encoding: text\nfoo: 1",
            "the field \"foo\" is not read",
        ),
        ("encoding: text", "what is this", "neither a field nor a comment"),
        (
            "encoding: text",
            "encoding: text\ndata file: other.raw",
            "no file other.raw",
        ),
        (
            "encoding: text",
            "encoding: text\nspace units: \"inch\" \"mm\" \"mm\"",
            "space units",
        ),
        ("(0,0,3)", "(0,0,nan)", "not a number"),
        ("(0,0,3)", "(0,1,3)", "sheared"),
        ("(0,0,3)", "none", "neither \"space directions\" nor \"spacings\""),
        (
            "space: RAS",
            "space: left-posterior-superior-time",
            "not an anatomical space",
        ),
        (
            "space directions: (1,0,0) (0,2,0) (0,0,3)\n",
            "",
            "neither \"space directions\"",
        ),
        ("encoding: text\n", "", "\"encoding\" is missing"),
        ("dimension: 3", "dimension: 2", "3, or 4 with layers"),
    ] {
        let why = why(&with(from, to));
        if !why.contains(expected) {
            wrong.push(format!("{to}: not {expected:?} in {why}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let two = why(&with("type: uchar\n", "centers: node node node\n"));
    assert!(
        two.contains("2 problems") && two.contains("\"type\" is missing") && two.contains("cell centering"),
        "{two}"
    );
    assert!(why(b"NRRD0004\n\xff\xfe\n\n").contains("not text"));
    assert!(why(b"NRRD0004").contains("\"type\" is missing"));
}

/// Checks a bound: a few bytes of gzip may stand for any size, so unpacking stops at the size in
/// the header.
#[test]
fn packed_data_are_unpacked_no_further_than_the_header_asks() {
    use std::io::Write;
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    packed.write_all(&vec![0; 50_000_000]).unwrap();
    let packed = packed.finish().unwrap();
    let file = |sizes: &str| {
        let head = String::from_utf8(with("text", "gzip"))
            .unwrap()
            .replace("0 1 2 3\n", "");
        let mut file = head.replace("2 2 1", sizes).into_bytes();
        file.extend(&packed);
        file
    };
    assert!(why(&file("2 2 1")).contains("continue beyond"));
    assert!(why(&file("1000 1000 200")).contains("the header requires 200000000 bytes"));
    assert_eq!(read(&file("1000 1000 50"), &no_file).unwrap().labels.len(), 50_000_000);
}

#[test]
fn layers_without_segments_and_segments_that_contradict_are_refused() {
    let four = |more: &str| {
        let head = String::from_utf8(with("dimension: 3", "dimension: 4")).unwrap();
        let head = head
            .replace("sizes: 2 2 1", "sizes: 2 2 2 1")
            .replace("directions: ", "directions: none ");
        head.replace("\n\n0 1 2 3", &format!("{more}\n\n0 0 1 0 1 1 0 1"))
            .into_bytes()
    };
    assert!(why(&four("")).contains("without segments"));
    let layer = |n: usize, value: u8, layer: u8| {
        format!("\nSegment{n}_Name:=s{n}\nSegment{n}_LabelValue:={value}\nSegment{n}_Layer:={layer}")
    };
    assert!(why(&four(&layer(0, 1, 2))).contains("layer 2 of 2"));
    assert!(why(&four(&layer(0, 0, 0))).contains("the background"));
    assert!(why(&four(&format!("{}{}", layer(0, 1, 0), layer(1, 1, 0)))).contains("two segments"));
    let both = format!("{}{}", layer(0, 1, 0), layer(1, 1, 1));
    // Layer 0 holds 0 1 1 0, layer 1 holds 0 0 1 1: for equal sizes, the first gets the common
    // voxels.
    let read = read(&four(&both), &no_file).unwrap();
    assert_eq!(read.labels, [0, 1, 1, 2]);
    // The second loses nothing: its outline and its dose have all of it.
    assert_eq!(read.also, [(2, 2)]);
    assert_eq!((read.of_label(1), read.of_label(2)), (vec![1, 2], vec![2, 3]));
    assert!(
        read.overlap
            .as_deref()
            .is_some_and(|note| note.contains("s1 (1 of 2 voxels)")),
        "{:?}",
        read.overlap
    );
}
