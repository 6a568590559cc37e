//! Dark or light theme on Linux, which the window library cannot determine there. Source: the settings portal of freedesktop.org,
//! `color-scheme` of `org.freedesktop.appearance` (1 dark, 2 light, 0 no preference), read at the start and followed from then on.

use egui::Theme;
use zbus::blocking::{Connection, Proxy};
use zbus::zvariant::{OwnedValue, Value};

const PORTAL: &str = "org.freedesktop.portal.Desktop";
const PATH: &str = "/org/freedesktop/portal/desktop";
const SETTINGS: &str = "org.freedesktop.portal.Settings";
const NAMESPACE: &str = "org.freedesktop.appearance";
const KEY: &str = "color-scheme";

/// Follows the desktop's theme on a thread of its own. A portal may answer late or be absent; the theme then stays as it is.
pub fn follow(ctx: &egui::Context) {
    let ctx = ctx.clone();
    let mut show = move |theme| {
        ctx.options_mut(|options| options.fallback_theme = theme);
        ctx.request_repaint();
    };
    let watch = move || {
        // Without a bus or a portal there is no theme to follow, which is not an error.
        let _ = Connection::session().and_then(|bus| watch(&bus, &mut show));
    };
    // If the thread cannot start, the theme stays as it is.
    let _ = std::thread::Builder::new().name("appearance".into()).spawn(watch);
}

/// Calls `show` with the current theme and with each later one, until the connection ends.
fn watch(bus: &Connection, show: &mut dyn FnMut(Theme)) -> zbus::Result<()> {
    let settings = Proxy::new(bus, PORTAL, PATH, SETTINGS)?;
    // Subscribe before reading, so that no change between the two is lost.
    let changes = settings.receive_signal("SettingChanged")?;
    // Portals before version 2 offer only `Read`, which wraps its answer twice.
    let now: Result<OwnedValue, _> = settings.call("ReadOne", &(NAMESPACE, KEY));
    let now = now.or_else(|_| settings.call("Read", &(NAMESPACE, KEY)))?;
    show(theme(&now));
    for change in changes {
        let body = change.body();
        let (namespace, key, value): (&str, &str, Value<'_>) = body.deserialize()?;
        if (namespace, key) == (NAMESPACE, KEY) {
            show(theme(&value));
        }
    }
    Ok(())
}

/// The theme for a portal's value; dark without a preference, which is the program's default.
fn theme(value: &Value<'_>) -> Theme {
    match value {
        Value::Value(inner) => theme(inner),
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
        fn read(&self, namespace: &str, key: &str) -> Value<'static> {
            assert_eq!((namespace, key), (NAMESPACE, KEY));
            Value::Value(Box::new(Value::U32(self.scheme)))
        }
    }

    /// A version-1 portal at the other end of a socket: the theme is read and followed.
    #[test]
    fn the_theme_is_read_and_followed() {
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
            let _ = watch(&bus, &mut |theme| reported.send(theme).unwrap());
        });
        let next = || heard.recv_timeout(std::time::Duration::from_secs(20)).unwrap();
        assert_eq!(next(), Theme::Light);
        let change = |namespace: &str, key: &str, scheme: u32| {
            let body = (namespace, key, Value::U32(scheme));
            portal
                .emit_signal(None::<&str>, PATH, SETTINGS, "SettingChanged", &body)
                .unwrap();
        };
        change(NAMESPACE, "contrast", 1);
        change(NAMESPACE, KEY, 1);
        assert_eq!(next(), Theme::Dark);
        change(NAMESPACE, KEY, 2);
        assert_eq!(next(), Theme::Light);
        portal.close().unwrap();
        watching.join().unwrap();
        assert!(heard.try_recv().is_err());
    }

    #[test]
    fn without_a_preference_it_is_dark() {
        for value in [Value::U32(0), Value::U32(1), Value::U32(7), Value::from("light")] {
            assert_eq!(theme(&value), Theme::Dark);
        }
    }
}
