//! The text before the data of an NRRD file, checked field by field; every problem is reported.

use super::super::element::{Element, Endian, short};
use super::{Pairs, element};
use crate::error::ContentError;

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
            ContentError::Invalid(format!(
                "it has {} axes ({:?}) and does not say which three are those of space; save one volume of it",
                self.sizes.len(),
                self.sizes
            ))
        })
    }
}

/// Returns the lines up to the first empty one.
fn lines(bytes: &[u8]) -> Result<(Vec<&str>, &[u8]), ContentError> {
    let (mut lines, mut rest) = (Vec::new(), bytes);
    loop {
        let Some(end) = rest.iter().take(MAX_HEADER_BYTES).position(|&b| b == b'\n') else {
            // A detached header may just end.
            if rest.len() < MAX_HEADER_BYTES && !lines.is_empty() {
                if !rest.is_empty() {
                    lines.push(text(rest)?);
                }
                return Ok((lines, &[]));
            }
            return Err(ContentError::Invalid(
                "its header has no end; copy or export it again".to_owned(),
            ));
        };
        let line = text(&rest[..end])?;
        rest = &rest[end + 1..];
        if line.is_empty() {
            return Ok((lines, rest));
        }
        lines.push(line);
        if bytes.len() - rest.len() > MAX_HEADER_BYTES {
            return Err(ContentError::Invalid(
                "its header has no end; copy or export it again".to_owned(),
            ));
        }
    }
}

fn text(line: &[u8]) -> Result<&str, ContentError> {
    std::str::from_utf8(line)
        .map(|l| l.trim_end_matches('\r'))
        .map_err(|_| "its header is not text; copy or export it again".into())
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

    fn needed(&mut self, names: &[&str]) -> &'a str {
        self.take(names).unwrap_or_else(|| {
            self.problems.push(format!("the field \"{}\" is missing", names[0]));
            ""
        })
    }

    fn wrong(&mut self, field: &str, value: &str, expected: &str) {
        self.problems
            .push(format!("{field}: \"{}\" is not {expected}", short(value)));
    }
}

fn build(r: &mut Fields, pairs: Pairs) -> Option<Header> {
    let type_name = r.needed(&["type"]).to_ascii_lowercase();
    let element = element(&type_name);
    if element.is_none() && !type_name.is_empty() {
        r.wrong("type", &type_name, "a type of whole numbers");
    }
    let dimension = r.needed(&["dimension"]);
    let dimension: usize = dimension
        .parse()
        .ok()
        .filter(|d| (3..=MAX_DIMENSION).contains(d))
        .unwrap_or_else(|| {
            if !dimension.is_empty() {
                r.wrong("dimension", dimension, "3, or 4 with layers of segments");
            }
            0
        });
    let encoding = r.needed(&["encoding"]).to_ascii_lowercase();
    let endian = match r.take(&["endian"]).map(str::to_ascii_lowercase).as_deref() {
        None => None,
        Some("little") => Some(Endian::Little),
        Some("big") => Some(Endian::Big),
        Some(other) => {
            r.wrong("endian", other, "\"little\" or \"big\"");
            None
        }
    };
    let sizes = sizes(r, dimension);
    let space = r.take(&["space"]).map(str::to_ascii_lowercase);
    if let Some(text) = r.take(&["space dimension"])
        && text != "3"
    {
        r.wrong("space dimension", text, "3");
    }
    let axes = axes(r, dimension);
    let origin = r.take(&["space origin"]).and_then(|text| {
        let origin = vectors(text).filter(|v| v.len() == 1).and_then(|v| v[0]);
        if origin.is_none() {
            r.wrong("space origin", text, "one vector such as (0,0,0)");
        }
        origin
    });
    let units_m = units(r);
    let kinds = words(r.take(&["kinds"]).unwrap_or_default());
    if r.take(&["centers", "centerings"])
        .is_some_and(|c| words(c).iter().any(|w| w.eq_ignore_ascii_case("node")))
    {
        r.problems
            .push("its samples are at nodes and not in cells; save it with cell centering".to_owned());
    }
    let data_file = r.take(&["data file", "datafile"]).map(str::to_owned);
    let line_skip = whole(r, &["line skip", "lineskip"], 0).unwrap_or_default() as usize;
    let byte_skip = whole(r, &["byte skip", "byteskip"], -1).unwrap_or_default();
    for name in ["axis mins", "axismins", "axis maxs", "axismaxs"] {
        // Another way to place the volume, which nobody uses for patients.
        if let Some(text) = r.take(&[name])
            && words(text).iter().any(|w| !w.eq_ignore_ascii_case("nan"))
        {
            r.problems.push(format!(
                "\"{name}\" is not read; save the volume with \"space directions\""
            ));
        }
    }
    r.fields.retain(|(name, _)| !UNUSED.contains(&name.as_str()));
    let unknown: Vec<String> = r
        .fields
        .iter()
        .map(|(name, _)| format!("\"{}\" is not a field of NRRD", short(name)))
        .collect();
    r.problems.extend(unknown);
    Some(Header {
        element: element?,
        encoding,
        endian,
        sizes,
        axes,
        space,
        origin,
        units_m,
        kinds,
        data_file,
        line_skip,
        byte_skip,
        pairs,
    })
}

