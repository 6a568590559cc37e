//! Addresses of the machine's devices, and access to their registers.

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
