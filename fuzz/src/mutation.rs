//! Files that are almost right: the seeds with a few bytes changed, moved, cut, repeated or replaced by numbers at the edges.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Longer inputs only take longer.
const LONGEST: usize = 1 << 16;
/// Most changes of one input, each half as likely as the one before.
const MOST_CHANGES: u32 = 8;
/// Numbers at which arithmetic goes wrong.
const EDGES: [u64; 14] = [
    0,
    1,
    2,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0xffff,
    0x1_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0xffff_ffff_ffff_ffff,
];
/// Numbers at which parsing text goes wrong.
const TEXT_EDGES: [&str; 10] =
    ["-1", "0", "1e39", "-1e-46", "nan", "-inf", "65536", "4294967296", "18446744073709551616", "9e999"];

/// One of the seeds, changed. The seeds must not be empty.
pub fn mutated(seeds: &[Vec<u8>], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = seeds[random.random_range(0..seeds.len())].clone();
    let mut changes = 1;
    while changes < MOST_CHANGES && random.random() {
        changes += 1;
    }
    for _ in 0..changes {
        change(&mut bytes, seeds, random);
    }
    bytes.truncate(LONGEST);
    bytes
}

fn change(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut ChaCha8Rng) {
    let place = random.random_range(0..=bytes.len());
    let length = random.random_range(0..=(bytes.len() - place).min(64));
    match random.random_range(0..10u8) {
        0 => flip(bytes, place, random),
        1 => replace(bytes, place, &[random.random()]),
        2 | 3 => {
            let edge = EDGES[random.random_range(0..EDGES.len())];
            let width = [1, 2, 4, 8][random.random_range(0..4)];
            match random.random() {
                true => replace(bytes, place, &edge.to_le_bytes()[..width]),
                false => replace(bytes, place, &edge.to_be_bytes()[8 - width..]),
            }
        }
        4 => replace_number(bytes, place, random),
        5 => drop(bytes.drain(place..place + length)),
        6 => {
            let repeated = bytes[place..place + length].to_vec();
            let times = random.random_range(1..=32);
            bytes.splice(place..place, repeated.repeat(times));
        }
        7 => {
            let inserted: Vec<u8> = (0..length).map(|_| random.random()).collect();
            bytes.splice(place..place, inserted);
        }
        8 => bytes.truncate(place),
        _ => {
            let other = &seeds[random.random_range(0..seeds.len())];
            let from = random.random_range(0..=other.len());
            bytes.truncate(place);
            bytes.extend_from_slice(&other[from..]);
        }
    }
}

fn flip(bytes: &mut [u8], place: usize, random: &mut ChaCha8Rng) {
    if let Some(byte) = bytes.get_mut(place) {
        *byte ^= 1 << random.random_range(0..8);
    }
}

/// Overwrites what stands at `place`, as far as there is room.
fn replace(bytes: &mut [u8], place: usize, by: &[u8]) {
    bytes[place..].iter_mut().zip(by).for_each(|(byte, new)| *byte = *new);
}

/// Replaces the digits at or after `place` by another number.
fn replace_number(bytes: &mut Vec<u8>, place: usize, random: &mut ChaCha8Rng) {
    let Some(begin) = bytes[place..].iter().position(u8::is_ascii_digit).map(|offset| place + offset) else { return };
    let digits = bytes[begin..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let new = TEXT_EDGES[random.random_range(0..TEXT_EDGES.len())];
    bytes.splice(begin..begin + digits, new.bytes());
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn mutations_differ_and_come_again() {
        let seeds = [b"shape 12, 34".to_vec(), Vec::new()];
        let inputs = |seed| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            (0..2000).map(|_| mutated(&seeds, &mut random)).collect::<Vec<_>>()
        };
        let first = inputs(1);
        assert_eq!(first, inputs(1));
        assert_ne!(first, inputs(2));
        let different: std::collections::HashSet<_> = first.iter().collect();
        assert!(different.len() > 500, "{}", different.len());
        assert!(first.iter().all(|input| input.len() <= LONGEST));
    }
}
