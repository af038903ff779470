//! The text before the data of an NRRD file, checked field by field; every problem is reported.

use super::super::element::{Element, Endian, parsed, short};
use super::{Pairs, element};
use crate::error::{ContentError, invalid};

/// Largest header; Slicer keeps much in it, but not more.
const MAX_HEADER_BYTES: usize = 4 << 20;
const MAX_DIMENSION: usize = 4;
const MAX_PROBLEMS: usize = 8;
/// Fields without information on place or content of the labels.
const UNUSED: [&str; 16] = [
    "content",
    "number",
    "min",
    "max",
    "old min",
    "oldmin",
    "old max",
    "oldmax",
    "block size",
    "blocksize",
    "thicknesses",
    "labels",
    "units",
    "sample units",
    "sampleunits",
    "measurement frame",
];

/// Description of one axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Axis {
    Direction([f64; 3]),
    Spacing(f64),
    /// Not a spatial axis, such as that of a list.
    None,
}

#[derive(Debug)]
pub struct Header {
    pub element: Element,
    pub encoding: String,
    pub endian: Option<Endian>,
    /// Sizes; the first axis runs fastest.
    pub sizes: Vec<u64>,
    pub axes: Vec<Axis>,
    /// Name of the space, lower case.
    pub space: Option<String>,
    pub origin: Option<[f64; 3]>,
    /// Units of the three axes of the space.
    pub units_m: [f64; 3],
    pub kinds: Vec<String>,
    pub data_file: Option<String>,
    pub line_skip: usize,
    /// Number of bytes to skip; -1 if the data are the end of the file.
    pub byte_skip: i64,
    pub pairs: Pairs,
}

impl Header {
    /// Parses the header; also returns the bytes behind it.
    pub fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), ContentError> {
        let (lines, rest) = lines(bytes)?;
        let mut fields: Vec<(String, &str)> = Vec::new();
        let mut pairs = Pairs::new();
        let mut problems = Vec::new();
        for line in lines.iter().skip(1).filter(|l| !l.starts_with('#')) {
            let field = line.split_once(": ").or_else(|| line.split_once(':'));
            match (line.split_once(":="), field) {
                (Some((key, value)), Some((name, _))) if key.len() <= name.len() => {
                    pairs.insert(key.to_owned(), value.to_owned());
                }
                (_, Some((name, value))) => {
                    let name = name.trim().to_ascii_lowercase();
                    if fields.iter().any(|(n, _)| *n == name) {
                        problems.push(format!("the field \"{}\" is there twice", short(&name)));
                    }
                    fields.push((name, value.trim()));
                }
                _ => problems.push(format!("the line \"{}\" is neither a field nor a comment", short(line))),
            }
            if problems.len() >= MAX_PROBLEMS {
                break;
            }
        }
        let mut reader = Fields { fields, problems };
        let header = build(&mut reader, pairs);
        ContentError::all(reader.problems)?;
        header
            .map(|h| (h, rest))
            .ok_or_else(|| "its header is not complete".into())
    }

    /// Returns which of its axes are spatial.
    pub fn space_axes(&self) -> Result<[usize; 3], ContentError> {
        if self.sizes.len() == 3 {
            return Ok([0, 1, 2]);
        }
        let in_space: Vec<usize> = (0..self.sizes.len())
            .filter(|&a| !matches!(self.axes.get(a), None | Some(Axis::None)))
            .collect();
        in_space.try_into().map_err(|_| {
            invalid!(
                "it has {} axes ({:?}) and does not say which three are those of space; save one volume of it",
                self.sizes.len(),
                self.sizes
            )
        })
    }
}

/// Returns the lines up to the first empty one.
fn lines(bytes: &[u8]) -> Result<(Vec<&str>, &[u8]), ContentError> {
    let (mut lines, mut end) = (Vec::new(), 0);
    for line in bytes[..bytes.len().min(MAX_HEADER_BYTES)].split_inclusive(|&b| b == b'\n') {
        end += line.len();
        let line = std::str::from_utf8(line).map_err(|_| "its header is not text; copy or export it again")?;
        match line.trim_end_matches(['\r', '\n']) {
            "" => return Ok((lines, &bytes[end..])),
            line => lines.push(line),
        }
    }
    // A detached header may just end.
    if end < bytes.len() || lines.is_empty() {
        return Err("its header has no end; copy or export it again".into());
    }
    Ok((lines, &[]))
}

struct Fields<'a> {
    fields: Vec<(String, &'a str)>,
    problems: Vec<String>,
}

impl<'a> Fields<'a> {
    fn take(&mut self, names: &[&str]) -> Option<&'a str> {
        let at = self.fields.iter().position(|(n, _)| names.contains(&n.as_str()))?;
        Some(self.fields.swap_remove(at).1)
    }

    /// Reads a field; reports one that is not as expected.
    fn read<T>(&mut self, names: &[&str], expected: &str, parse: impl FnOnce(&str) -> Option<T>) -> Option<T> {
        let text = self.take(names)?;
        let value = parse(text);
        if value.is_none() {
            let why = format!("{}: \"{}\" is not {expected}", names[0], short(text));
            self.problems.push(why);
        }
        value
    }

    /// Like [`Fields::read`]; reports a missing field, too.
    fn needed<T>(&mut self, name: &str, expected: &str, parse: impl FnOnce(&str) -> Option<T>) -> Option<T> {
        if !self.fields.iter().any(|(n, _)| n == name) {
            self.problems.push(format!("the field \"{name}\" is missing"));
        }
        self.read(&[name], expected, parse)
    }
}

