//! Mortise on an STM32H743ZI Nucleo.
//!
//! | priority | what |
//! |---|---|
//! | hardware | stop input, processor lock-up, low supply: outputs off through the timer ([`stm32h743::motors`]) |
//! | 16 | stop input again, by interrupt: the same switch by software |
//! | 15 | the tick, 1 kHz ([`stm32h743::tick_timer`]): control plane, watchdog |
//! | low | USB interrupt |
//! | idle | embassy executor: USB and link plane ([`stm32h743::usb`], [`stm32h743::link`]) |
//!
//! | signal | pin | Zio | device |
//! |---|---|---|---|
//! | encoder of joint 1: A, B | PD12, PD13 | D29, D28 | TIM4 |
//! | encoder of joint 2: A, B | PB4, PB5 | D25, D22 | TIM3 |
//! | encoder of joint 3: A, B | PC6, PC7 | D16, D21 | TIM8 |
//! | PWM of motors 1, 2, 3 | PE9, PE11, PE13 | D6, D5, D3 | TIM1, channels 1 to 3 |
//! | enable | PE14 | D38 | TIM1, channel 4 |
//! | stop | PE15 | D37 | TIM1, break input |
//! | directions 1, 2, 3 | PF13, PF14, PF15 | D7, D4, D2 | |
//! | driver faults 1, 2, 3 | PE7, PE8, PE10 | D41, D42, D40 | |
//!
//! What each line needs outside of the board: [`stm32h743::motors`].
#![no_std]
#![no_main]
#![deny(unsafe_op_in_unsafe_fn)]

use cortex_m_rt as _;
#[cfg(feature = "rtt")]
use defmt_rtt as _;

use embassy_stm32::pac::GPIOE;
use mortise_protocol::label::Label;
use stm32h743::motor_timer::{self, EnablePin};

/// The board's name in [`mortise_firmware::board::Identity`].
const BOARD: &str = "nucleo-h743zi";
/// What a program that writes this firmware to a board reads from the file first.
// SAFETY: the name is defined once, and nothing of this name is called.
#[unsafe(no_mangle)]
#[used]
static MORTISE_FIRMWARE: Label = Label::new(BOARD, "STM32H743ZITx");
/// Ticks missed in a row, motors live, that are a fault.
const OVERRUN_TICKS: u8 = 2;
/// PE14.
const ENABLE: EnablePin = (GPIOE, 14);

/// See [`mortise_board::crash`].
// SAFETY: the hook's name and signature; defined once.
#[unsafe(no_mangle)]
fn mortise_cut_motors() {
    motor_timer::cut(ENABLE);
}

#[rtic::app(device = embassy_stm32::pac, peripherals = false)]
mod app {
    use embassy_stm32::interrupt::{InterruptExt, Priority};
    use mortise_board::device::Device;
    use mortise_board::start::announce;
    use mortise_board::{crash, executor, stack};
    use mortise_firmware::board::Identity;
    use mortise_firmware::channel::Channels;
    use mortise_firmware::control::ControlPlane;
    use mortise_firmware::device::start;
    use mortise_firmware::store;
    use mortise_mechanism::hardware_limits::HardwareLimits;
    use mortise_protocol::message::{CostUnit, ResetReason};
    use mortise_protocol::rig::Rig;
    use static_cell::{ConstStaticCell, StaticCell};
    use stm32h743::boot::reset_reason;
    use stm32h743::critical::{STOP_PRIORITY, TICK_PRIORITY};
    use stm32h743::encoders::Encoder;
    use stm32h743::flash::{SlotFlash, erasing};
    use stm32h743::hardware::Wired;
    use stm32h743::link::{self, Link};
    use stm32h743::motor_timer::MotorTimer;
    use stm32h743::motors::{Lines, Motors, direction, driver_fault};
    use stm32h743::stop_input::StopLine;
    use stm32h743::tick_timer::{self, Cycles};
    use stm32h743::usb::{InPipe, OutPipe, Port};
    use stm32h743::watchdog::Watchdog;
    use stm32h743::{clocks, entropy, memory, motor_timer, reset};

    use crate::{BOARD, ENABLE, OVERRUN_TICKS};

    type Control = ControlPlane<'static, 'static, Device<Wired>, Cycles>;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        control: &'static mut Control,
        watchdog: Watchdog,
        stop_line: StopLine,
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
        clocks::stand_still_under_a_debugger();

