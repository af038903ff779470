//! The lines before the data of a MetaImage file, checked; every problem is reported.

use super::super::element::{Element, Endian, short};
use crate::error::ContentError;
use nalgebra::Matrix3;
use std::collections::BTreeMap;

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
                return Err(ContentError::Invalid(
                    "its header has no end; copy or export it again".to_owned(),
                ));
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

    fn wrong(&mut self, names: &[&str], expected: &str) {
        let value = self
            .get(names)
            .map_or("missing".to_owned(), |v| format!("\"{}\"", short(v)));
        self.problems
            .push(format!("{} is {value}; it must be {expected}", names[0]));
    }

    fn yes(&mut self, names: &[&str], otherwise: bool) -> bool {
        match self.get(names).map(str::to_ascii_lowercase).as_deref() {
            None => otherwise,
            Some("true" | "t" | "1") => true,
            Some("false" | "f" | "0") => false,
            Some(_) => {
                self.wrong(names, "True or False");
                otherwise
            }
        }
    }

    fn numbers<const N: usize>(&mut self, names: &[&str]) -> Option<[f64; N]> {
        let text = self.get(names)?;
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
        let numbers = numbers.and_then(|n| <[f64; N]>::try_from(n).ok());
        if numbers.is_none() {
            self.wrong(names, &format!("{N} numbers"));
        }
        numbers
    }
}

fn build(r: &mut Fields) -> Option<Header> {
    if r.get(&["ObjectType"]).is_some_and(|t| !t.eq_ignore_ascii_case("Image")) {
        r.wrong(&["ObjectType"], "Image");
    }
    if r.get(&["NDims"]) != Some("3") {
        r.wrong(&["NDims"], "3");
    }
    let text = r.get(&["DimSize"]).unwrap_or_default();
    let sizes: Option<Vec<u64>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
    let sizes = sizes.and_then(|s| <[u64; 3]>::try_from(s).ok());
    if sizes.is_none() {
        r.wrong(&["DimSize"], "3 whole numbers");
    }
    let element = r.get(&["ElementType"]).and_then(element);
    if element.is_none() {
        r.wrong(&["ElementType"], "a type of whole numbers such as MET_UCHAR");
    }
    if r.get(&["ElementNumberOfChannels"]).is_some_and(|n| n != "1") {
        r.wrong(&["ElementNumberOfChannels"], "1: labels are single numbers");
    }
    let order = ["ElementByteOrderMSB", "BinaryDataByteOrderMSB"];
    let endian = if r.yes(&order, false) {
        Endian::Big
    } else {
        Endian::Little
    };
    let matrix = r.numbers::<9>(&["TransformMatrix", "Orientation", "Rotation"]);
    let origin_mm = r.numbers(&["Offset", "Position", "Origin"]).unwrap_or_default();
    let sides = ["ElementSpacing", "ElementSize"];
    let spacing_mm = r.numbers(&sides);
    if r.get(&sides).is_none() {
        r.wrong(&sides, "3 numbers");
    }
    let header_bytes = match r.get(&["HeaderSize"]).map(str::parse::<i64>) {
        None => 0,
        Some(Ok(n)) if (-1..=1 << 40).contains(&n) => n,
        Some(_) => {
            r.wrong(&["HeaderSize"], "a whole number from -1");
            0
        }
    };
    let binary = r.yes(&["BinaryData"], true);
    let compressed = r.yes(&["CompressedData"], false);
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
        endian,
        binary,
        compressed,
        // Each three of them are an axis.
        directions: matrix.map(|m| Matrix3::from_column_slice(&m)),
        letters,
        origin_mm,
        spacing_mm: spacing_mm?,
        header_bytes,
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