fn build(r: &mut Fields, pairs: Pairs) -> Option<Header> {
    let element = r.needed("type", "a type of whole numbers", |text| {
        element(&text.to_ascii_lowercase())
    });
    let dimension = r.needed("dimension", "3, or 4 with layers of segments", |text| {
        text.parse().ok().filter(|d| (3..=MAX_DIMENSION).contains(d))
    });
    let fits = |count: usize| dimension.is_none_or(|dimension| dimension == count);
    let all = |what: &str| format!("{} {what}", dimension.unwrap_or_default());
    let encoding = r.needed("encoding", "an encoding", |text| Some(text.to_ascii_lowercase()));
    let endian = r.read(&["endian"], "\"little\" or \"big\"", |text| {
        match text.to_ascii_lowercase().as_str() {
            "little" => Some(Endian::Little),
            "big" => Some(Endian::Big),
            _ => None,
        }
    });
    let sizes = r.needed("sizes", &all("whole numbers"), |text| {
        parsed(text).filter(|sizes: &Vec<u64>| fits(sizes.len()))
    });
    let space = r.take(&["space"]).map(str::to_ascii_lowercase);
    r.read(&["space dimension"], "3", |text| (text == "3").then_some(()));
    let spacings = r.read(&["spacings"], &all("numbers"), |text| {
        let axis = |s: f64| if s.is_nan() { Axis::None } else { Axis::Spacing(s) };
        let spacings = parsed(text).filter(|spacings| fits(spacings.len()))?;
        Some(spacings.into_iter().map(axis).collect())
    });
    let directions = r.read(
        &["space directions"],
        &all("vectors such as (1,0,0), or none"),
        |text| {
            let directions = vectors(text).filter(|vectors| fits(vectors.len()))?;
            Some(
                directions
                    .into_iter()
                    .map(|v| v.map_or(Axis::None, Axis::Direction))
                    .collect(),
            )
        },
    );
    let origin = r.read(&["space origin"], "one vector such as (0,0,0)", |text| {
        match vectors(text)?.as_slice() {
            [origin] => *origin,
            _ => None,
        }
    });
    let units_m = r.read(&["space units"], "three of \"mm\", \"cm\", \"m\", \"um\"", units);
    let kinds = words(r.take(&["kinds"]).unwrap_or_default());
    // Nodes would lie half a voxel beside the cells.
    r.read(
        &["centers", "centerings"],
        "cell: save it with cell centering",
        |text| {
            let is_node = |word: &String| word.eq_ignore_ascii_case("node");
            (!words(text).iter().any(is_node)).then_some(())
        },
    );
    let data_file = r.take(&["data file", "datafile"]).map(str::to_owned);
    let whole = |text: &str, least: i64| text.parse().ok().filter(|n| (least..=1 << 40).contains(n));
    let line_skip = r.read(&["line skip", "lineskip"], "a whole number from 0", |text| {
        whole(text, 0)
    });
    let byte_skip = r.read(&["byte skip", "byteskip"], "a whole number from -1", |text| {
        whole(text, -1)
    });
    r.fields.retain(|(name, _)| !UNUSED.contains(&name.as_str()));
    let unknown = r
        .fields
        .iter()
        .map(|(name, _)| format!("the field \"{}\" is not read", short(name)));
    r.problems.extend(unknown);
    Some(Header {
        element: element?,
        encoding: encoding?,
        endian,
        sizes: sizes?,
        axes: directions.or(spacings).unwrap_or_default(),
        space,
        origin,
        units_m: units_m.unwrap_or([1e-3; 3]),
        kinds,
        data_file,
        line_skip: line_skip.unwrap_or_default() as usize,
        byte_skip: byte_skip.unwrap_or_default(),
        pairs,
    })
}

/// Parses vectors; `none` and vectors of NaN are not spatial axes.
fn vectors(text: &str) -> Option<Vec<Option<[f64; 3]>>> {
    let mut all = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            all.push(None);
            rest = after.trim_start();
            continue;
        }
        let (inside, after) = rest.strip_prefix('(')?.split_once(')')?;
        let numbers: Option<Vec<f64>> = inside.split(',').map(|n| n.trim().parse().ok()).collect();
        let vector: [f64; 3] = numbers?.try_into().ok()?;
        all.push((!vector.iter().all(|v| v.is_nan())).then_some(vector));
        rest = after.trim_start();
    }
    Some(all)
}

fn units(text: &str) -> Option<[f64; 3]> {
    let unit = |word: &String| match word.to_ascii_lowercase().as_str() {
        "mm" | "millimeter" | "millimetre" | "" => Some(1e-3),
        "cm" => Some(1e-2),
        "m" => Some(1.0),
        "um" | "\u{b5}m" | "micron" | "microns" => Some(1e-6),
        _ => None,
    };
    let units: Option<Vec<f64>> = words(text).iter().map(unit).collect();
    units?.try_into().ok()
}

/// Splits words with or without quotation marks.
fn words(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        let (word, after) = match rest.strip_prefix('"').and_then(|r| r.split_once('"')) {
            Some((quoted, after)) => (quoted, after),
            None => rest.split_once(char::is_whitespace).unwrap_or((rest, "")),
        };
        all.push(word.to_owned());
        rest = after.trim_start();
    }
    all
}
