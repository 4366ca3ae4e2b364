//! The files of a tar archive by name (POSIX ustar): blocks of 512 bytes, a header before each file's content.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::fault::Fault;

const BLOCK: usize = 512;
const NAME: Range<usize> = 0..100;
const SIZE: Range<usize> = 124..136;
const KIND: usize = 156;
const PREFIX: Range<usize> = 345..500;

/// Where the content of each plain file is among the bytes; links, folders and other entries are passed over.
pub(crate) fn files(bytes: &[u8]) -> Result<BTreeMap<String, Range<usize>>, Fault> {
    let mut files = BTreeMap::new();
    let mut at = 0;
    while let Some(header) = bytes.get(at..at + BLOCK).filter(|header| header.iter().any(|byte| *byte != 0)) {
        let malformed = |found: &str| Fault::malformed(format_args!("byte {at}"), found, "a tar header and its file");
        let digits = text(&header[SIZE]);
        let size = usize::from_str_radix(digits.trim(), 8).map_err(|_| malformed("a size that is no octal number"))?;
        let start = at + BLOCK;
        let end =
            start.checked_add(size).filter(|end| *end <= bytes.len()).ok_or_else(|| malformed("a file cut off"))?;
        if matches!(header[KIND], b'0' | 0) {
            let (prefix, name) = (text(&header[PREFIX]), text(&header[NAME]));
            let name = if prefix.is_empty() { name } else { format!("{prefix}/{name}") };
            files.insert(name, start..end);
        }
        at = start + size.next_multiple_of(BLOCK);
    }
    Ok(files)
}

/// The text of a field, up to the first zero.
fn text(field: &[u8]) -> String {
    let end = field.iter().position(|byte| *byte == 0).unwrap_or(field.len());
    String::from_utf8_lossy(&field[..end]).into_owned()
}

/// A tar archive of files.
#[cfg(test)]
pub(crate) fn packed(contents: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (name, content) in contents {
        let mut header = [0; BLOCK];
        header[..name.len()].copy_from_slice(name.as_bytes());
        header[SIZE.start..SIZE.start + 11].copy_from_slice(format!("{:011o}", content.len()).as_bytes());
        header[KIND] = b'0';
        bytes.extend(header);
        bytes.extend(content);
        bytes.resize(bytes.len().next_multiple_of(BLOCK), 0);
    }
    bytes.resize(bytes.len() + 2 * BLOCK, 0);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_and_what_is_cut_off_is_named() {
        let bytes = packed(&[("package/a.bin", vec![7; 700]), ("b", Vec::new())]);
        let found = files(&bytes).unwrap();
        assert_eq!(found.keys().collect::<Vec<_>>(), ["b", "package/a.bin"]);
        assert_eq!(bytes[found["package/a.bin"].clone()], [7; 700]);
        assert!(files(&bytes[..800]).is_err());
        assert!(files(&[b'x'; 1024]).is_err());
    }
}
