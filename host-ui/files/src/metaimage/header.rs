//! The lines before the data of a MetaImage file, checked; every problem is reported.

use super::super::element::{Element, Endian, parsed, short};
use crate::error::ContentError;
use nalgebra::Matrix3;
use std::collections::BTreeMap;
use std::str::FromStr;

const MAX_HEADER_BYTES: usize = 1 << 20;

#[derive(Debug)]
pub struct Header {
    pub sizes: [u64; 3],
    pub element: Element,
    pub endian: Endian,
    pub binary: bool,
    pub compressed: bool,
    /// Directions in LPS, one axis a column.
    pub directions: Option<Matrix3<f64>>,
    pub letters: Option<String>,
    pub origin_mm: [f64; 3],
    pub spacing_mm: [f64; 3],
    /// Number of bytes before the data; -1 if the data are the end of the file.
    pub header_bytes: i64,
    pub data_file: String,
}

impl Header {
    /// Parses the header; also returns the bytes behind it.
    pub fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), ContentError> {
        let mut fields: BTreeMap<&str, &str> = BTreeMap::new();
        let mut problems = Vec::new();
        let mut rest = bytes;
        // The data begin behind this line.
        while !fields.contains_key("ElementDataFile") {
            let end = rest.iter().take(MAX_HEADER_BYTES).position(|&b| b == b'\n');
            let (line, after) = match end {
                Some(end) => (&rest[..end], &rest[end + 1..]),
                None => (&rest[..rest.len().min(MAX_HEADER_BYTES)], &[][..]),
            };
            let line = std::str::from_utf8(line)
                .map_err(|_| "its header is not text; copy or export it again")?
                .trim();
            let Some((key, value)) = line.split_once('=') else {
                return Err(if line.is_empty() && after.is_empty() {
                    "it is truncated: its header has no ElementDataFile; copy or export it again".into()
                } else {
                    format!("the line \"{}\" of its header has no \"=\"", short(line)).into()
                });
            };
            if fields.insert(key.trim(), value.trim()).is_some() && key.trim() != "Comment" {
                problems.push(format!("{} is there twice", short(key.trim())));
            }
            if bytes.len() - after.len() > MAX_HEADER_BYTES {
                return Err("its header has no end; copy or export it again".into());
            }
            rest = after;
        }
        let mut reader = Fields { fields, problems };
        let header = build(&mut reader);
        ContentError::all(reader.problems)?;
        header
            .map(|h| (h, rest))
            .ok_or_else(|| "its header is not complete".into())
    }
}

struct Fields<'a> {
    fields: BTreeMap<&'a str, &'a str>,
    problems: Vec<String>,
}

impl<'a> Fields<'a> {
    fn get(&self, names: &[&str]) -> Option<&'a str> {
        names.iter().find_map(|n| self.fields.get(n)).copied()
    }

    /// Reads a field; reports one that is not as expected.
    fn read<T>(&mut self, names: &[&str], expected: &str, parse: impl FnOnce(&str) -> Option<T>) -> Option<T> {
        let text = self.get(names)?;
        let differs = |name: &&&str| self.fields.get(**name).is_some_and(|other| *other != text);
        if let Some(other) = names.iter().find(differs) {
            let why = format!(
                "{other} says otherwise than its synonym, \"{}\"; keep one of both",
                short(text)
            );
            self.problems.push(why);
        }
        let value = parse(text);
        if value.is_none() {
            let why = format!("{} is \"{}\"; it must be {expected}", names[0], short(text));
            self.problems.push(why);
        }
        value
    }

    /// Like [`Fields::read`]; reports a missing field, too.
    fn needed<T>(&mut self, names: &[&str], expected: &str, parse: impl FnOnce(&str) -> Option<T>) -> Option<T> {
        if self.get(names).is_none() {
            let why = format!("{} is missing; it must be {expected}", names[0]);
            self.problems.push(why);
        }
        self.read(names, expected, parse)
    }

    fn yes(&mut self, names: &[&str]) -> Option<bool> {
        self.read(names, "True or False", |text| {
            match text.to_ascii_lowercase().as_str() {
                "true" | "t" | "1" => Some(true),
                "false" | "f" | "0" => Some(false),
                _ => None,
            }
        })
    }
}

fn exactly<T: FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    parsed(text)?.try_into().ok()
}

fn build(r: &mut Fields) -> Option<Header> {
    let is = |expected: &'static str| move |text: &str| text.eq_ignore_ascii_case(expected).then_some(());
    r.read(&["ObjectType"], "Image", is("Image"));
    r.needed(&["NDims"], "3", is("3"));
    let sizes = r.needed(&["DimSize"], "3 whole numbers", exactly);
    let element = r.needed(&["ElementType"], "a type of whole numbers such as MET_UCHAR", element);
    r.read(&["ElementNumberOfChannels"], "1: labels are single numbers", is("1"));
    let is_big = r.yes(&["ElementByteOrderMSB", "BinaryDataByteOrderMSB"]);
    let matrix = r.read(&["TransformMatrix", "Orientation", "Rotation"], "9 numbers", exactly);
    let origin_mm = r.read(&["Offset", "Position", "Origin"], "3 numbers", exactly);
    let spacing_mm = r.needed(&["ElementSpacing", "ElementSize"], "3 numbers", exactly);
    let header_bytes = r.read(&["HeaderSize"], "a whole number from -1", |text| {
        text.parse().ok().filter(|n| (-1..=1 << 40).contains(n))
    });
    let binary = r.yes(&["BinaryData"]).unwrap_or(true);
    let compressed = r.yes(&["CompressedData"]).unwrap_or(false);
    let data_file = r.get(&["ElementDataFile"]).unwrap_or_default().to_owned();
    if data_file.starts_with("LIST") || data_file.contains(['%', '*']) {
        r.problems
            .push("its data are in several files; write it as one .mha file".to_owned());
    }
    let letters = r
        .get(&["AnatomicalOrientation"])
        .filter(|l| !l.contains('?'))
        .map(str::to_owned);
    Some(Header {
        sizes: sizes?,
        element: element?,
        endian: match is_big {
            Some(true) => Endian::Big,
            _ => Endian::Little,
        },
        binary,
        compressed,
        // Each three of them are an axis.
        directions: matrix.map(|m: [f64; 9]| Matrix3::from_column_slice(&m)),
        letters,
        origin_mm: origin_mm.unwrap_or_default(),
        spacing_mm: spacing_mm?,
        header_bytes: header_bytes.unwrap_or_default(),
        data_file,
    })
}

fn element(name: &str) -> Option<Element> {
    Some(match name {
        "MET_CHAR" | "MET_ASCII_CHAR" => Element::I8,
        "MET_UCHAR" => Element::U8,
        "MET_SHORT" => Element::I16,
        "MET_USHORT" => Element::U16,
        // A long has four bytes here, on any machine.
        "MET_INT" | "MET_LONG" => Element::I32,
        "MET_UINT" | "MET_ULONG" => Element::U32,
        "MET_LONG_LONG" => Element::I64,
        "MET_ULONG_LONG" => Element::U64,
        "MET_FLOAT" => Element::F32,
        "MET_DOUBLE" => Element::F64,
        _ => return None,
    })
}
