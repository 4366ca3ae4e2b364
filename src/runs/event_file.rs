//! TensorBoard's event files: scalars by tag and step, as records of a protocol buffer message each.
//!
//! A record is length (u64), masked CRC-32C of the length (u32), message, masked CRC-32C of the message (u32), little-endian. Messages
//! (tensorflow/core/util/event.proto): Event { 1: wall time f64, 2: step, 3: version text, 5: Summary }, Summary { 1: Value ... }, Value {
//! 1: tag, 2: f32 }. Written by hand: the crates for it bring a protocol buffer compiler or image codecs, and this is all that is used.

/// The file's name; TensorBoard asks for `tfevents` in it.
pub(super) const EVENTS: &str = "events.out.tfevents.0.xavatar";
/// What the first record says; from version 2 on, a step that comes again does not erase those after it.
const VERSION: &str = "brain.Event:2";

const DOUBLE: u8 = 1;
const TEXT_OR_MESSAGE: u8 = 2;
const FLOAT: u8 = 5;

/// The record that a file begins with.
pub(super) fn version_record(wall_time: f64) -> Vec<u8> {
    let mut event = Vec::new();
    double(&mut event, 1, wall_time);
    bytes(&mut event, 3, VERSION.as_bytes());
    record(&event)
}

/// The record of one step's scalars. `wall_time` in seconds since 1970.
pub(super) fn scalars_record(wall_time: f64, step: u64, scalars: &[(String, f64)]) -> Vec<u8> {
    let mut summary = Vec::new();
    for (tag, scalar) in scalars {
        let mut value = Vec::new();
        bytes(&mut value, 1, tag.as_bytes());
        key(&mut value, 2, FLOAT);
        value.extend((*scalar as f32).to_le_bytes());
        bytes(&mut summary, 1, &value);
    }
    let mut event = Vec::new();
    double(&mut event, 1, wall_time);
    key(&mut event, 2, 0);
    varint(&mut event, step);
    bytes(&mut event, 5, &summary);
    record(&event)
}

/// The first `count` records of a file, or as many as are whole; those that a killed process left in part are not.
pub(super) fn whole_records(file: &[u8], count: usize) -> &[u8] {
    let mut end = 0;
    for _ in 0..count {
        let Some(length) = whole_record(&file[end..]) else { break };
        end += length;
    }
    &file[..end]
}

/// The length of the record that `bytes` begin with, if it is whole and its checksums are right.
fn whole_record(bytes: &[u8]) -> Option<usize> {
    let (length, rest) = bytes.split_first_chunk::<8>()?;
    let (length_check, rest) = rest.split_first_chunk::<4>()?;
    let size = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let (message, rest) = rest.split_at_checked(size)?;
    let (check, _) = rest.split_first_chunk::<4>()?;
    let is_whole =
        *length_check == masked_crc32c(length).to_le_bytes() && *check == masked_crc32c(message).to_le_bytes();
    is_whole.then_some(size + 16)
}

fn record(message: &[u8]) -> Vec<u8> {
    let length = (message.len() as u64).to_le_bytes();
    let checks = [masked_crc32c(&length).to_le_bytes(), masked_crc32c(message).to_le_bytes()];
    [&length[..], &checks[0], message, &checks[1]].concat()
}

fn key(message: &mut Vec<u8>, field: u8, wire_type: u8) {
    message.push(field << 3 | wire_type);
}

fn varint(message: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}

fn double(message: &mut Vec<u8>, field: u8, value: f64) {
    key(message, field, DOUBLE);
    message.extend(value.to_le_bytes());
}

fn bytes(message: &mut Vec<u8>, field: u8, content: &[u8]) {
    key(message, field, TEXT_OR_MESSAGE);
    varint(message, content.len() as u64);
    message.extend(content);
}

/// CRC-32C (Castagnoli), rotated and shifted as records want it, so that the checksum of a checksum is not trivial.
fn masked_crc32c(bytes: &[u8]) -> u32 {
    crc32c(bytes).rotate_right(15).wrapping_add(0xa282_ead8)
}

fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ if crc & 1 == 1 { 0x82f6_3b78 } else { 0 })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fields of a message: number, and a varint's value, a fixed value's bits or content.
    fn fields(mut message: &[u8]) -> Vec<(u8, u64, &[u8])> {
        let read_varint = |message: &mut &[u8]| {
            let mut value = 0;
            for shift in (0..).step_by(7) {
                let (byte, rest) = message.split_first().unwrap();
                *message = rest;
                value |= u64::from(byte & 0x7f) << shift;
                if byte & 0x80 == 0 {
                    return value;
                }
            }
            unreachable!()
        };
        let mut fields = Vec::new();
        while let Some((key, rest)) = message.split_first() {
            message = rest;
            let (value, content) = match key & 7 {
                0 => (read_varint(&mut message), &[][..]),
                wire_type => {
                    let length = match wire_type {
                        DOUBLE => 8,
                        FLOAT => 4,
                        _ => read_varint(&mut message) as usize,
                    };
                    let (content, rest) = message.split_at(length);
                    message = rest;
                    (0, content)
                }
            };
            fields.push((key >> 3, value, content));
        }
        fields
    }

    #[test]
    fn checksums_are_castagnolis() {
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
    }

    #[test]
    fn scalars_are_read_back() {
        let scalars = [("avatar/total".to_owned(), 0.25), ("avatar/normal".to_owned(), -3.0)];
        let record = scalars_record(1e9 + 0.5, 300, &scalars);
        assert_eq!(whole_record(&record), Some(record.len()));
        let event = fields(&record[12..record.len() - 4]);
        assert_eq!(event[0], (1, 0, &(1e9f64 + 0.5).to_le_bytes()[..]));
        assert_eq!(event[1], (2, 300, &[][..]));
        let values = fields(event[2].2);
        assert_eq!((event[2].0, values.len()), (5, 2));
        for ((_, _, value), (tag, scalar)) in values.iter().zip(&scalars) {
            let value = fields(value);
            assert_eq!((value[0].0, value[0].2), (1, tag.as_bytes()));
            assert_eq!((value[1].0, value[1].2), (2, &(*scalar as f32).to_le_bytes()[..]));
        }
        let version = version_record(0.0);
        assert_eq!(fields(&version[12..version.len() - 4])[1].2, VERSION.as_bytes());
    }

    #[test]
    fn only_whole_records_are_kept() {
        let records: Vec<Vec<u8>> = (0..4).map(|step| scalars_record(1.0, step, &[("x".into(), 1.0)])).collect();
        let file = records.concat();
        assert_eq!(whole_records(&file, 2), records[..2].concat());
        assert_eq!(whole_records(&file, 9), file);
        assert_eq!(whole_records(&file[..file.len() - 1], 4), records[..3].concat(), "cut off");
        let mut damaged = file.clone();
        damaged[records[0].len() + 15] ^= 1;
        assert_eq!(whole_records(&damaged, 4), records[0], "damaged");
        let mut endless = file;
        endless[..8].fill(0xff);
        assert!(whole_records(&endless, 4).is_empty());
    }
}
