//! Clocks: 480 MHz at voltage scale 0 from the internal oscillator, USB from HSI48 locked to the host's frames.
//!
//! The internal 64 MHz oscillator (±1 % over temperature) and not the 8 MHz the Nucleo's ST-LINK can supply: the loop must not depend on a debug
//! probe being powered, and a tick that is 1 % long changes velocities by 1 %, far inside every margin.

use embassy_stm32::interrupt::Priority;
use embassy_stm32::pac;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, HSIPrescaler, Hsi48Config, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk,
    VoltageScale, mux,
};

/// Processor clock of silicon revision V and X, Hz.
const FULL_HZ: u32 = 480_000_000;
/// Processor clock of older silicon, which has no voltage scale 0, Hz.
const REDUCED_HZ: u32 = 400_000_000;
/// DBGMCU_IDC.REV_ID of the first revision made for 480 MHz (0x1003 is Y, 0x2001 X, 0x2003 V).
const FIRST_FULL_REVISION: u16 = 0x2001;

fn is_full_speed_silicon() -> bool {
    pac::DBGMCU.idc().read().rev_id() >= FIRST_FULL_REVISION
}

/// The HAL's configuration, and the processor clock in Hz that it gives.
pub fn configuration() -> (embassy_stm32::Config, u32) {
    let (hz, multiplier, scale) = if is_full_speed_silicon() {
        (FULL_HZ, PllMul::MUL60, VoltageScale::Scale0)
    } else {
        (REDUCED_HZ, PllMul::MUL50, VoltageScale::Scale1)
    };

    let mut config = embassy_stm32::Config::default();
    let rcc = &mut config.rcc;
    rcc.hsi = Some(HSIPrescaler::DIV1);
    rcc.hsi48 = Some(Hsi48Config { sync_from_usb: true });
    // 64 MHz / 4 = 16 MHz, times 60 = 960 MHz, over 2 = 480 MHz.
    rcc.pll1 = Some(Pll {
        source: PllSource::HSI,
        prediv: PllPreDiv::DIV4,
        mul: multiplier,
        fracn: None,
        divp: Some(PllDiv::DIV2),
        divq: None,
        divr: None,
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.d1c_pre = AHBPrescaler::DIV1;
    // AXI and AHB 240 MHz, APB 120 MHz, timers 240 MHz.
    rcc.ahb_pre = AHBPrescaler::DIV2;
    rcc.apb1_pre = APBPrescaler::DIV2;
    rcc.apb2_pre = APBPrescaler::DIV2;
    rcc.apb3_pre = APBPrescaler::DIV2;
    rcc.apb4_pre = APBPrescaler::DIV2;
    rcc.voltage_scale = scale;
    rcc.mux.usbsel = mux::Usbsel::HSI48;
    // The HAL's default is the highest priority, above the tick.
    config.bdma_interrupt_priority = Priority::P15;
    config.dma_interrupt_priority = Priority::P15;
    config.mdma_interrupt_priority = Priority::P15;
    (config, hz)
}

/// Locks HSI48 to the frames of the port in use. The HAL selects those of the other one (OTG_HS, "USB1"), which never come, and the oscillator alone
/// is not within the 0.25 % that USB asks. After the HAL's `init`.
pub fn lock_usb_clock() {
    use embassy_stm32::pac::crs::vals::Syncsrc;
    // CRS_CFGR.SYNCSRC of OTG_FS ("USB2"): 0b11; on the older silicon 0b00 (ST's stm32h7xx_hal_rcc_ex.h).
    let source = Syncsrc::from_bits(if is_full_speed_silicon() { 0b11 } else { 0b00 });
    // The source can be changed only while the counter stands.
    pac::CRS.cr().modify(|w| w.set_cen(false));
    pac::CRS.cfgr().modify(|w| w.set_syncsrc(source));
    pac::CRS.cr().modify(|w| w.set_cen(true));
}

/// While a debugger halts the processor the watchdog stands, and the motor timer with all its outputs low.
pub fn stand_still_under_a_debugger() {
    pac::DBGMCU.apb4fzr1().modify(|w| w.set_iwdg1(true));
    pac::DBGMCU.apb2fzr1().modify(|w| w.set_tim1(true));
}
