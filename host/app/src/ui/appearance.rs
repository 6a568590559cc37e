//! Dark or light theme and reduced motion on Linux, which the window library cannot determine there. Source: the settings portal of freedesktop.org,
//! `color-scheme` (1 dark, 2 light, 0 no preference) and `reduced-motion` (1 reduced) of `org.freedesktop.appearance`, and GNOME's `enable-animations`, read
//! at the start and followed from then on.

use egui::Theme;
use zbus::blocking::{Connection, Proxy};
use zbus::zvariant::{OwnedValue, Value};

use super::theme;

const PORTAL: &str = "org.freedesktop.portal.Desktop";
const PATH: &str = "/org/freedesktop/portal/desktop";
const SETTINGS: &str = "org.freedesktop.portal.Settings";
const NAMESPACE: &str = "org.freedesktop.appearance";
const KEY: &str = "color-scheme";
/// Settings that say whether motion is reduced: namespace and key.
const MOTION: [[&str; 2]; 2] = [
    [NAMESPACE, "reduced-motion"],
    ["org.gnome.desktop.interface", "enable-animations"],
];

/// What the portal says.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Found {
    Theme(Theme),
    /// Whether motion is to be reduced.
    Still(bool),
}

/// Follows the desktop's theme and its setting for less motion on a thread of its own. A portal may answer late or be absent; both then stay as they are.
pub fn follow(ctx: &egui::Context) {
    let ctx = ctx.clone();
    let mut show = move |found| {
        match found {
            Found::Theme(theme) => ctx.options_mut(|options| options.fallback_theme = theme),
            Found::Still(still) => {
                let time = if still { 0.0 } else { theme::ANIMATION_S };
                ctx.all_styles_mut(|style| style.animation_time = time);
            }
        }
        ctx.request_repaint();
    };
    let watch = move || {
        // Without a bus or a portal there is no theme to follow, which is not an error.
        let _ = Connection::session().and_then(|bus| watch(&bus, &mut show));
    };
    // If the thread cannot start, the theme stays as it is.
    let _ = std::thread::Builder::new().name("appearance".into()).spawn(watch);
}

/// Calls `show` with the current settings and with each later one, until the connection ends.
fn watch(bus: &Connection, show: &mut dyn FnMut(Found)) -> zbus::Result<()> {
    let settings = Proxy::new(bus, PORTAL, PATH, SETTINGS)?;
    // Subscribe before reading, so that no change between the two is lost.
    let changes = settings.receive_signal("SettingChanged")?;
    // Portals before version 2 offer only `Read`, which wraps its answer twice.
    let read = |[namespace, key]: [&str; 2]| -> zbus::Result<OwnedValue> {
        let now: Result<OwnedValue, _> = settings.call("ReadOne", &(namespace, key));
        now.or_else(|_| settings.call("Read", &(namespace, key)))
    };
    let now = read([NAMESPACE, KEY])?;
    show(Found::Theme(scheme(&now)));
    for setting in MOTION {
        // Few desktops have both.
        if let Ok(value) = read(setting) {
            show(Found::Still(is_still(&value)));
        }
    }
    for change in changes {
        let body = change.body();
        let (namespace, key, value): (&str, &str, Value<'_>) = body.deserialize()?;
        if (namespace, key) == (NAMESPACE, KEY) {
            show(Found::Theme(scheme(&value)));
        } else if MOTION.contains(&[namespace, key]) {
            show(Found::Still(is_still(&value)));
        }
    }
    Ok(())
}

/// Whether a setting reduces motion: `reduced-motion` of 1, or animations that are not enabled.
fn is_still(value: &Value<'_>) -> bool {
    match value {
        Value::Value(inner) => is_still(inner),
        Value::U32(reduced) => *reduced == 1,
        Value::Bool(enabled) => !enabled,
        _ => false,
    }
}

/// The theme for a portal's value; dark without a preference, which is the program's default.
fn scheme(value: &Value<'_>) -> Theme {
    match value {
        Value::Value(inner) => scheme(inner),
        Value::U32(2) => Theme::Light,
        _ => Theme::Dark,
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;
    use std::sync::mpsc;

    use zbus::blocking::connection;

    use super::*;

    struct Portal {
        scheme: u32,
    }

    #[zbus::interface(name = "org.freedesktop.portal.Settings")]
    impl Portal {
        fn read(&self, namespace: &str, key: &str) -> zbus::fdo::Result<Value<'static>> {
            match [namespace, key] {
                [NAMESPACE, KEY] => Ok(Value::Value(Box::new(Value::U32(self.scheme)))),
                setting if setting == MOTION[1] => Ok(Value::Value(Box::new(Value::Bool(false)))),
                _ => Err(zbus::fdo::Error::Failed("unknown".into())),
            }
        }
    }

    /// A version-1 portal at the other end of a socket: its settings are read and followed.
    #[test]
    fn theme_and_motion_are_read_and_followed() {
        let (ours, theirs) = UnixStream::pair().unwrap();
        let guid = zbus::Guid::generate();
        let server = std::thread::spawn(move || {
            connection::Builder::async_io_unix_stream(theirs)
                .server(guid)
                .unwrap()
                .p2p()
                .serve_at(PATH, Portal { scheme: 2 })
                .unwrap()
                .build()
                .unwrap()
        });
        let bus = connection::Builder::async_io_unix_stream(ours)
            .p2p()
            .build()
            .unwrap();
        let portal = server.join().unwrap();
        let (reported, heard) = mpsc::channel();
        let watching = std::thread::spawn(move || {
            let _ = watch(&bus, &mut |found| reported.send(found).unwrap());
        });
        let next = || heard.recv_timeout(std::time::Duration::from_secs(20)).unwrap();
        assert_eq!(next(), Found::Theme(Theme::Light));
        assert_eq!(next(), Found::Still(true));
        let change = |namespace: &str, key: &str, value: u32| {
            let body = (namespace, key, Value::U32(value));
            portal
                .emit_signal(None::<&str>, PATH, SETTINGS, "SettingChanged", &body)
                .unwrap();
        };
        change(NAMESPACE, "contrast", 1);
        change(NAMESPACE, KEY, 1);
        assert_eq!(next(), Found::Theme(Theme::Dark));
        change(NAMESPACE, KEY, 2);
        assert_eq!(next(), Found::Theme(Theme::Light));
        for reduced in [0, 1] {
            change(NAMESPACE, "reduced-motion", reduced);
            assert_eq!(next(), Found::Still(reduced == 1));
        }
        portal.close().unwrap();
        watching.join().unwrap();
        assert!(heard.try_recv().is_err());
    }

    #[test]
    fn without_a_preference_it_is_dark() {
        for value in [Value::U32(0), Value::U32(1), Value::U32(7), Value::from("light")] {
            assert_eq!(scheme(&value), Theme::Dark);
        }
    }
}
