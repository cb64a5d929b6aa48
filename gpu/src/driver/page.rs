//! The driver of a page: its WebGPU, as functions of the imported module `gpu` (viewer/src/live/gpu.ts). Objects are numbers.
//! The page has one device and one thread. Functions that wait for the device suspend the module.

use super::{About, Contents, Kind};
use crate::Error;
use std::marker::PhantomData;

#[link(wasm_import_module = "gpu")]
unsafe extern "C" {
    /// Opens the device, and waits for it; its largest binding [bytes], zero where there is none.
    safe fn open() -> f64;
    safe fn is_software() -> u32;
    /// Writes the device's name in UTF-8 where there is room for `len` bytes; returns the length.
    fn name(words: *mut u8, len: usize) -> usize;
    /// Writes the first fault like a name; zero if there is none.
    fn fault(words: *mut u8, len: usize) -> usize;
    /// What kind of fault it is: [`MEMORY`], [`REFUSED`], or else a lost device.
    safe fn fault_kind() -> u32;
    safe fn destroy();
    safe fn buffer(bytes: f64, is_uniform: u32) -> u32;
    safe fn release_buffer(buffer: u32);
    fn write(buffer: u32, offset: f64, bytes: *const u8, len: usize);
    fn pipeline(source: *const u8, len: usize, entry: *const u8, entry_len: usize) -> u32;
    /// Pairs of a binding's number and its buffer.
    fn bind(pipeline: u32, pairs: *const [u32; 2], len: usize) -> u32;
    safe fn release_group(group: u32);
    safe fn encoder() -> u32;
    safe fn dispatch(encoder: u32, pipeline: u32, group: u32, workgroups: u32);
    safe fn submit(encoder: u32);
    /// Submits, waits, and copies words of buffers, in pairs of a buffer and how many, one after the other.
    fn read(encoder: u32, pairs: *const [u32; 2], len: usize, words: *mut u32);
}

/// Kinds of faults, as the page counts them.
const MEMORY: u32 = 1;
const REFUSED: u32 = 2;

/// Longest sentence or name.
const LONGEST: usize = 400;

/// The page's device.
pub struct Driver;

/// A buffer of the page.
pub struct Buffer(u32);

/// What a kernel is bound to. It keeps its buffers.
pub struct Group(u32);

/// A compiled kernel.
#[derive(Clone)]
pub struct Kernel(u32);

/// Commands that are being written.
pub struct Encoder<'a>(u32, PhantomData<&'a Driver>);

impl Driver {
    /// The device of the page.
    pub fn open(_is_timed: bool) -> Result<(Self, About, u64), Error> {
        let largest = open();
        if largest == 0.0 {
            return Err(Error::Missing("the browser opens none to this page".to_string()));
        }
        // SAFETY: there is room for as many bytes as are asked for.
        let name = words(|at, len| unsafe { name(at, len) });
        let backend = "webgpu".to_string();
        let is_software = is_software() != 0;
        Ok((Driver, About { name, driver: String::new(), backend, is_software }, largest as u64))
    }

    /// The first fault that the device has reported, if any.
    pub fn fault(&self) -> Option<Error> {
        // SAFETY: there is room for as many bytes as are asked for.
        let said = words(|at, len| unsafe { fault(at, len) });
        (!said.is_empty()).then(|| match fault_kind() {
            MEMORY => Error::Memory("what was asked of it".to_string()),
            REFUSED => Error::Refused(said),
            _ => Error::Lost(said),
        })
    }

    pub fn destroy(&self) {
        destroy();
    }

    pub fn buffer(&self, _label: &str, kind: Kind, contents: Contents<'_>) -> Buffer {
        let is_uniform = u32::from(matches!(kind, Kind::Uniform));
        match contents {
            Contents::Zeros(bytes) => Buffer(buffer(bytes as f64, is_uniform)),
            Contents::Bytes(bytes) => {
                let buffer = Buffer(buffer(bytes.len() as f64, is_uniform));
                self.write(&buffer, 0, bytes);
                buffer
            }
        }
    }

    /// Writes from this byte on, before the commands that are submitted next.
    pub fn write(&self, buffer: &Buffer, offset: u64, bytes: &[u8]) {
        // SAFETY: the bytes are there until the page has copied them.
        unsafe { write(buffer.0, offset as f64, bytes.as_ptr(), bytes.len()) };
    }

    /// One entry point of a kernel source.
    pub fn kernel(&self, source: &str, entry: &'static str) -> Kernel {
        // SAFETY: the texts are there until the page has read them.
        Kernel(unsafe { pipeline(source.as_ptr(), source.len(), entry.as_ptr(), entry.len()) })
    }

    pub fn bind(&self, kernel: &Kernel, buffers: &[(u32, &Buffer)]) -> Group {
        let pairs: Vec<[u32; 2]> = buffers.iter().map(|(at, buffer)| [*at, buffer.0]).collect();
        // SAFETY: the pairs are there until the page has read them.
        Group(unsafe { bind(kernel.0, pairs.as_ptr(), pairs.len()) })
    }

    pub fn encoder(&self) -> Encoder<'_> {
        Encoder(encoder(), PhantomData)
    }
}

impl Encoder<'_> {
    pub fn dispatch(&mut self, kernel: &Kernel, group: &Group, workgroups: u32) {
        dispatch(self.0, kernel.0, group.0, workgroups);
    }

    pub fn submit(self) {
        submit(self.0);
    }

    /// Submits, waits, and reads as many words of 32 bits of each buffer.
    pub fn read(self, parts: &[(&Buffer, usize)]) -> Result<Vec<Vec<u32>>, Error> {
        let pairs: Vec<[u32; 2]> =
            parts.iter().map(|(buffer, words)| [buffer.0, *words as u32]).collect();
        let mut all = vec![0u32; parts.iter().map(|(_, words)| words).sum()];
        // SAFETY: there is room for all words; nothing else runs in this module until it returns.
        unsafe { read(self.0, pairs.as_ptr(), pairs.len(), all.as_mut_ptr()) };
        Driver.fault().map_or(Ok(()), Err)?;
        let mut rest = &all[..];
        let part = |&(_, words): &(&Buffer, usize)| {
            let (own, others) = rest.split_at(words);
            rest = others;
            own.to_vec()
        };
        Ok(parts.iter().map(part).collect())
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        release_buffer(self.0);
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        release_group(self.0);
    }
}

/// What the page writes in UTF-8 where it finds room.
fn words(of_page: impl FnOnce(*mut u8, usize) -> usize) -> String {
    let mut bytes = vec![0u8; LONGEST];
    let length = of_page(bytes.as_mut_ptr(), LONGEST).min(LONGEST);
    String::from_utf8_lossy(&bytes[..length]).into_owned()
}
