//! The window follows the desktop's theme: the settings portal on a message bus of its own, and the program's set-up in a process on that bus.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use egui::Theme;
use mortise::ui::set_up;
use zbus::blocking::connection;
use zbus::zvariant::Value;

/// Set in the process that is on the bus.
const BUS: &str = "DBUS_SESSION_BUS_ADDRESS";
const ON_THE_BUS: &str = "MORTISE_TEST_FOLLOWS";
/// The desktop's theme; the program's own default is dark.
const LIGHT: u32 = 2;
/// Only a hang takes so long.
const PATIENCE: Duration = Duration::from_secs(60);

struct Portal;

#[zbus::interface(name = "org.freedesktop.portal.Settings")]
impl Portal {
    fn read(&self, _namespace: &str, _key: &str) -> Value<'static> {
        Value::Value(Box::new(Value::U32(LIGHT)))
    }
}

/// Ends the bus with the test.
struct Bus(Child);

impl Drop for Bus {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn the_window_follows_the_desktop() {
    if std::env::var_os(ON_THE_BUS).is_some() {
        return becomes_light();
    }
    let started = Command::new("dbus-daemon")
        .args(["--session", "--nofork", "--print-address"])
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut daemon) = started else {
        assert!(std::env::var_os("CI").is_none(), "set-up installs dbus-daemon");
        println!("skipped: dbus-daemon is missing (cargo xtask setup installs it)");
        return;
    };
    let output = daemon.stdout.take().expect("a pipe");
    let _bus = Bus(daemon);
    let mut address = String::new();
    BufReader::new(output)
        .read_line(&mut address)
        .expect("an address");
    let _portal = connection::Builder::address(address.trim())
        .and_then(|builder| builder.name("org.freedesktop.portal.Desktop"))
        .and_then(|builder| builder.serve_at("/org/freedesktop/portal/desktop", Portal))
        .and_then(|builder| builder.build())
        .expect("the portal is on the bus");
    let child = Command::new(std::env::current_exe().expect("this program"))
        .args(["--exact", "desktop_theme::the_window_follows_the_desktop"])
        .env(BUS, address.trim())
        .env(ON_THE_BUS, "1")
        .output()
        .expect("it starts again");
    assert!(
        child.status.success(),
        "{}",
        String::from_utf8_lossy(&child.stdout)
    );
}

fn becomes_light() {
    let ctx = egui::Context::default();
    set_up(&ctx);
    let begun = Instant::now();
    while ctx.options(|options| options.fallback_theme) != Theme::Light {
        assert!(begun.elapsed() < PATIENCE, "it stays dark");
        std::thread::sleep(Duration::from_millis(20));
    }
}
