//! The link plane's task, on the serial line.

use cortex_m::peripheral::NVIC;
use heapless::Vec;
use heapless::spsc::Consumer;
use mortise_board::{crash, executor, log, stack};
use mortise_firmware::board::TICK_HZ;
use mortise_firmware::link::LinkPlane;
use mortise_simulation::ram_flash::RamFlash;
use static_cell::StaticCell;

use crate::interrupts::Interrupt;
use crate::timer::{self, milliseconds};
use crate::uart::{self, Sender};

/// The link plane of this machine.
pub type Link = LinkPlane<'static, 'static, RamFlash<'static>>;

/// How often the deepest stack is looked up, ms: it reads the whole unused stack.
const STACK_EVERY: u32 = TICK_HZ as u32;
/// Bytes taken from the pipe at once.
const PIECE: usize = 64;

/// Serves the link for ever; sleeps between interrupts.
pub fn run(link: Link, bytes: Consumer<'static, u8>) -> ! {
    executor::run(|spawner| match serve(link, bytes) {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::error!("the link task could not be started"),
    })
}

/// Bytes in, frames out, until the board restarts.
#[embassy_executor::task]
async fn serve(mut link: Link, mut bytes: Consumer<'static, u8>) {
    static SENDER: StaticCell<Sender> = StaticCell::new();
    let sender = SENDER.init(Sender::new());
    let mut piece: Vec<u8, PIECE> = Vec::new();
    let mut stack_at = 0;
    loop {
        // Bounded by the bytes that had arrived when the loop began.
        for _ in 0..=bytes.len() / PIECE {
            piece.clear();
            piece.extend(core::iter::from_fn(|| bytes.dequeue()).take(PIECE));
            link.receive(&piece, sender);
        }
        uart::resume(&bytes);
        if timer::is_stopped() {
            // Lockstep: the control plane looks at what came. It runs before the next line does.
            NVIC::pend(Interrupt::TIMER0);
        }
        if link.poll(sender) > 0 {
            // There is room again for what may have waited for it.
            executor::note();
        }
        log::drain(|bytes| link.log(bytes, sender));
        sender.flush();
        if link.restart_requested() && sender.is_empty() {
            crash::restart();
        }
        if milliseconds().wrapping_sub(stack_at) >= STACK_EVERY {
            stack_at = milliseconds();
            link.note_stack(stack::deepest());
        }
        executor::WAKE.wait().await;
    }
}
