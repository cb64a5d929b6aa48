//! Replays the corpus of earlier fuzzing in a second.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::{Path, PathBuf};

/// The peak memory of a thread.
struct Watching;

#[global_allocator]
static ALLOCATOR: Watching = Watching;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn hold(bytes: isize) {
    HELD.set(HELD.get() + bytes);
    PEAK.set(PEAK.get().max(HELD.get()));
}

// SAFETY: every request goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Watching {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        hold(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        hold(layout.size() as isize);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        hold(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // The old and the new block may exist at the same time.
        hold(size as isize);
        hold(-(layout.size() as isize));
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// The peak memory of `work`, and its result.
fn peak<T>(work: impl FnOnce() -> T) -> (usize, T) {
    let before = HELD.get();
    PEAK.set(before);
    let result = work();
    ((PEAK.get() - before) as usize, result)
}

/// The files of a corpus, by name.
fn corpus(name: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    paths.iter().map(|path| (name(path), std::fs::read(path).unwrap())).collect()
}

#[test]
fn no_file_brings_the_reader_down() {
    let accepted: Vec<String> = corpus("file")
        .into_iter()
        .filter(|(_, bytes)| viscera_fuzz::file(bytes))
        .map(|f| f.0)
        .collect();
    assert!(accepted.iter().any(|name| name == "block.viscera"));
    assert!(accepted.len() < corpus("file").len() / 2, "hostile files are refused: {accepted:?}");
}

/// Headers may give false sizes; memory is allocated only for bytes that exist.
#[test]
fn no_file_asks_for_much_more_memory_than_it_has() {
    for (name, bytes) in corpus("file") {
        let (most, _) = peak(|| viscera_fuzz::file(&bytes));
        let allowed = 64 * bytes.len() + (1 << 16);
        assert!(most <= allowed, "{name}: {most} bytes held for a file of {}", bytes.len());
    }
}

#[test]
fn no_edit_of_a_model_brings_the_evaluator_down() {
    let scripts = corpus("edits");
    let accepted = scripts.iter().filter(|(_, bytes)| viscera_fuzz::edits(bytes)).count();
    assert!(accepted > 0 && accepted < scripts.len(), "{accepted} of {}", scripts.len());
}

#[test]
fn no_case_and_no_request_brings_the_stepper_down() {
    for (name, accepts) in
        [("case", viscera_fuzz::case as fn(&[u8]) -> bool), ("requests", viscera_fuzz::requests)]
    {
        let tried = corpus(name);
        let accepted = tried.iter().filter(|(_, bytes)| accepts(bytes)).count();
        assert!(accepted > 0 && accepted < tried.len(), "{name}: {accepted} of {}", tried.len());
    }
}

/// All of a valid case, cut or with one byte changed: refused, or stepped.
#[test]
fn no_damage_to_a_byte_of_a_case_brings_the_stepper_down() {
    let bytes = viscera_fuzz::CASE;
    for place in (0..bytes.len()).step_by(7) {
        assert!(!viscera_fuzz::case(&bytes[..place]), "cut after {place} bytes");
        let mut changed = bytes.to_vec();
        changed[place] ^= 1 << (place % 8);
        viscera_fuzz::case(&changed);
    }
}

/// All of a valid file, cut or with one bit flipped.
#[test]
fn no_damage_to_a_byte_brings_the_reader_down() {
    let bytes = viscera_fuzz::BLOCK;
    let mut refused = 0;
    for place in (0..bytes.len()).step_by(31) {
        assert!(!viscera_fuzz::file(&bytes[..place]), "cut after {place} bytes");
        let mut changed = bytes.to_vec();
        changed[place] ^= 1 << (place % 8);
        refused += usize::from(!viscera_fuzz::file(&changed));
    }
    assert_eq!(refused, bytes.len().div_ceil(31), "no file with a flipped bit is accepted");
}
