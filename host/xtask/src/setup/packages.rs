//! The product's system packages, and how to detect each.

/// Purpose of a package. A command requires only the groups that it needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Compiling the desktop program.
    Build,
    /// Formatting and lint checks.
    Checks,
    /// Building firmware and running the emulated board.
    Board,
    /// Opening a window.
    Window,
    /// Opening a window without a display, and capturing it.
    Screen,
    /// Making packages of the program.
    Package,
    /// Making the book of the pages, by its command alone.
    Book,
}

impl Group {
    /// Every group but [`Group::Book`], in the order of reports: what set-up and the tests install.
    pub const ALL: [Self; 6] = [
        Self::Build,
        Self::Checks,
        Self::Board,
        Self::Window,
        Self::Screen,
        Self::Package,
    ];

    /// True if this system needs the group: only Linux installs window libraries separately, and packages are made there alone.
    pub fn applies(self) -> bool {
        cfg!(target_os = "linux") || !matches!(self, Self::Window | Self::Screen | Self::Package)
    }

    /// Purpose in one line, for the user.
    pub fn purpose(self) -> &'static str {
        match self {
            Self::Build => "to compile the program: a C++ compiler and OpenCASCADE, which reads STEP files",
            Self::Checks => "to check sources and dependencies: rustfmt, clippy and cargo-deny",
            Self::Board => "for the emulated board: QEMU, and Rust's target for the microcontroller",
            Self::Window => "to open a window: graphics drivers and input libraries",
            Self::Package => "to make packages of the program: patchelf and dpkg-dev",
            Self::Book => "to make the book of the pages: mdBook",
            Self::Screen => {
                "to test the window without a display: Xvfb, xdotool, ImageMagick, a message bus, a Japanese font"
            }
        }
    }
}

/// Evidence that a package is installed, by whatever installer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// A program in `PATH`.
    Program(&'static str),
    /// A header below one of the include directories.
    Header(&'static str),
    /// A file in one of the library directories.
    Library(&'static str),
    /// A Vulkan driver's description (`*.json`) in the loader's directories.
    VulkanDriver,
    /// A font file below the system's font folders whose name begins with one of these.
    Font(&'static [&'static str]),
}

/// One package of Debian and Ubuntu with its counterparts elsewhere.
#[derive(Debug, PartialEq, Eq)]
pub struct Package {
    /// Purpose.
    pub group: Group,
    /// Its name for apt.
    pub apt: &'static str,
    /// Evidence that it, or its equivalent from another source, is installed.
    pub sign: Sign,
    /// Its name for dnf (Fedora).
    pub dnf: &'static str,
    /// Its name for pacman (Arch).
    pub pacman: &'static str,
}

const fn package(
    group: Group,
    apt: &'static str,
    sign: Sign,
    dnf: &'static str,
    pacman: &'static str,
) -> Package {
    Package {
        group,
        apt,
        sign,
        dnf,
        pacman,
    }
}

/// Fonts with Japanese glyphs, to check that Japanese part names are drawn.
const JAPANESE: &[&str] = &[
    "DroidSansFallback",
    "NotoSansCJK",
    "NotoSansJP",
    "SourceHanSans",
    "VL-Gothic",
    "TakaoGothic",
    "ipag",
];

/// All system packages. `serialport` without udev, and a window system that loads its libraries at run time, need no development packages.
#[rustfmt::skip]
pub const PACKAGES: &[Package] = &[
    package(Group::Build, "g++", Sign::Program("c++"), "gcc-c++", "gcc"),
    package(Group::Build, "libocct-data-exchange-dev", Sign::Header("opencascade/STEPCAFControl_Reader.hxx"), "opencascade-devel", "opencascade"),
    package(Group::Build, "libocct-ocaf-dev", Sign::Header("opencascade/TDocStd_Document.hxx"), "opencascade-devel", "opencascade"),
    package(Group::Build, "libocct-modeling-algorithms-dev", Sign::Header("opencascade/BRepMesh_IncrementalMesh.hxx"), "opencascade-devel", "opencascade"),
    package(Group::Board, "qemu-system-arm", Sign::Program("qemu-system-arm"), "qemu-system-arm", "qemu-system-arm"),
    package(Group::Window, "libgl1-mesa-dri", Sign::Library("libGLX_mesa.so.0"), "mesa-dri-drivers", "mesa"),
    package(Group::Window, "mesa-vulkan-drivers", Sign::VulkanDriver, "mesa-vulkan-drivers", "vulkan-swrast"),
    package(Group::Window, "libvulkan1", Sign::Library("libvulkan.so.1"), "vulkan-loader", "vulkan-icd-loader"),
    package(Group::Window, "libegl1", Sign::Library("libEGL.so.1"), "libglvnd-egl", "libglvnd"),
    package(Group::Window, "libgl1", Sign::Library("libGL.so.1"), "libglvnd-glx", "libglvnd"),
    package(Group::Window, "libxkbcommon-x11-0", Sign::Library("libxkbcommon-x11.so.0"), "libxkbcommon-x11", "libxkbcommon-x11"),
    package(Group::Window, "libxcursor1", Sign::Library("libXcursor.so.1"), "libXcursor", "libxcursor"),
    package(Group::Window, "libxi6", Sign::Library("libXi.so.6"), "libXi", "libxi"),
    package(Group::Window, "libxrandr2", Sign::Library("libXrandr.so.2"), "libXrandr", "libxrandr"),
    package(Group::Window, "libfontconfig1", Sign::Library("libfontconfig.so.1"), "fontconfig", "fontconfig"),
    package(Group::Window, "libx11-xcb1", Sign::Library("libX11-xcb.so.1"), "libX11-xcb", "libx11"),
    package(Group::Screen, "dbus-daemon", Sign::Program("dbus-daemon"), "dbus-daemon", "dbus"),
    package(Group::Screen, "xvfb", Sign::Program("Xvfb"), "xorg-x11-server-Xvfb", "xorg-server-xvfb"),
    package(Group::Screen, "xdotool", Sign::Program("xdotool"), "xdotool", "xdotool"),
    package(Group::Screen, "imagemagick", Sign::Program("import"), "ImageMagick", "imagemagick"),
    package(Group::Screen, "fonts-droid-fallback", Sign::Font(JAPANESE), "google-droid-sans-fonts", "noto-fonts-cjk"),
    package(Group::Package, "patchelf", Sign::Program("patchelf"), "patchelf", "patchelf"),
    package(Group::Package, "dpkg-dev", Sign::Program("dpkg-shlibdeps"), "dpkg-dev", "dpkg"),
];
