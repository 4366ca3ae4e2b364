//! The text at the start of a PLY file: its encoding and the layout of its elements.

use crate::fault::{Fault, Parsed};

/// Longest header read, bytes.
const LONGEST_HEADER: usize = 1 << 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layout {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) layout: Layout,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// The fewest bytes that one row can take: empty lists; in ascii a digit and a separator a number.
    pub(super) fn smallest_row(&self, encoding: Encoding) -> usize {
        let size = |property: &Property| match (encoding, property.layout) {
            (Encoding::Ascii, _) => 2,
            (_, Layout::Scalar(scalar)) => scalar.size(),
            (_, Layout::List { count, .. }) => count.size(),
        };
        self.properties.iter().map(size).sum()
    }

    pub(super) fn property(&self, name: &str) -> Option<&Property> {
        self.properties.iter().find(|p| p.name == name)
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// From `comment TextureFile NAME`.
    pub(super) texture_file: Option<String>,
    /// Where the body starts, bytes.
    pub(super) length: usize,
}

pub(super) fn parse_header(bytes: &[u8]) -> Parsed<Header> {
    let mut lines = Lines { bytes: &bytes[..bytes.len().min(LONGEST_HEADER)], position: 0, number: 0 };
    if lines.next_line()? != "ply" {
        return Err(Fault::new("line 1", "something else", "`ply`"));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut texture_file = None;
    loop {
        let line = lines.next_line()?;
        let place = format!("line {}", lines.number);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            [] | ["obj_info", ..] => {}
            ["comment", "TextureFile", ..] => {
                texture_file = line.split_once("TextureFile").map(|(_, name)| name.trim().to_owned());
            }
            ["comment", ..] => {}
            ["format", name, "1.0"] if encoding.is_none() => {
                encoding = Some(match name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => return Err(Fault::new(place, name, "ascii, binary_little_endian or binary_big_endian")),
                });
            }
            ["element", name, count] => {
                let count =
                    count.parse().map_err(|_| Fault::new(&place, format!("count {count:?}"), "a whole number"))?;
                if elements.iter().any(|e| e.name == name) {
                    return Err(Fault::new(place, format!("a second element {name:?}"), "each element once"));
                }
                elements.push(Element { name: name.into(), count, properties: Vec::new() });
            }
            ["property", "list", count, item, name] => {
                let layout = Layout::List { count: scalar(&place, count)?, item: scalar(&place, item)? };
                add_property(&mut elements, place, name, layout)?;
            }
            ["property", kind, name] => {
                let layout = Layout::Scalar(scalar(&place, kind)?);
                add_property(&mut elements, place, name, layout)?;
            }
            ["end_header"] => break,
            _ => return Err(Fault::new(place, format!("{line:?}"), "format, element, property or end_header")),
        }
    }
    if let Some(empty) = elements.iter().find(|e| e.count > 0 && e.properties.is_empty()) {
        return Err(Fault::new(format!("element {:?}", empty.name), "without properties", "at least one property"));
    }
    let encoding = encoding.ok_or_else(|| Fault::new("the header", "without a format", "`format ... 1.0`"))?;
    Ok(Header { encoding, elements, texture_file, length: lines.position })
}

fn scalar(place: &str, name: &str) -> Parsed<Scalar> {
    Scalar::named(name).ok_or_else(|| Fault::new(place, format!("type {name:?}"), "char to double or int8 to float64"))
}

fn add_property(elements: &mut [Element], place: String, name: &str, layout: Layout) -> Parsed<()> {
    let Some(element) = elements.last_mut() else {
        return Err(Fault::new(place, "a property", "an element first"));
    };
    if element.property(name).is_some() {
        return Err(Fault::new(place, format!("a second property {name:?}"), "each property once"));
    }
    if let Layout::List { count, .. } = layout
        && !count.is_integer()
    {
        return Err(Fault::new(place, "a list counted by real numbers", "an integer count"));
    }
    element.properties.push(Property { name: name.into(), layout });
    Ok(())
}

struct Lines<'a> {
    bytes: &'a [u8],
    position: usize,
    number: usize,
}

impl<'a> Lines<'a> {
    fn next_line(&mut self) -> Parsed<&'a str> {
        self.number += 1;
        let rest = &self.bytes[self.position..];
        let place = || format!("line {}", self.number);
        let end = rest
            .iter()
            .position(|&b| b == b'\n')
            .ok_or_else(|| Fault::new(place(), "the end of the file", "a header closed by end_header"))?;
        self.position += end + 1;
        let line = std::str::from_utf8(&rest[..end]).map_err(|_| Fault::new(place(), "not text", "a header line"))?;
        Ok(line.trim_end())
    }
}