fn sizes(r: &mut Fields, dimension: usize) -> Vec<u64> {
    let text = r.needed(&["sizes"]);
    let sizes: Option<Vec<u64>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
    match sizes {
        Some(sizes) if sizes.len() == dimension || dimension == 0 => sizes,
        _ => {
            r.wrong("sizes", text, &format!("{dimension} whole numbers"));
            Vec::new()
        }
    }
}

fn axes(r: &mut Fields, dimension: usize) -> Vec<Axis> {
    let spacings = r.take(&["spacings"]);
    if let Some(text) = r.take(&["space directions"]) {
        return match vectors(text).filter(|v| v.len() == dimension || dimension == 0) {
            Some(vectors) => vectors
                .into_iter()
                .map(|v| v.map_or(Axis::None, Axis::Direction))
                .collect(),
            None => {
                r.wrong(
                    "space directions",
                    text,
                    &format!("{dimension} vectors such as (1,0,0), or none"),
                );
                Vec::new()
            }
        };
    }
    let Some(text) = spacings else {
        return Vec::new();
    };
    let spacings: Option<Vec<f64>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
    match spacings {
        Some(all) if all.len() == dimension || dimension == 0 => {
            let axis = |s: f64| if s.is_nan() { Axis::None } else { Axis::Spacing(s) };
            all.into_iter().map(axis).collect()
        }
        _ => {
            r.wrong("spacings", text, &format!("{dimension} numbers"));
            Vec::new()
        }
    }
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

fn units(r: &mut Fields) -> [f64; 3] {
    let Some(text) = r.take(&["space units"]) else {
        return [1e-3; 3];
    };
    let units: Option<Vec<f64>> = words(text)
        .iter()
        .map(|w| match w.to_ascii_lowercase().as_str() {
            "mm" | "millimeter" | "millimetre" | "" => Some(1e-3),
            "cm" => Some(1e-2),
            "m" => Some(1.0),
            "um" | "\u{b5}m" | "micron" | "microns" => Some(1e-6),
            _ => None,
        })
        .collect();
    units.and_then(|u| <[f64; 3]>::try_from(u).ok()).unwrap_or_else(|| {
        r.wrong("space units", text, "three of \"mm\", \"cm\", \"m\", \"um\"");
        [1e-3; 3]
    })
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

fn whole(r: &mut Fields, names: &[&str], least: i64) -> Option<i64> {
    let text = r.take(names)?;
    let number = text.parse().ok().filter(|n| (least..=1 << 40).contains(n));
    if number.is_none() {
        r.wrong(names[0], text, &format!("a whole number from {least}"));
    }
    number
}
