//! Mortise on an STM32H743ZI Nucleo.
//!
//! | priority | what |
//! |---|---|
//! | hardware | stop input, processor lock-up, low supply: outputs off through the timer ([`motors`]) |
//! | 16 | stop input again, by interrupt: the same switch by software |
//! | 15 | the tick, 1 kHz ([`tick_timer`]): control plane, watchdog |
//! | low | USB interrupt |
//! | idle | embassy executor: USB and link plane ([`usb`], [`link`]) |
#![no_std]
#![no_main]
#![deny(unsafe_op_in_unsafe_fn)]

use cortex_m_rt as _;
#[cfg(feature = "rtt")]
use defmt_rtt as _;

mod clocks;
mod crash;
mod critical;
mod encoders;
mod entropy;
mod flash;
mod link;
#[cfg(not(feature = "rtt"))]
mod log;
mod mechanism;
mod memory;
mod motors;
mod reset;
mod tick_timer;
mod usb;
mod watchdog;

/// The board's name in [`mortise_firmware::board::Identity`].
const BOARD: &str = "nucleo-h743zi";
/// Ticks missed in a row, motors live, that are a fault.
const OVERRUN_TICKS: u8 = 2;

#[rtic::app(device = embassy_stm32::pac, peripherals = false)]
mod app {
    use core::sync::atomic::{AtomicBool, Ordering};

    use embassy_executor::raw;
    use embassy_stm32::interrupt::{InterruptExt, Priority};
    use embassy_stm32::pac;
    use mortise_firmware::board::Identity;
    use mortise_firmware::channel::Channels;
    use mortise_firmware::control::ControlPlane;
    use mortise_firmware::device::start;
    use mortise_firmware::store;
    use mortise_mechanism::ceilings::Ceilings;
    use mortise_protocol::message::CostUnit;
    use nucleo_h743zi::boot::{Crash, reset_reason};
    use static_cell::{ConstStaticCell, StaticCell};

    use crate::critical::{STOP_PRIORITY, TICK_PRIORITY};
    use crate::encoders::Encoders;
    use crate::flash::{SlotFlash, erasing};
    use crate::link::{self, Link};
    use crate::mechanism::Device;
    use crate::motors::{self, Motors};
    use crate::tick_timer::{self, Cycles};
    use crate::usb::{InPipe, OutPipe, Port};
    use crate::watchdog::Watchdog;
    use crate::{BOARD, OVERRUN_TICKS, clocks, crash, encoders, entropy, memory, reset};

    type Control = ControlPlane<'static, 'static, Device, Cycles>;

    /// A tick has run since `idle` last looked.
    static TICK_RAN: AtomicBool = AtomicBool::new(false);
    /// The executor has work.
    static PENDING: AtomicBool = AtomicBool::new(true);

