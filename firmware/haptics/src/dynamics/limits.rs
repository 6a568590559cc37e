//! Limits on the handle's wrench, applied last before the mechanism.

use crate::io::Flags;
use crate::math::pose::Wrench;
use crate::math::vector::cut;
use crate::settings::LimitSettings;

/// The wrench passed to the mechanism: `wanted` limited in magnitude, and changed from `previous` no faster than the slew limits allow.
///
/// The magnitude limits are applied once more after the slew: they may have been lowered since `previous` was computed. A non-finite result becomes
/// zero and is flagged.
pub(crate) fn limit(
    wanted: Wrench,
    previous: Wrench,
    settings: &LimitSettings,
    period_s: f32,
    flags: &mut Flags,
) -> Wrench {
    let (force, cut_force) = cut(wanted.force, settings.force_n);
    let (torque, cut_torque) = cut(wanted.torque, settings.torque_nm);
    let (force_step, slow_force) = cut(force - previous.force, settings.force_slew_n_per_s * period_s);
    let (torque_step, slow_torque) = cut(torque - previous.torque, settings.torque_slew_nm_per_s * period_s);
    // Without slew limiting the value itself is used: previous + (wanted − previous) may differ by a rounding.
    let force = if slow_force {
        previous.force + force_step
    } else {
        force
    };
    let torque = if slow_torque {
        previous.torque + torque_step
    } else {
        torque
    };
    let out = Wrench {
        force: cut(force, settings.force_n).0,
        torque: cut(torque, settings.torque_nm).0,
    };
    flags.insert_if(cut_force, Flags::FORCE_LIMIT);
    flags.insert_if(cut_torque, Flags::TORQUE_LIMIT);
    flags.insert_if(slow_force, Flags::FORCE_SLEW);
    flags.insert_if(slow_torque, Flags::TORQUE_SLEW);
    if out.is_finite() {
        out
    } else {
        flags.insert(Flags::NON_FINITE);
        Wrench::ZERO
    }
}
