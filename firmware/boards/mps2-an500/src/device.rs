//! The part of QEMU's `mps2-an500` this firmware uses: interrupt numbers and register addresses.
//!
//! From QEMU 7.2 `hw/arm/mps2.c`, `hw/char/cmsdk-apb-uart.c`, `hw/timer/cmsdk-apb-timer.c` and Arm AN385/AN500.

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

/// A device's 32-bit registers.
#[derive(Clone, Copy)]
pub struct Registers(*mut u32);

// SAFETY: each device is used by one owner; see the constants.
unsafe impl Send for Registers {}

impl Registers {
    /// First UART.
    pub const UART0: Self = Self(0x4000_4000 as *mut u32);
    /// Tick timer.
    pub const TIMER0: Self = Self(0x4000_0000 as *mut u32);
    /// Free-running timer.
    pub const TIMER1: Self = Self(0x4000_1000 as *mut u32);
    /// Board I/O of the FPGA: LEDs.
    pub const FPGAIO: Self = Self(0x4002_8000 as *mut u32);

    /// Reads the register at byte `OFFSET`.
    pub fn read<const OFFSET: usize>(self) -> u32 {
        const { assert!(OFFSET < 0x100 && OFFSET.is_multiple_of(4)) };
        // SAFETY: one of the devices above, which have at least 256 bytes of registers without side effects beyond the device.
        unsafe { self.0.byte_add(OFFSET).read_volatile() }
    }

    /// Writes the register at byte `OFFSET`.
    pub fn write<const OFFSET: usize>(self, value: u32) {
        const { assert!(OFFSET < 0x100 && OFFSET.is_multiple_of(4)) };
        // SAFETY: as for `read`.
        unsafe { self.0.byte_add(OFFSET).write_volatile(value) }
    }
}
