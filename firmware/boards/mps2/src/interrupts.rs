//! Interrupt numbers, and the interrupt part of the vector table.

use cortex_m::interrupt::InterruptNumber;

/// Priority bits of the interrupt controller that are used.
pub const NVIC_PRIO_BITS: u8 = 3;

/// Interrupts. RTIC names functions after them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Interrupt {
    /// A byte came.
    UART0RX = 0,
    /// The sender is empty.
    UART0TX = 1,
    /// A millisecond is over.
    TIMER0 = 8,
}

/// The name RTIC asks for.
pub use Interrupt as interrupt;

// SAFETY: the numbers are the ones above and nothing else.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// The interrupt part of the vector table.
mod vectors {
    // SAFETY: handlers without arguments: RTIC defines the first three, cortex-m-rt the default. Only their addresses are used here.
    unsafe extern "C" {
        fn UART0RX();
        fn UART0TX();
        fn TIMER0();
        fn DefaultHandler();
    }

    const COUNT: usize = 32;

    // SAFETY: only the processor calls through it.
    type Handler = unsafe extern "C" fn();

    // SAFETY: the name and section cortex-m-rt reserves for the interrupt table, defined once; every entry is a handler.
    #[unsafe(link_section = ".vector_table.interrupts")]
    #[unsafe(no_mangle)]
    static __INTERRUPTS: [Handler; COUNT] = {
        let mut table: [Handler; COUNT] = [DefaultHandler; COUNT];
        table[super::Interrupt::UART0RX as usize] = UART0RX;
        table[super::Interrupt::UART0TX as usize] = UART0TX;
        table[super::Interrupt::TIMER0 as usize] = TIMER0;
        table
    };
}