    /// Called by the executor's wakers, also from interrupts.
    // SAFETY: the name and signature embassy-executor calls; defined once.
    #[unsafe(export_name = "__pender")]
    fn pender(_context: *mut ()) {
        PENDING.store(true, Ordering::Release);
    }

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        control: &'static mut Control,
        watchdog: Watchdog,
        link: Option<(Link, Port)>,
    }

    #[init]
    fn init(cx: init::Context) -> (Shared, Local) {
        static CHANNELS: ConstStaticCell<Channels<'static>> = ConstStaticCell::new(Channels::new());
        static CONTROL: StaticCell<Control> = StaticCell::new();

        let mut core = cx.core;
        memory::protect_and_cache(&mut core);
        let flags = reset::take_flags();
        let last_crash = crash::take(flags.power_on || flags.brown_out);

        let (config, core_hz) = clocks::configuration();
        let p = embassy_stm32::init(config);
        clocks::lock_usb_clock();
        // HAL interrupts start at the highest priority.
        embassy_stm32::interrupt::OTG_FS.set_priority(Priority::P14);
        // While a debugger halts the processor the watchdog stands, and the motor timer with all its outputs low.
        pac::DBGMCU.apb4fzr1().modify(|w| w.set_iwdg1(true));
        pac::DBGMCU.apb2fzr1().modify(|w| w.set_tim1(true));

        let motors = Motors::new(
            p.TIM1,
            motors::Pins {
                pwm_a: p.PE9,
                pwm_b: p.PE11,
                pwm_c: p.PE13,
                enable: p.PE14,
                stop: p.PE15,
                direction_a: p.PF13,
                direction_b: p.PF14,
                direction_c: p.PF15,
                fault_a: p.PE7,
                fault_b: p.PE8,
                fault_c: p.PE10,
            },
        );
        motors::listen_to_stop();
        let encoders = Encoders::new(
            p.TIM4,
            p.TIM3,
            p.TIM8,
            encoders::Pins {
                base_a: p.PD12,
                base_b: p.PD13,
                upper_a: p.PB4,
                upper_b: p.PB5,
                lower_a: p.PC6,
                lower_b: p.PC7,
            },
        );
        let clock = Cycles::new(p.TIM7, core_hz, &mut core.DCB, &mut core.DWT);
        let flash = SlotFlash::new(p.FLASH, core_hz);
        let kept = store::rig::kept(&flash);
        let rig = kept.rig();

        let identity = Identity {
            board: BOARD,
            force_axes: rig.map_or(0, |rig| rig.joints.len() as u8),
            torque_axes: 0,
            cost_unit: CostUnit::Cycles,
            cost_budget: core_hz / 1000,
            reset: reset_reason(flags, last_crash),
            overrun_ticks: OVERRUN_TICKS,
            ceilings: rig.map_or(Ceilings::LARGEST, Ceilings::of),
            entropy: entropy::entropy(),
        };
        let (plane, control) = start(
            CHANNELS.take(),
            flash,
            Device::new(encoders, motors, rig),
            clock,
            identity,
        );
        match last_crash {
            Some(Crash::Panic { line }) => defmt::error!("restarted after a panic in line {}", line),
            Some(Crash::HardFault { pc, status }) => {
                defmt::error!("restarted after a fault at {:#010x}, CFSR {:#010x}", pc, status);
            }
            None => defmt::info!("started at {} MHz", core_hz / 1_000_000),
        }

        let port = Port::new(p.USB_OTG_FS, p.PA12, p.PA11);
        let watchdog = Watchdog::start(p.IWDG1);
        tick_timer::start();
        (
            Shared {},
            Local {
                control: CONTROL.init(control),
                watchdog,
                link: Some((plane, port)),
            },
        )
    }

    /// One millisecond. Budget 480,000 cycles; a longer tick is counted as missed ones, two in a row with live motors are a fault, five reset the board.
    /// Uses no critical section (see [`crate::critical`]).
    #[task(binds = TIM7, priority = 15, local = [control, watchdog])]
    fn tick(cx: tick::Context) {
        const { assert!(TICK_PRIORITY == 15) };
        tick_timer::acknowledge();
        if erasing() {
            // Scenes must not be read now. The application erases only while motors are off; this makes sure.
            motors::release();
            tick_timer::skip();
        } else {
            cx.local.control.tick();
        }
        // Live outputs in a state without motors: cut them, and let the watchdog start anew.
        if motors::outputs_on() && !cx.local.control.safety().live() {
            motors::cut();
        } else {
            cx.local.watchdog.feed();
        }
        tick_timer::finish();
        TICK_RAN.store(true, Ordering::Release);
    }

    /// The stop contact opened. The timer has cut the outputs already; this does it again by another way. The next tick sees the input itself.
    #[task(binds = EXTI15_10, priority = 16)]
    fn stop(_cx: stop::Context) {
        const { assert!(STOP_PRIORITY == 16) };
        motors::release();
        motors::acknowledge_stop();
    }

    #[idle(local = [link])]
    fn idle(cx: idle::Context) -> ! {
        static EXECUTOR: StaticCell<raw::Executor> = StaticCell::new();
        static INCOMING: StaticCell<InPipe> = StaticCell::new();
        static OUTGOING: StaticCell<OutPipe> = StaticCell::new();

        memory::repaint_stack();
        let executor = EXECUTOR.init_with(|| raw::Executor::new(core::ptr::null_mut()));
        let spawner = executor.spawner();
        let incoming = INCOMING.init_with(InPipe::new);
        let outgoing = OUTGOING.init_with(OutPipe::new);
        if let Some((plane, port)) = cx.local.link.take() {
            port.spawn(spawner, incoming, outgoing);
            if let Ok(task) = link::run(plane, incoming, outgoing) {
                spawner.spawn(task);
            }
        }
        loop {
            if TICK_RAN.swap(false, Ordering::AcqRel) {
                link::TICKED.signal(());
            }
            PENDING.store(false, Ordering::Release);
            // SAFETY: only here, never from within a task.
            unsafe { executor.poll() };
            // With interrupts masked nothing can come between the check and the sleep; a pending interrupt still ends the sleep.
            cortex_m::interrupt::disable();
            if !PENDING.load(Ordering::Acquire) && !TICK_RAN.load(Ordering::Acquire) {
                cortex_m::asm::wfi();
            }
            // SAFETY: ends the section opened three lines above.
            unsafe { cortex_m::interrupt::enable() };
        }
    }
}
