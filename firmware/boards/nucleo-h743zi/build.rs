//! Gives the linker this board's memory map and scripts.

use std::env;
use std::error::Error;
use std::fs;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory.x");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::copy("memory.x", out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    // The label (mortise_protocol::label), which no code refers to, is kept by name.
    // Here and not in .cargo/config.toml, which follows the current directory.
    for argument in [
        "--nmagic",
        "-Tlink.x",
        "-Tdefmt.x",
        "--undefined=MORTISE_FIRMWARE",
    ] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    Ok(())
}
