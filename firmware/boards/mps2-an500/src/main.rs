//! Mortise on QEMU's `mps2-an500`: a Cortex-M7 with simulated mechanism and hand.
//!
//! | context | priority | what |
//! |---|---|---|
//! | `TIMER0` | 3 | the tick: [`ControlPlane::tick`] and nothing else. Budget 500,000 instructions ([`timer::BUDGET`]) |
//! | `UART0RX` | 2 | a received byte into the pipe |
//! | `UART0TX` | 1 | the sender is empty: wakes |
//! | idle | 0 | embassy executor: the link |
#![no_std]
#![no_main]

use cortex_m_rt as _;
use mps2::{motors, timer};

defmt::timestamp!("{=u32:ms}", timer::milliseconds());

/// See [`mortise_board::crash`].
// SAFETY: the hook's name and signature; defined once.
#[unsafe(no_mangle)]
fn mortise_cut_motors() {
    motors::off();
}

#[rtic::app(device = mps2, peripherals = false)]
mod app {
    use heapless::spsc::{Consumer, Producer, Queue};
    use mortise_board::record::Crash;
    use mortise_board::start::announce;
    use mortise_board::{crash, executor};
    use mortise_firmware::board::Identity;
    use mortise_firmware::channel::Channels;
    use mortise_firmware::control::{ControlPlane, Ticked};
    use mortise_firmware::device::start;
    use mortise_firmware::store;
    use mortise_mechanism::hardware_limits::HardwareLimits;
    use mortise_protocol::message::{CostUnit, ResetReason};
    use mps2::Interrupt;
    use mps2::link::{self, Link};
    use mps2::motors::Motors;
    use mps2::timer::{self, TickClock};
    use mps2::{memory, uart};

    type Control = ControlPlane<'static, 'static, Motors, TickClock>;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        control: Control,
        link: Option<Link>,
        bytes_in: Producer<'static, u8>,
        bytes_out: Option<Consumer<'static, u8>>,
    }

    #[init(local = [
        channels: Channels<'static> = Channels::new(),
        bytes: Queue<u8, { uart::RECEIVED + 1 }> = Queue::new(),
    ])]
    fn init(mut cx: init::Context) -> (Shared, Local) {
        memory::guard_stack(&mut cx.core.MPU);
        // SAFETY: the only call.
        let flash = unsafe { memory::scene_flash() };
        let kept = store::rig::kept(&flash);
        let rig = kept.rig();
        // QEMU's chip has no reset flags.
        let last_crash = crash::take(false);
        let identity = Identity {
            board: "mps2-an500",
            force_axes: rig.map_or(3, |rig| rig.joints.len() as u8),
            // A described wrist is passive.
            torque_axes: if rig.is_some() { 0 } else { 3 },
            cost_unit: CostUnit::Instructions,
            cost_budget: timer::BUDGET,
            reset: last_crash.map_or(ResetReason::PowerOn, Crash::reason),
            // The simulated mechanism stands still between ticks: late ticks are counted and do no harm.
            overrun_ticks: 0,
            hardware_limits: rig.map_or(HardwareLimits::LARGEST, HardwareLimits::of),
            // QEMU's chip has no random numbers; each of its runs has a line of its own, on which frames of another run cannot come.
            entropy: memory::starts().into(),
        };
        let (bytes_in, bytes_out) = cx.local.bytes.split();
        // Reads the scene in flash before the first tick is due.
        let mechanism = Motors::new(rig);
        let (link, control) = start(cx.local.channels, flash, mechanism, TickClock::new(), identity);
        announce(identity.reset, last_crash, &link);
        uart::start();
        let local = Local {
            control,
            link: Some(link),
            bytes_in,
            bytes_out: Some(bytes_out),
        };
        // The first tick starts the timers.
        cortex_m::peripheral::NVIC::pend(Interrupt::TIMER0);
        (Shared {}, local)
    }

    #[task(binds = TIMER0, priority = 3, local = [control])]
    fn tick(cx: tick::Context) {
        timer::clear_interrupt();
        // Then the link pended this tick, and sends what comes of it.
        let pended = timer::is_stopped();
        if pended {
            timer::start();
        }
        match cx.local.control.tick() {
            Ticked::Ran => {
                timer::count_tick();
                executor::note();
            }
            Ticked::Waiting => {
                timer::stop();
                if !pended {
                    executor::note();
                }
            }
        }
    }

    #[task(binds = UART0RX, priority = 2, local = [bytes_in])]
    fn received(cx: received::Context) {
        if uart::receive(cx.local.bytes_in) {
            executor::note();
        }
    }

    #[task(binds = UART0TX, priority = 1)]
    fn sent(_: sent::Context) {
        uart::sent();
        executor::note();
    }

    #[idle(local = [link, bytes_out])]
    fn idle(cx: idle::Context) -> ! {
        match (cx.local.link.take(), cx.local.bytes_out.take()) {
            (Some(link), Some(bytes)) => link::run(link, bytes),
            // Idle runs once.
            _ => loop {
                cortex_m::asm::wfi();
            },
        }
    }
}
