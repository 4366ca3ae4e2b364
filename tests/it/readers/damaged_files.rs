//! Damaged and hostile files: every reader either reads or says why not, and never panics, hangs or exhausts memory.
//!
//! Truncation at many places, seeded one-byte mutations of files that numpy wrote, and pickles made to blow up.

use std::fs;
use std::path::{Path, PathBuf};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar::data::read_motion;
use xavatar::formats::{Array, ArrayMap, read_npy, read_npz, read_pickle, read_pickle_arrays, read_torch, write_npz};
use xavatar::formats::{Error, Result};

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}

/// A file to write variants of the same bytes to.
struct Scratch {
    folder: tempfile::TempDir,
    name: String,
}

impl Scratch {
    fn new(name: &str) -> Self {
        Self { folder: tempfile::tempdir().unwrap(), name: name.into() }
    }

    fn with(&self, bytes: &[u8]) -> PathBuf {
        let path = self.folder.path().join(&self.name);
        // Overwriting makes some file systems sync, which takes longer than the test.
        let _absent_the_first_time = fs::remove_file(&path);
        fs::write(&path, bytes).unwrap();
        path
    }
}

/// Cuts the file at up to `places` lengths: each must be an error that names the file.
fn must_notice_truncation<T>(file: &str, places: usize, read: impl Fn(PathBuf) -> Result<T>) {
    let bytes = fs::read(golden(file)).unwrap();
    let scratch = Scratch::new("cut-file");
    for length in (0..bytes.len()).step_by((bytes.len() / places).max(1)).chain([bytes.len() - 1]) {
        match read(scratch.with(&bytes[..length])) {
            Ok(_) => panic!("{file} cut at {length} of {} bytes was read", bytes.len()),
            Err(error) => assert!(error.to_string().contains("cut-file"), "{error}"),
        }
    }
}

/// Changes one byte at a time; reading must return, and its memory stays bounded (or the process would be killed).
fn must_survive_mutation<T>(file: &str, mutations: usize, read: impl Fn(PathBuf) -> Result<T>) {
    let original = fs::read(golden(file)).unwrap();
    let scratch = Scratch::new("mutated-file");
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..mutations {
        let mut bytes = original.clone();
        let place = random.random_range(0..bytes.len());
        bytes[place] ^= random.random_range(1..=255u8);
        if let Err(error) = read(scratch.with(&bytes)) {
            assert!(error.to_string().contains("mutated-file"), "{error}");
        }
    }
}

#[test]
fn truncated_pickles_are_noticed() {
    for protocol in 0..=5 {
        must_notice_truncation(&format!("pickles/varied-p{protocol}.pkl"), 150, read_pickle_arrays);
    }
    for protocol in 2..=5 {
        must_notice_truncation(&format!("pickles/smplx-p{protocol}.pkl"), 150, read_pickle_arrays);
        must_notice_truncation(&format!("pickles/atlas-p{protocol}.pkl"), 50, read_pickle);
    }
    must_notice_truncation("pickles/smpl-like-p2.pkl", 40, read_pickle_arrays);
}

#[test]
fn mutated_pickles_are_read_or_refused() {
    for protocol in 0..=5 {
        must_survive_mutation(&format!("pickles/varied-p{protocol}.pkl"), 300, read_pickle_arrays);
    }
    for protocol in 2..=5 {
        must_survive_mutation(&format!("pickles/smplx-p{protocol}.pkl"), 300, read_pickle_arrays);
    }
    must_survive_mutation("pickles/smpl-like-p2.pkl", 40, read_pickle_arrays);
    must_survive_mutation("pickles/hostile.pkl", 300, read_pickle);
    assert!(!Path::new("hostile-pickle-was-run").exists());
}

#[test]
fn truncated_archives_are_noticed() {
    for name in ["amass", "grab", "own"] {
        must_notice_truncation(&format!("motions/{name}.npz"), 200, read_npz);
        must_notice_truncation(&format!("motions/{name}.npz"), 50, read_motion);
    }
    must_notice_truncation("official/scan.pth", 60, read_torch);
}

#[test]
fn mutated_archives_are_read_or_refused() {
    for name in ["amass", "grab", "own"] {
        must_survive_mutation(&format!("motions/{name}.npz"), 300, read_motion);
    }
    must_survive_mutation("official/scan.ckpt", 200, read_torch);
}

#[test]
fn damaged_motions_of_other_tools_are_noticed() {
    for file in ["motions/smpler_x.npz", "motions/pymaf_x.pkl"] {
        must_notice_truncation(file, 100, read_motion);
        must_survive_mutation(file, 300, read_motion);
    }
    // The last number of the last frame can lose digits and still be one; one more cut cannot be told from the whole. Of a file cut
    // between, the whole rows are read.
    must_survive_mutation("motions/walk.bvh", 1000, read_motion);
    let whole = fs::read(golden("motions/walk.bvh")).unwrap();
    let frames = read_motion(golden("motions/walk.bvh")).unwrap().frames.len();
    let scratch = Scratch::new("cut-file");
    for length in (0..whole.len() - 20).step_by(13) {
        match read_motion(scratch.with(&whole[..length])) {
            Err(error) => assert!(error.to_string().contains("cut-file"), "{error}"),
            Ok(cut) => {
                assert!(
                    cut.frames.len() < frames && cut.warnings[0].message.contains("cut off"),
                    "{length}: {:?}",
                    cut.warnings
                );
            }
        }
    }
}

