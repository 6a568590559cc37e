//! CMSDK UART 0: a byte interrupt in, polled out.
//!
//! QEMU offers the next byte only when the last one was read, so input that finds no room is left with QEMU: nothing is lost. The baud rate
//! means nothing there.

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Consumer, Producer};
use mortise_firmware::board::Outbound;
use mortise_protocol::limits::MAX_FRAME;

use crate::interrupts::Interrupt;
use crate::registers::Registers;

/// Bytes received that may wait: more than two frames.
pub const RECEIVED: usize = 2048;
/// Bytes to send that may wait: some ten frames of telemetry.
const TO_SEND: usize = 8192;
const _: () = assert!(TO_SEND >= 3 * MAX_FRAME);

const DATA: usize = 0x0;
const STATE: usize = 0x4;
const CTRL: usize = 0x8;
const INTERRUPT_CLEAR: usize = 0xc;
const BAUD_DIVISOR: usize = 0x10;
const SEND_FULL: u32 = 1;
const ENABLE: u32 = 0b11;
const SEND_INTERRUPT: u32 = 1 << 2;
const RECEIVE_INTERRUPT: u32 = 1 << 3;

/// No room was left: the receive interrupt is off and a byte waits.
static STOPPED: AtomicBool = AtomicBool::new(false);

/// Switches sender and receiver on.
pub fn start() {
    let uart = Registers::UART0;
    // The smallest divisor that is accepted.
    uart.write::<BAUD_DIVISOR>(16);
    uart.write::<CTRL>(ENABLE | SEND_INTERRUPT | RECEIVE_INTERRUPT);
}

/// In the receive interrupt: takes the byte if there is room, else stops asking until [`resume`]. Says whether it ended a frame or much waits.
///
/// Each access to a device costs QEMU more than a hundred instructions, so there are no more than needed.
pub fn receive(queue: &mut Producer<'static, u8>) -> bool {
    let uart = Registers::UART0;
    if !queue.ready() {
        STOPPED.store(true, Ordering::Release);
        uart.write::<CTRL>(ENABLE | SEND_INTERRUPT);
        return true;
    }
    uart.write::<INTERRUPT_CLEAR>(1 << 1);
    let byte = uart.read::<DATA>() as u8;
    let _ = queue.enqueue(byte);
    byte == 0 || queue.len() > RECEIVED / 2
}

/// In the send interrupt: it has done its work by waking the processor.
pub fn sent() {
    Registers::UART0.write::<INTERRUPT_CLEAR>(1);
}

/// Asks for received bytes again after the queue was full.
pub fn resume(queue: &Consumer<'static, u8>) {
    if STOPPED.load(Ordering::Acquire) && queue.len() < RECEIVED / 2 {
        STOPPED.store(false, Ordering::Release);
        Registers::UART0.write::<CTRL>(ENABLE | SEND_INTERRUPT | RECEIVE_INTERRUPT);
        // The byte that waits raises no interrupt of its own.
        NVIC::pend(Interrupt::UART0RX);
    }
}

/// Bytes on their way out.
pub struct Sender {
    ring: heapless::Deque<u8, TO_SEND>,
}

impl Sender {
    /// Empty.
    pub const fn new() -> Self {
        Self {
            ring: heapless::Deque::new(),
        }
    }

    /// Gives the UART what it takes now; the send interrupt wakes for the rest.
    pub fn flush(&mut self) {
        let uart = Registers::UART0;
        while !self.ring.is_empty() && uart.read::<STATE>() & SEND_FULL == 0 {
            if let Some(byte) = self.ring.pop_front() {
                uart.write::<DATA>(u32::from(byte));
            }
        }
    }

    /// Everything went out.
    pub fn is_empty(&self) -> bool {
        self.ring.is_empty() && Registers::UART0.read::<STATE>() & SEND_FULL == 0
    }
}

impl Default for Sender {
    fn default() -> Self {
        Self::new()
    }
}

impl Outbound for Sender {
    fn room(&self) -> usize {
        TO_SEND - self.ring.len()
    }

    fn write(&mut self, frame: &[u8]) {
        for &byte in frame {
            // The caller looked at `room`.
            let _ = self.ring.push_back(byte);
        }
    }
}
