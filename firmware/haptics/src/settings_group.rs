//! Declaration of groups of settings: each setting with its meaning, unit, default, range, and the parameter of the protocol that drives it.

use core::fmt;

use mortise_protocol::parameter::{PARAMETERS, ParameterId};

/// Declares a group of settings, a field of each in one of two forms:
///
/// * `field: type <- Parameter, min => max;`: driven by that parameter of the protocol, of which it has its default;
/// * `field: type = default, min => max;`: without a parameter.
///
/// Without a range any value is accepted. `validate` checks the ranges, `adopt` takes the values of parameters, and `PARAMETERS` lists them.
#[macro_export]
macro_rules! settings_group {
    ($(#[$about:meta])* $group:ident: $path:literal {
        $($(#[$doc:meta])* $field:ident: $type:ident $(<- $parameter:ident)? $(= $default:expr)? $(, $min:expr => $max:expr)?;)+
    }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $group {
            $(
                $(#[$doc])*
                ///
                #[doc = concat!(
                    $("Driven by the parameter `", stringify!($parameter), "`, whose default it has",)?
                    $("Default `", stringify!($default), "`",)?
                    $("; from `", stringify!($min), "` to `", stringify!($max), "`",)?
                    "."
                )]
                pub $field: $type,
            )+
        }

        impl $group {
            /// Parameters that drive settings of this group.
            pub const PARAMETERS: &'static [$crate::ParameterId] = &[$($($crate::ParameterId::$parameter,)?)+];

            /// Sets every setting that a parameter drives to that parameter's value.
            #[allow(unused_variables, reason = "a group may have no parameter")]
            pub fn adopt(&mut self, value: &impl Fn($crate::ParameterId) -> f32) {
                $($(self.$field = $crate::FromParameter::from_parameter(value($crate::ParameterId::$parameter));)?)+
            }

            /// Checks every number against its range.
            ///
            /// # Errors
            /// The first that is outside its range or not a number.
            pub fn validate(&self) -> Result<(), $crate::SettingsError> {
                $($($crate::Range { min: $min as f32, max: $max as f32 }
                    .check(concat!($path, ".", stringify!($field)), self.$field as f32)?;)?)+
                Ok(())
            }
        }

        impl Default for $group {
            fn default() -> Self {
                Self {
                    $($field: {
                        $($crate::FromParameter::from_parameter($crate::ParameterId::$parameter.row().default))?
                        $($default)?
                    },)+
                }
            }
        }
    };
}

/// A setting's value from that of the parameter that drives it.
pub trait FromParameter {
    /// The value; a choice is the one whose number is nearest.
    fn from_parameter(value: f32) -> Self;
}

impl FromParameter for f32 {
    fn from_parameter(value: f32) -> Self {
        value
    }
}

impl FromParameter for u32 {
    /// The whole part.
    fn from_parameter(value: f32) -> Self {
        value as Self
    }
}

impl FromParameter for bool {
    fn from_parameter(value: f32) -> Self {
        value >= 0.5
    }
}

/// Inclusive range of a setting, in the setting's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest value accepted.
    pub min: f32,
    /// Largest value accepted.
    pub max: f32,
}

impl Range {
    /// Checks the value of the setting `name`.
    ///
    /// # Errors
    /// When it lies outside or is not a number.
    pub fn check(self, name: &'static str, value: f32) -> Result<(), SettingsError> {
        // A comparison with NaN is false, so NaN is refused too.
        if value >= self.min && value <= self.max {
            Ok(())
        } else {
            Err(SettingsError {
                name,
                value,
                range: self,
            })
        }
    }
}

/// A setting that was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettingsError {
    /// Its group and name, e.g. `coupling.k_t_n_per_m`.
    pub name: &'static str,
    /// The value refused.
    pub value: f32,
    /// The accepted range.
    pub range: Range,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is {}: choose a value from {} to {}",
            self.name, self.value, self.range.min, self.range.max
        )
    }
}

impl core::error::Error for SettingsError {}

/// True if every parameter of the protocol is once in one of the groups of one of these lists. For an assertion at compile time.
pub const fn each_parameter_drives_one_setting(lists: &[&[&[ParameterId]]]) -> bool {
    let mut parameter = 0;
    while parameter < PARAMETERS.len() {
        let (mut found, mut list) = (0, 0);
        while list < lists.len() {
            let mut group = 0;
            while group < lists[list].len() {
                found += occurrences(lists[list][group], parameter);
                group += 1;
            }
            list += 1;
        }
        if found != 1 {
            return false;
        }
        parameter += 1;
    }
    true
}

/// How often a parameter, by its place in the table, is in a group.
const fn occurrences(group: &[ParameterId], parameter: usize) -> usize {
    let (mut found, mut at) = (0, 0);
    while at < group.len() {
        found += (group[at] as usize == parameter) as usize;
        at += 1;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    crate::settings_group! {
        /// For these tests.
        Two: "two" {
            /// Driven.
            driven: f32 <- ObjectMass, 0.01 => 10.0;
            /// Not driven.
            own: u32 = 3, 1 => 4;
        }
    }

    #[test]
    fn a_driven_setting_follows_its_parameter_and_no_other_does() {
        assert_eq!(Two::PARAMETERS, [ParameterId::ObjectMass]);
        let mut two = Two::default();
        assert_eq!(two.driven, ParameterId::ObjectMass.row().default);
        assert_eq!(two.own, 3);
        two.adopt(&|id| id as usize as f32);
        assert_eq!(two.driven, ParameterId::ObjectMass as usize as f32);
        assert_eq!(two.own, 3);
        two.own = 5;
        assert_eq!(two.validate().map_err(|error| error.name), Err("two.own"));
        two.driven = f32::NAN;
        assert_eq!(two.validate().map_err(|error| error.name), Err("two.driven"));
    }

    #[test]
    fn a_parameter_left_out_or_driving_two_settings_is_found() {
        let all: &[ParameterId] = &core::array::from_fn::<_, { PARAMETERS.len() }, _>(|at| PARAMETERS[at].id);
        assert!(each_parameter_drives_one_setting(&[&[all]]));
        assert!(each_parameter_drives_one_setting(&[
            &[&all[3..9], &all[..3]],
            &[&all[9..]]
        ]));
        assert!(!each_parameter_drives_one_setting(&[&[&all[1..]]]));
        assert!(!each_parameter_drives_one_setting(&[&[all], &[&all[5..6]]]));
    }
}