        let timer = MotorTimer::new(p.TIM1);
        let lines = Lines {
            pwm: (timer.line(p.PE9), timer.line(p.PE11), timer.line(p.PE13)),
            enable: timer.line(p.PE14),
            stop: timer.stop_input(p.PE15),
            directions: [direction(p.PF13), direction(p.PF14), direction(p.PF15)],
            faults: [driver_fault(p.PE7), driver_fault(p.PE8), driver_fault(p.PE10)],
        };
        let stop_line = lines.stop.line();
        let motors = Motors::new(timer, lines);
        stop_line.listen();
        let encoders = [
            Encoder::new(p.TIM4, p.PD12, p.PD13),
            Encoder::new(p.TIM3, p.PB4, p.PB5),
            Encoder::new(p.TIM8, p.PC6, p.PC7),
        ];
        let clock = Cycles::new(p.TIM7, core_hz, &mut core.DCB, &mut core.DWT);
        let flash = SlotFlash::new(p.FLASH, core_hz);
        let kept = store::rig::kept(&flash);
        let rig = kept.rig();

        let identity = identity(rig, core_hz, reset_reason(flags, last_crash));
        let (plane, control) = start(
            CHANNELS.take(),
            flash,
            Device::new(Wired { encoders, motors }, rig),
            clock,
            identity,
        );
        announce(identity.reset, last_crash, &plane);

        let port = Port::new(p.USB_OTG_FS, p.PA12, p.PA11);
        let watchdog = Watchdog::start(p.IWDG1);
        tick_timer::start();
        (
            Shared {},
            Local {
                control: CONTROL.init(control),
                watchdog,
                stop_line,
                link: Some((plane, port)),
            },
        )
    }

    fn identity(rig: Option<&Rig>, core_hz: u32, reset: ResetReason) -> Identity {
        Identity {
            board: BOARD,
            force_axes: rig.map_or(0, |rig| rig.joints.len() as u8),
            torque_axes: 0,
            cost_unit: CostUnit::Cycles,
            cost_budget: core_hz / 1000,
            reset,
            overrun_ticks: OVERRUN_TICKS,
            hardware_limits: rig.map_or(HardwareLimits::LARGEST, HardwareLimits::of),
            entropy: entropy::entropy(),
        }
    }

    /// One millisecond. Budget 480,000 cycles; a longer tick is counted as missed ones, two in a row with live motors are a fault, five reset the board.
    /// Uses no critical section (see [`stm32h743::critical`]).
    #[task(binds = TIM7, priority = 15, local = [control, watchdog])]
    fn tick(cx: tick::Context) {
        const { assert!(TICK_PRIORITY == 15) };
        tick_timer::acknowledge();
        if erasing() {
            // Scenes must not be read now. The application erases only while motors are off; this makes sure.
            motor_timer::release();
            tick_timer::skip();
        } else {
            cx.local.control.tick();
        }
        // Live outputs in a state without motors: cut them, and let the watchdog start anew.
        if motor_timer::outputs_on() && !cx.local.control.safety().live() {
            motor_timer::cut(ENABLE);
        } else {
            cx.local.watchdog.feed();
        }
        tick_timer::finish();
        executor::note();
    }

    /// The stop contact opened. The timer has cut the outputs already; this does it again by another way. The next tick sees the input itself.
    #[task(binds = EXTI15_10, priority = 16, local = [stop_line])]
    fn stop(cx: stop::Context) {
        const { assert!(STOP_PRIORITY == 16) };
        motor_timer::release();
        cx.local.stop_line.acknowledge();
    }

    #[idle(local = [link])]
    fn idle(cx: idle::Context) -> ! {
        static INCOMING: StaticCell<InPipe> = StaticCell::new();
        static OUTGOING: StaticCell<OutPipe> = StaticCell::new();

        stack::repaint();
        let incoming = INCOMING.init_with(InPipe::new);
        let outgoing = OUTGOING.init_with(OutPipe::new);
        let ends = cx.local.link.take();
        executor::run(|spawner| {
            if let Some((plane, port)) = ends {
                port.spawn(spawner, incoming, outgoing);
                if let Ok(task) = link::run(plane, incoming, outgoing) {
                    spawner.spawn(task);
                }
            }
        })
    }
}
