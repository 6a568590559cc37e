//! Values as written on the command line: lengths, sizes and times with their units, numbers, rigs.

use std::time::Duration;

use glam::DVec3;
use mortise_rig::RigSpec;

/// Millimetres of `5um`, `5µm` or `0.005mm`.
pub fn length_mm(text: &str) -> Result<f64, String> {
    let units = [("um", 1e-3), ("µm", 1e-3), ("μm", 1e-3), ("mm", 1.0)];
    number(text, &units).ok_or_else(|| format!("`{text}` is not a length; write it as in 5um or 0.005mm"))
}

/// Bytes of `1MiB`, `512KiB` or `300000`.
pub fn bytes(text: &str) -> Result<u64, String> {
    let units = [
        ("KiB", 1024.0),
        ("MiB", 1024.0 * 1024.0),
        ("bytes", 1.0),
        ("B", 1.0),
        ("", 1.0),
    ];
    let value = number(text, &units).filter(|v| (1.0..=f64::from(u32::MAX)).contains(v));
    let value =
        value.ok_or_else(|| format!("`{text}` is not a size; write it as in 1MiB, 512KiB or 300000"))?;
    // The value is in range, and a fraction of a byte is dropped.
    Ok(value as u64)
}

/// Whole seconds of processor time: `90` or `90s`.
pub fn seconds(text: &str) -> Result<u64, String> {
    let digits = text.trim().trim_end_matches('s');
    let value = digits.parse::<u64>().ok().filter(|v| (1..=86_400).contains(v));
    value.ok_or_else(|| format!("`{text}` is not a time limit; write whole seconds from 1 to 86400"))
}

/// The value of a number followed by one of `units`.
fn number(text: &str, units: &[(&str, f64)]) -> Option<f64> {
    let text = text.trim();
    units.iter().find_map(|(unit, scale)| {
        let digits = text.strip_suffix(unit)?.trim_end();
        let value: f64 = digits.parse().ok()?;
        value.is_finite().then_some(value * scale)
    })
}

/// A delay in seconds: 0 to 3600.
pub fn delay(text: &str) -> Result<Duration, String> {
    let seconds: Option<f64> = text.parse().ok().filter(|s| (0.0..=3600.0).contains(s));
    seconds
        .map(Duration::from_secs_f64)
        .ok_or_else(|| "give a number of seconds, 0 to 3600".to_owned())
}

/// A number.
pub fn real(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| format!("`{text}` is not a number"))
}

/// A number of instructions, at least 1.
pub fn instructions(text: &str) -> Result<u64, String> {
    let value = text.parse().ok().filter(|&v| v > 0);
    value.ok_or_else(|| {
        format!("`{text}` is not a number of instructions; write a whole number, such as 120000")
    })
}

/// Unit vector of `x`, `-z`, or three numbers such as `0,0.6,-0.8`.
pub fn direction(text: &str) -> Result<DVec3, String> {
    let unsigned = text.trim();
    let unsigned = unsigned.strip_prefix(['+', '-']).unwrap_or(unsigned);
    let axis = match unsigned {
        "x" => Some(DVec3::X),
        "y" => Some(DVec3::Y),
        "z" => Some(DVec3::Z),
        _ => None,
    };
    let sign = if text.trim().starts_with('-') { -1.0 } else { 1.0 };
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let by_numbers = || match numbers?[..] {
        [x, y, z] => DVec3::new(x, y, z).try_normalize(),
        _ => None,
    };
    (axis.map(|axis| axis * sign).or_else(by_numbers)).ok_or_else(|| {
        format!("`{text}` is not a direction; write x, -z, or three numbers such as 0,0.6,-0.8")
    })
}

/// A rig.
pub fn rig(text: &str) -> Result<RigSpec, String> {
    text.parse()
        .map_err(|error: mortise_rig::SpecError| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths() {
        for text in ["5um", "5 µm", "0.005mm", "5e-3 mm"] {
            assert!((length_mm(text).unwrap() - 0.005).abs() < 1e-12, "{text}");
        }
        for text in ["5", "um", "5 m", "NaNmm", "infmm", ""] {
            assert!(length_mm(text).is_err(), "{text}");
        }
    }

    #[test]
    fn time_limits() {
        assert_eq!((seconds("1"), seconds("90s")), (Ok(1), Ok(90)));
        for text in ["", "0", "-1", "1.5", "NaN", "86401", "1e9", "s"] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }

    #[test]
    fn directions() {
        assert_eq!(direction("-z"), Ok(DVec3::NEG_Z));
        assert_eq!(direction("+x"), Ok(DVec3::X));
        let by_numbers = direction("0, 3,-4").expect("a direction");
        assert!(by_numbers.abs_diff_eq(DVec3::new(0.0, 0.6, -0.8), 1e-15));
        for text in [
            "", "w", "--z", "-", "0,0,0", "1,2", "1,2,3,4", "nan,0,0", "inf,0,0", "x,y,z",
        ] {
            assert!(direction(text).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers() {
        assert_eq!((real("0.5"), real("-1e3")), (Ok(0.5), Ok(-1e3)));
        assert_eq!(real("abc"), Err("`abc` is not a number".to_owned()));
        assert_eq!(instructions("120000"), Ok(120_000));
        for text in ["", "0", "-5", "1e5", "1.5", "120,000"] {
            assert!(instructions(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes() {
        assert_eq!(bytes("1MiB"), Ok(1 << 20));
        assert_eq!(bytes("512 KiB"), Ok(512 << 10));
        assert_eq!(
            (bytes("300000"), bytes("300000B"), bytes("300000 bytes")),
            (Ok(300_000), Ok(300_000), Ok(300_000))
        );
        for text in ["", "MiB", "-1", "0", "1e99", "1 MB", "NaN"] {
            assert!(bytes(text).is_err(), "{text}");
        }
    }
}
