//! Faults of a board: the one list from control plane to window.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Declares [`Fault`] and, from the same list, every variant of it.
macro_rules! faults {
    ($(#[$about:meta])+ pub enum Fault {
        $($(#[$doc:meta])+ $name:ident $({ $(#[$field_doc:meta])+ $field:ident: $type:ty, })?,)+
    }) => {
        $(#[$about])+
        pub enum Fault {
            $($(#[$doc])+ $name $({ $(#[$field_doc])+ $field: $type })?,)+
        }

        impl Fault {
            /// Number of kinds.
            pub const COUNT: usize = [$(stringify!($name)),+].len();

            /// One fault of every kind, in the order of the enum; those with an axis or a time have `number` there.
            pub const fn every(number: u16) -> [Self; Self::COUNT] {
                [$(Self::$name $({ $field: number as $type })?),+]
            }
        }
    };
}

faults! {
    /// Kind of fault.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
    pub enum Fault {
        /// The stop input is open.
        StopInput,
        /// No message from the host for too long while armed.
        HostSilent {
            /// Time since the last message, ms.
            silent_ms: u16,
        },
        /// An encoder reading jumped farther than the mechanism can move in a tick.
        EncoderJump {
            /// Axis.
            axis: u8,
        },
        /// An encoder did not follow a small push of its motor: it is stuck or unplugged, or the mechanism is jammed.
        EncoderStuck {
            /// Axis.
            axis: u8,
        },
        /// The handle moves faster than allowed.
        OverSpeed,
        /// The handle left the workspace.
        Workspace,
        /// A motor driver reports a fault without its kind.
        Driver {
            /// Axis.
            axis: u8,
        },
        /// A motor driver reports overcurrent.
        OverCurrent {
            /// Axis.
            axis: u8,
        },
        /// A motor or its driver is too hot.
        OverTemperature {
            /// Axis.
            axis: u8,
        },
        /// The supply fell below the needs of motors and sensors; the processor still runs.
        SupplyLow,
        /// A tick took longer than its period.
        TickOverrun,
        /// The scene no longer passes its checks.
        SceneDamaged,
        /// The computed wrench is not finite.
        NonFinite,
        /// The handle turns faster than allowed.
        AngularOverSpeed,
        /// The encoders have lost their reference, although none of them jumped.
        ReferenceLost,
        /// The encoders give a position that the links cannot reach.
        ImpossiblePosture,
        /// A sensor reading is not finite, or implausible.
        BadReading,
    }
}
