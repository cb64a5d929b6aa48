//! The name that programs keep of the shared library: its first version number, so that a later file may serve them.

use std::env::var;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let major = var("CARGO_PKG_VERSION_MAJOR").unwrap_or_default();
    let hands = if var("CARGO_FEATURE_HANDS").is_ok() { "_hands" } else { "" };
    match var("CARGO_CFG_TARGET_OS").as_deref() {
        Ok("macos") => {
            println!(
                "cargo:rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libviscera{hands}.{major}.dylib"
            )
        }
        Ok("linux" | "freebsd" | "android") => {
            println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libviscera{hands}.so.{major}")
        }
        _ => {}
    }
}
