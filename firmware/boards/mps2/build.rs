//! Gives the linker the machine's interrupt names.

use std::env;
use std::error::Error;
use std::fs;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=device.x");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::copy("device.x", out.join("device.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    Ok(())
}
