//! The text at the start of a PLY file: its encoding and the layout of its elements.

use crate::Parsed;
use xavatar_formats::{Fault, excerpt};

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

    /// The place of the property of this name, in any case.
    pub(super) fn property(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|property| property.name.eq_ignore_ascii_case(name))
    }

    /// The place of the scalar property of this name.
    pub(super) fn scalar(&self, name: &str) -> Option<usize> {
        self.property(name).filter(|place| matches!(self.properties[*place].layout, Layout::Scalar(_)))
    }

    /// The places of the scalar properties of these names, if all are there.
    pub(super) fn scalars<const N: usize>(&self, names: [&str; N]) -> Option<[usize; N]> {
        let mut places = [0; N];
        for (place, name) in places.iter_mut().zip(names) {
            *place = self.scalar(name)?;
        }
        Some(places)
    }

    /// The places of red, green and blue by the names that they have in the wild.
    pub(super) fn colour(&self) -> Option<[usize; 3]> {
        const NAMES: [[&str; 3]; 4] = [
            ["red", "green", "blue"],
            ["diffuse_red", "diffuse_green", "diffuse_blue"],
            ["r", "g", "b"],
            ["ambient_red", "ambient_green", "ambient_blue"],
        ];
        NAMES.into_iter().find_map(|names| self.scalars(names))
    }

    /// Whether the scalars at these places are whole numbers.
    pub(super) fn are_integers(&self, places: [usize; 3]) -> bool {
        places.iter().all(|place| matches!(self.properties[*place].layout, Layout::Scalar(kind) if kind.is_integer()))
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// From `comment TextureFile NAME`, in this order.
    pub(super) texture_files: Vec<String>,
    /// Where the body starts, bytes.
    pub(super) length: usize,
}

pub(super) fn parse_header(bytes: &[u8]) -> Parsed<Header> {
    let mut lines = Lines::new(&bytes[..bytes.len().min(LONGEST_HEADER)]);
    if lines.next_line()? != "ply" {
        return Err(Fault::malformed("line 1", "something else", "`ply`"));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut texture_files = Vec::new();
    loop {
        let line = lines.next_line()?;
        let place = format!("line {}", lines.number);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            ["comment" | "obj_info", keyword, name, ..] if keyword.eq_ignore_ascii_case("TextureFile") => {
                // Names may have blanks.
                texture_files.extend(line.find(name).map(|start| line[start..].to_owned()));
            }
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, "1.0"] if encoding.is_none() => {
                encoding = Some(match name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => {
                        return Err(Fault::malformed(
                            place,
                            excerpt(name),
                            "ascii, binary_little_endian or binary_big_endian",
                        ));
                    }
                });
            }
            ["element", name, count] => {
                let count = count
                    .parse()
                    .map_err(|_| Fault::malformed(&place, format!("count {}", excerpt(count)), "a whole number"))?;
                if elements.iter().any(|e| e.name.eq_ignore_ascii_case(name)) {
                    return Err(Fault::malformed(
                        place,
                        format!("a second element {}", excerpt(name)),
                        "each element once",
                    ));
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
            _ => return Err(Fault::malformed(place, excerpt(line), "format, element, property or end_header")),
        }
    }
    if let Some(empty) = elements.iter().find(|e| e.count > 0 && e.properties.is_empty()) {
        return Err(Fault::malformed(
            format!("element {}", excerpt(&empty.name)),
            "without properties",
            "at least one property",
        ));
    }
    let encoding = encoding.ok_or_else(|| Fault::malformed("the header", "without a format", "`format ... 1.0`"))?;
    Ok(Header { encoding, elements, texture_files, length: lines.position })
}

fn scalar(place: &str, name: &str) -> Parsed<Scalar> {
    Scalar::named(name)
        .ok_or_else(|| Fault::malformed(place, format!("type {}", excerpt(name)), "char to double or int8 to float64"))
}

fn add_property(elements: &mut [Element], place: String, name: &str, layout: Layout) -> Parsed<()> {
    let Some(element) = elements.last_mut() else {
        return Err(Fault::malformed(place, "a property", "an element first"));
    };
    if element.property(name).is_some() {
        return Err(Fault::malformed(place, format!("a second property {}", excerpt(name)), "each property once"));
    }
    if let Layout::List { count, .. } = layout
        && !count.is_integer()
    {
        return Err(Fault::malformed(place, "a list counted by real numbers", "an integer count"));
    }
    element.properties.push(Property { name: name.into(), layout });
    Ok(())
}

struct Lines<'a> {
    bytes: &'a [u8],
    position: usize,
    number: usize,
    /// What ends the first line, and so every other.
    end: u8,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        // A return alone ends lines where no newline follows the first.
        let first = bytes.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(0);
        let end = match bytes.get(first..first + 2) {
            Some([b'\r', after]) if *after != b'\n' => b'\r',
            _ => b'\n',
        };
        Self { bytes, position: 0, number: 0, end }
    }

    fn next_line(&mut self) -> Parsed<&'a str> {
        self.number += 1;
        let rest = &self.bytes[self.position..];
        let place = || format!("line {}", self.number);
        let end = rest
            .iter()
            .position(|&byte| byte == self.end)
            .ok_or_else(|| Fault::malformed(place(), "the end of the file", "a header closed by end_header"))?;
        self.position += end + 1;
        let line =
            std::str::from_utf8(&rest[..end]).map_err(|_| Fault::malformed(place(), "not text", "a header line"))?;
        Ok(line.trim_end())
    }
}
