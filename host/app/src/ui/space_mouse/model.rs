//! Models of SpaceMice: which devices are one, and which rule lets the user read it.
//!
//! Source of the numbers: dev.c of spacenavd 1.3.1.

/// A vendor's and a product's number.
pub(super) type Id = (u16, u16);

/// Logitech, under whose number older models are sold, beside mice and keyboards.
const LOGITECH: u16 = 0x046d;
const THREE_D_CONNEXION: u16 = 0x256f;
/// Usage of the device in its report descriptor: generic desktop, multi-axis controller. A mouse has 2, a keyboard 6.
const USAGE: (u16, u16) = (1, 8);

/// SpaceTraveler, SpacePilot, SpaceNavigator, SpaceExplorer, SpaceNavigator for Notebooks, SpacePilot Pro, SpaceMouse Pro.
const OF_LOGITECH: [u16; 7] = [0xc623, 0xc625, 0xc626, 0xc627, 0xc628, 0xc629, 0xc62b];
/// Models whose keys 1 and 2 are the buttons 0 and 1, bits 12 and 13 of their reports: SpaceMouse Pro, Pro Wireless in three forms, Enterprise.
const WITH_KEYS: [Id; 5] = [
    (LOGITECH, 0xc62b),
    (THREE_D_CONNEXION, 0xc631),
    (THREE_D_CONNEXION, 0xc632),
    (THREE_D_CONNEXION, 0xc633),
    (THREE_D_CONNEXION, 0xc638),
];

/// Whether a device is a SpaceMouse. Of 3Dconnexion every device with six axes is one, of Logitech the known ones alone.
pub(super) fn is_space_mouse((vendor, product): Id, usage: (u16, u16)) -> bool {
    let is_known = vendor == THREE_D_CONNEXION || vendor == LOGITECH && OF_LOGITECH.contains(&product);
    is_known && usage == USAGE
}

/// Bit of button 0 in the reports of a model.
pub(super) fn first_button(id: Id) -> u32 {
    if WITH_KEYS.contains(&id) { 12 } else { 0 }
}

/// The rule of udev that lets the user who sits at the machine read a device, plugged in or by Bluetooth. Source: `uaccess` in 73-seat-late.rules of systemd,
/// before which the rule must be; the kernel names the device `BUS:VENDOR:PRODUCT.INSTANCE`.
pub(super) fn rule((vendor, product): Id) -> String {
    format!(r#"SUBSYSTEM=="hidraw", KERNELS=="*:{vendor:04X}:{product:04X}.*", TAG+="uaccess""#)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mice_and_keyboards_are_no_space_mice() {
        assert!(is_space_mouse((0x046d, 0xc626), (1, 8)), "SpaceNavigator");
        assert!(is_space_mouse((0x256f, 0xc635), (1, 8)), "SpaceMouse Compact");
        assert!(is_space_mouse((0x256f, 0xffff), (1, 8)), "a later model");
        for (id, usage) in [
            ((0x046d, 0xc626), (1, 2)),
            ((0x256f, 0xc652), (1, 2)),
            ((0x256f, 0xc664), (1, 6)),
            ((0x046d, 0xc077), (1, 2)),
            ((0x046d, 0xc077), (1, 8)),
            ((0x1234, 0xc626), (1, 8)),
            ((0x256f, 0xc635), (0xff00, 8)),
        ] {
            assert!(!is_space_mouse(id, usage), "{id:x?} {usage:?}");
        }
    }

    /// The package lets users read every model that has a name here.
    #[test]
    fn the_packaged_rules_are_those_that_messages_name() {
        let path = "package/70-mortise-space-mouse.rules";
        let text =
            std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap();
        let rules: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        let of_logitech = OF_LOGITECH.map(|product| (LOGITECH, product));
        for id in of_logitech.into_iter().chain(WITH_KEYS) {
            assert!(rules.contains(&rule(id).as_str()), "{id:x?}");
        }
        let of_logitech = rules.iter().filter(|line| line.contains("046D"));
        assert_eq!(
            of_logitech.count(),
            OF_LOGITECH.len(),
            "no other device of Logitech"
        );
        for line in rules {
            let (vendor, product) = line
                .split_once("*:")
                .and_then(|(_, rest)| rest.split_once(".*"))
                .and_then(|(id, _)| id.split_once(':'))
                .unwrap_or_else(|| panic!("{line}"));
            let number = |text| u16::from_str_radix(text, 16).unwrap();
            assert_eq!(line, rule((number(vendor), number(product))));
        }
    }
}