#[test]
fn joblib_arrays_cannot_claim_more_than_the_file_has() {
    let whole = fs::read(golden("motions/pymaf_x.pkl")).unwrap();
    let place = whole.windows(5).position(|window| window == b"order").unwrap();
    let scratch = Scratch::new("lie.pkl");
    for byte in 0..=255u8 {
        let mut bytes = whole.clone();
        // Around the first array's shape, K\x03K\x03\x86: any extents at all.
        for (offset, replaced) in bytes[place - 40..place].iter_mut().enumerate() {
            if offset % 7 == usize::from(byte) % 7 {
                *replaced = byte;
            }
        }
        if let Err(error) = read_motion(scratch.with(&bytes)) {
            assert!(error.to_string().contains("lie.pkl"), "{error}");
        }
    }
}

#[test]
fn archives_whose_members_share_bytes_are_refused() {
    let scratch = Scratch::new("bomb.npz");
    let path = scratch.with(&[]);
    let array = Array::from_f32(&[1000], vec![0.0; 1000]);
    write_npz(&path, &ArrayMap::from([("a".into(), array.clone()), ("b".into(), array)])).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let second_entry = bytes.windows(4).rposition(|window| window == b"PK\x01\x02").unwrap();
    // The offset of the member's data: that of the first.
    bytes[second_entry + 42..second_entry + 46].fill(0);
    let error = read_npz(scratch.with(&bytes)).unwrap_err();
    assert!(matches!(error, Error::Refused { .. }), "{error}");
}

