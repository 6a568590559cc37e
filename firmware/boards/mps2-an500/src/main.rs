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

mod device;
mod link_task;
mod memory;
mod motors;
mod planes;
mod timer;
mod uart;

use cortex_m_rt as _;

defmt::timestamp!("{=u32:ms}", planes::milliseconds());

#[rtic::app(device = crate::device, peripherals = false)]
mod app {
    use core::sync::atomic::Ordering;

    use heapless::spsc::{Consumer, Producer, Queue};
    use mortise_board::record::Crash;
    use mortise_board::{crash, executor};
    use mortise_firmware::board::Identity;
    use mortise_firmware::channel::Channels;
    use mortise_firmware::control::Ticked;
    use mortise_firmware::device::start;
    use mortise_firmware::store;
    use mortise_mechanism::ceilings::Ceilings;
    use mortise_protocol::message::{CostUnit, ResetReason};

    use crate::device::Interrupt;
    use crate::planes::{Control, Link, MILLISECONDS};
    use crate::{link_task, memory, motors, timer, uart};

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
        let identity = Identity {
            board: "mps2-an500",
            force_axes: rig.map_or(3, |rig| rig.joints.len() as u8),
            // A described wrist is passive.
            torque_axes: if rig.is_some() { 0 } else { 3 },
            cost_unit: CostUnit::Instructions,
            cost_budget: timer::BUDGET,
            // QEMU's chip has no reset flags.
            reset: match crash::take(false) {
                Some(Crash::Requested) => ResetReason::Requested,
                Some(Crash::Panic { line }) => ResetReason::Panic { line },
                Some(Crash::HardFault { pc, .. }) => ResetReason::HardFault { pc },
                None => ResetReason::PowerOn,
            },
            // The simulated mechanism stands still between ticks: late ticks are counted and do no harm.
            overrun_ticks: 0,
            ceilings: rig.map_or(Ceilings::LARGEST, Ceilings::of),
            // QEMU's chip has no random numbers; each of its runs has a line of its own, on which frames of another run cannot come.
            entropy: memory::starts().into(),
        };
        let (bytes_in, bytes_out) = cx.local.bytes.split();
        // Reads the scene in flash before the first tick is due.
        let mechanism = motors::Motors::new(rig);
        let (link, control) = start(
            cx.local.channels,
            flash,
            mechanism,
            timer::TickClock::new(),
            identity,
        );
        link_task::announce(&identity, &link);
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
                MILLISECONDS.fetch_add(1, Ordering::Relaxed);
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
            (Some(link), Some(bytes)) => link_task::run(link, bytes),
            // Idle runs once.
            _ => loop {
                cortex_m::asm::wfi();
            },
        }
    }
}
