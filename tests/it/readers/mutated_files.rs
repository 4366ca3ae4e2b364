//! Every reader of untrusted bytes on mutated files; the long run is `cargo run --release -p xavatar-fuzz`.

use xavatar_fuzz::{TARGETS, drive, drive_known};

/// So that all targets together take seconds.
const INPUTS: u64 = 2000;

#[test]
fn no_reader_panics() {
    for target in TARGETS {
        let seeds = (target.seeds)();
        let tried = drive_known(target, &seeds).and_then(|_| drive(target, &seeds, 0, 0, INPUTS));
        if let Err(failure) = tried {
            panic!("{} panics over {:?}", target.name, String::from_utf8_lossy(&failure.bytes));
        }
    }
}

// Mutations of what is refused at its first byte would reach nothing.
#[test]
fn the_files_that_mutations_begin_with_are_sound() {
    for target in TARGETS {
        let seeds = (target.seeds)();
        assert!(!seeds.is_empty(), "{}", target.name);
        for (index, seed) in seeds.iter().enumerate() {
            assert!((target.read)(seed), "seed {index} of {}", target.name);
        }
    }
}
