//! The graphics processor of the page, as the core's device.

use viscera_live::OnDevice;

/// Opens it, once; none where the browser offers the page none.
#[cfg(target_family = "wasm")]
pub fn open() -> Option<OnDevice> {
    use std::sync::OnceLock;
    use viscera_device::About;
    use viscera_device::library::{Library, spoken};

    static LIBRARY: OnceLock<Library> = OnceLock::new();
    let library = LIBRARY.get_or_init(|| Library(viscera_gpu::viscera_gpu()));
    let mut about = About::default();
    // SAFETY: both are ours.
    let opened = spoken(|fault| unsafe { (library.0.about)(&mut about, fault) });
    opened.is_ok().then_some(OnDevice(library))
}

/// There is no page here.
#[cfg(not(target_family = "wasm"))]
pub fn open() -> Option<OnDevice> {
    None
}
