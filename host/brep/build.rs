//! Compiles the bridge to the CAD kernel (OpenCASCADE 7.5 or newer) and links the kernel's shared libraries.

use std::env;
use std::path::{Path, PathBuf};

/// Locations of the headers when `OCCT_INCLUDE_DIR` is not set: Debian, Homebrew, MacPorts, plain `make install`.
const INCLUDE_DIRS: &[&str] = &[
    "/usr/include/opencascade",
    "/usr/include/occt",
    "/usr/local/include/opencascade",
    "/opt/homebrew/include/opencascade",
    "/opt/local/include/opencascade",
];

/// Toolkits common to the versions before and after 7.8, which regrouped the data exchange; each follows those it depends on.
const COMMON: &[&str] = &[
    "TKernel",
    "TKMath",
    "TKG2d",
    "TKG3d",
    "TKGeomBase",
    "TKBRep",
    "TKGeomAlgo",
    "TKTopAlgo",
    "TKShHealing",
    "TKMesh",
    "TKXSBase",
    "TKCDF",
    "TKLCAF",
    "TKXCAF",
];
/// STEP toolkits up to 7.7.
const STEP_OLD: &[&str] = &["TKSTEPBase", "TKSTEPAttr", "TKSTEP209", "TKSTEP", "TKXDESTEP"];
/// STEP toolkit from 7.8 on.
const STEP_NEW: &[&str] = &["TKDESTEP"];

fn main() {
    for file in [
        "src/kernel.rs",
        "src/kernel.h",
        "src/kernel.cc",
        "src/kernel_shape.cc",
        "src/kernel_oracle.cc",
        "src/kernel_spline.cc",
        "src/kernel_write.cc",
        "build.rs",
    ] {
        println!("cargo:rerun-if-changed={file}");
    }
    println!("cargo:rerun-if-env-changed=OCCT_INCLUDE_DIR");
    println!("cargo:rerun-if-env-changed=OCCT_LIB_DIR");

    let include = match include_dir() {
        Ok(dir) => dir,
        Err(message) => {
            eprintln!("error: {message}");
            std::process::exit(1);
        }
    };
    cxx_build::bridge("src/kernel.rs")
        .file("src/kernel.cc")
        .file("src/kernel_shape.cc")
        .file("src/kernel_oracle.cc")
        .file("src/kernel_spline.cc")
        .file("src/kernel_write.cc")
        .include("src")
        .include(&include)
        .std("c++17")
        // The kernel's headers are third-party code.
        .flag_if_supported("-Wno-deprecated-declarations")
        .flag_if_supported("-Wno-unused-parameter")
        .compile("mortise-brep-kernel");

    let libraries = library_dir(&include);
    if let Some(dir) = &libraries {
        println!("cargo:rustc-link-search=native={}", dir.display());
    }
    // The header that comes with the toolkit shows most reliably which grouping is installed.
    let step = if minor_version(&include) >= Some((7, 8)) {
        STEP_NEW
    } else {
        STEP_OLD
    };
    // Shared libraries need no link order, but dependants-first is right for static ones as well.
    for library in step.iter().rev().chain(COMMON.iter().rev()) {
        println!("cargo:rustc-link-lib=dylib={library}");
    }
}

fn include_dir() -> Result<PathBuf, String> {
    let holds_kernel = |dir: &Path| dir.join("STEPCAFControl_Reader.hxx").is_file();
    if let Some(dir) = env::var_os("OCCT_INCLUDE_DIR") {
        let dir = PathBuf::from(dir);
        return if holds_kernel(&dir) {
            Ok(dir)
        } else {
            Err(format!(
                "OCCT_INCLUDE_DIR={} holds no STEPCAFControl_Reader.hxx; set it to the folder with OpenCASCADE's headers",
                dir.display()
            ))
        };
    }
    INCLUDE_DIRS.iter().map(PathBuf::from).find(|dir| holds_kernel(dir)).ok_or_else(|| {
        "OpenCASCADE (7.5 or newer) not found. Debian/Ubuntu: apt-get install g++ libocct-data-exchange-dev \
         libocct-ocaf-dev libocct-modeling-algorithms-dev; macOS: brew install opencascade; Windows: vcpkg \
         install opencascade or conda install -c conda-forge occt. Elsewhere set OCCT_INCLUDE_DIR and OCCT_LIB_DIR"
            .into()
    })
}

/// The library folder beside an include folder `<prefix>/include/opencascade`, unless the linker finds it anyway.
fn library_dir(include: &Path) -> Option<PathBuf> {
    if let Some(dir) = env::var_os("OCCT_LIB_DIR") {
        return Some(dir.into());
    }
    let prefix = include.parent()?.parent()?;
    let dir = prefix.join("lib");
    (prefix != Path::new("/usr") && dir.is_dir()).then_some(dir)
}

/// (major, minor) from Standard_Version.hxx.
fn minor_version(include: &Path) -> Option<(u32, u32)> {
    let text = std::fs::read_to_string(include.join("Standard_Version.hxx")).ok()?;
    let number = |name: &str| {
        text.lines().find_map(|line| {
            line.trim_start()
                .strip_prefix("#define")?
                .trim_start()
                .strip_prefix(name)?
                .trim()
                .parse()
                .ok()
        })
    };
    Some((number("OCC_VERSION_MAJOR ")?, number("OCC_VERSION_MINOR ")?))
}