/// An npy file with this header text and data.
fn npy(header: &str, data: &[u8]) -> Vec<u8> {
    [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

#[test]
fn damaged_npy_files_are_noticed() {
    let scratch = Scratch::new("array.npy");
    let header = "{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3), }  \n";
    let whole = npy(header, &[0; 24]);
    assert_eq!(read_npy(scratch.with(&whole)).unwrap().shape, [2, 3]);
    for length in 0..whole.len() {
        assert!(read_npy(scratch.with(&whole[..length])).is_err(), "{length}");
    }
    for place in 0..whole.len() {
        for byte in [0, b'\'', b'(', b'9', b'}', 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[place] = byte;
            let _either = read_npy(scratch.with(&bytes));
        }
    }
}

#[test]
fn headers_that_lie_allocate_nothing() {
    let scratch = Scratch::new("array.npy");
    let lie = |descr: &str, shape: &str| {
        let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}");
        read_npy(scratch.with(&npy(&header, &[0; 8]))).unwrap_err()
    };
    let deep = format!("({}", "(".repeat(60_000));
    let many = format!("({})", "1,".repeat(30_000));
    let huge = format!("({})", "9".repeat(60_000));
    for shape in
        ["(1000000000000,)", "(18446744073709551615, 2)", "(4294967296, 4294967296, 0)", "(-1,)", &deep, &many, &huge]
    {
        let error = lie("'<f4'", shape);
        assert!(matches!(error, Error::Malformed { .. }) && error.to_string().len() < 500, "{error}");
    }
    for descr in ["'<U99999999999999'", "'<f1000000000000'", "[('a', '<f4')]", "'|V8'"] {
        assert!(matches!(lie(descr, "()"), Error::Malformed { .. }), "{descr}");
    }
    assert!(matches!(lie("'|O'", "(1,)"), Error::Refused { .. }));
}

#[test]
fn pickles_that_blow_up_are_refused() {
    let scratch = Scratch::new("bomb.pkl");
    let read = |pickle: &[u8]| read_pickle(scratch.with(pickle)).map(|value| format!("{value:?}").len());
    let refused = |pickle: &[u8]| {
        let error = read(pickle).unwrap_err();
        assert!(matches!(error, Error::Refused { .. }), "{error}");
    };
    let too_large = |pickle: &[u8]| {
        let error = read(pickle).unwrap_err();
        assert!(matches!(error, Error::TooLarge { .. }), "{error}");
    };
    let malformed = |pickle: &[u8]| {
        let error = read(pickle).unwrap_err();
        assert!(matches!(error, Error::Malformed { .. }), "{error}");
    };

    // A list that contains itself, and a dict that does.
    refused(b"\x80\x02]q\x00h\x00a.");
    refused(b"\x80\x02}q\x00X\x01\0\0\0ah\x00s.");
    // A million lists, then tuples, inside each other: neither building nor dropping them may recurse.
    refused(&[b"(".repeat(1_000_000), b"l".repeat(1_000_000), b".".to_vec()].concat());
    refused(&[b"]".to_vec(), b"\x85".repeat(1_000_000), b".".to_vec()].concat());
    // Each tuple holds the one before twice: 2^60 values in 180 bytes.
    too_large(&[b"N".to_vec(), b"2\x86".repeat(60), b".".to_vec()].concat());
    // Each list holds the one before ten times.
    let mut laughs = b"]q\x00".to_vec();
    for level in 0..20u8 {
        laughs.extend(b"](");
        laughs.extend([b'h', level].repeat(10));
        laughs.extend([b'e', b'q', level + 1]);
    }
    too_large(&[laughs, b".".to_vec()].concat());
    // Lengths beyond the file.
    malformed(b"\x8e\xff\xff\xff\xff\xff\xff\xff\xff.");
    malformed(b"\x8d\xff\xff\xff\xff\xff\xff\xff\x7f.");
    malformed(b"B\xff\xff\xff\xff.");
    malformed(b"\x8b\xff\xff\xff\x7f\x01.");
    // Values that are not there.
    for nothing in [
        &b"."[..],
        b"a.",
        b"s.",
        b"R.",
        b"b.",
        b"h\x05.",
        b"t.",
        b"o.",
        b"(o.",
        b"u.",
        b"\x87.",
        b"\x93.",
        b"0",
        b"2",
        b"",
    ] {
        malformed(nothing);
    }
}

#[test]
fn one_array_cannot_be_decoded_many_times() {
    // 40 kB of bytes, memoised, then a thousand arrays of them: 320 kB each once widened to 64 bits, 320 MB together.
    let mut pickle = b"\x80\x03B\x40\x9c\0\0".to_vec();
    pickle.extend(vec![0; 40_000]);
    pickle.extend(
        b"q\x00cnumpy.core.numeric\n_frombuffer\nq\x01cnumpy\ndtype\nX\x02\0\0\0i1\x85Rq\x02M\x40\x9c\x85q\x03](",
    );
    for _ in 0..1000 {
        pickle.extend(b"h\x01(h\x00h\x02h\x03X\x01\0\0\0CtR");
    }
    pickle.extend(b"e.");
    let error = read_pickle(Scratch::new("bomb.pkl").with(&pickle)).unwrap_err();
    assert!(matches!(&error, Error::TooLarge { purpose, .. } if purpose == "an array"), "{error}");
}

#[test]
fn sparse_matrices_cannot_densify_to_terabytes() {
    let array = b"cnumpy.core.numeric\n_frombuffer\n(C\x00cnumpy\ndtype\nX\x02\0\0\0i4\x85RK\x00\x85X\x01\0\0\0CtR";
    let key = |name: &str| [b"X", &(name.len() as u32).to_le_bytes()[..], name.as_bytes()].concat();
    let mut pickle = b"\x80\x03cscipy.sparse\ncsr_matrix\n)\x81}(".to_vec();
    pickle.extend([key("shape"), b"J\0\0\0\x40J\0\0\0\x40\x86".to_vec()].concat());
    for name in ["data", "indices", "indptr"] {
        pickle.extend([key(name), array.to_vec()].concat());
    }
    pickle.extend(b"ub.");
    let error = read_pickle(Scratch::new("bomb.pkl").with(&pickle)).unwrap_err();
    assert!(matches!(&error, Error::TooLarge { purpose, .. } if purpose.contains("dense matrix")), "{error}");
}

#[test]
fn whatever_would_run_code_is_refused_by_name() {
    let scratch = Scratch::new("hostile.pkl");
    let refusal = |pickle: &[u8], name: &str| {
        let error = read_pickle(scratch.with(pickle)).unwrap_err();
        assert!(matches!(&error, Error::Refused { found, .. } if found.contains(name)), "{error}");
    };
    refusal(b"cos\nsystem\n(S'true'\ntR.", "os.system");
    refusal(b"(S'true'\nios\nsystem\n.", "os.system");
    refusal(b"(cos\nsystem\nS'true'\no.", "os.system");
    refusal(b"\x8c\x02os\x8c\x06system\x93\x8c\x04true\x85R.", "os.system");
    refusal(b"cos\nsystem\n)\x81.", "os.system");
    refusal(b"}X\x01\0\0\0fcos\nsystem\ns.", "os.system");
    refusal(b"cbuiltins\neval\n(X\x01\x00\x00\x001tR.", "builtins.eval");
    refusal(b"ccopyreg\n_reconstructor\n(csubprocess\nPopen\nc__builtin__\nobject\nNtR.", "subprocess.Popen");
    refusal(b"cchumpy.ch\nadd\n)\x81}b.", "chumpy.ch.add");
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    archive.start_file("body.npy", zip::write::SimpleFileOptions::default()).unwrap();
    let object = npy("{'descr': '|O', 'fortran_order': False, 'shape': (), }", b"cos\nsystem\n(S'true'\ntR.");
    std::io::Write::write_all(&mut archive, &object).unwrap();
    let error = read_npz(scratch.with(archive.finish().unwrap().get_ref())).unwrap_err();
    assert!(matches!(&error, Error::Refused { found, .. } if found.contains("`body`") && found.contains("os.system")));
    refusal(b"Pstorage\n.", "persistent id");
    refusal(b"\x82\x01.", "extension registry");
    refusal(b"\x97.", "buffer");
}
