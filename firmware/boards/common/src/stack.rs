//! How deep the stack has been: start-up paints it (cortex-m-rt), and use wipes the paint off.

/// Paints the free part of the stack anew, so that [`deepest`] leaves out what start-up needed (it moves large values about). Once, when `idle`
/// begins. Interrupts are off for about 0.1 ms.
pub fn repaint() {
    // SAFETY: symbols of the linker script; only their addresses are used.
    unsafe extern "C" {
        static _stack_end: u32;
    }
    /// Left unpainted under the stack pointer, bytes: this function's own needs.
    const MARGIN: u32 = 256;
    cortex_m::interrupt::free(|_| {
        let end = cortex_m::register::msp::read() - MARGIN;
        let mut at = (&raw const _stack_end) as u32;
        while at < end {
            // SAFETY: below the stack pointer and above the guard: nobody's memory while no interrupt can come.
            unsafe { (at as *mut u32).write_volatile(cortex_m_rt::STACK_PAINT_VALUE) };
            at += 4;
        }
    });
}

/// Deepest the stack has been since start, or since [`repaint`], bytes: looks for paint, reading all of the unused stack.
pub fn deepest() -> u32 {
    // SAFETY: symbols of the linker script; only their addresses are used.
    unsafe extern "C" {
        static _stack_end: u32;
        static _stack_start: u32;
    }
    let (end, start) = (
        (&raw const _stack_end) as usize,
        (&raw const _stack_start) as usize,
    );
    let mut at = end;
    // SAFETY: reads the stack's own memory, word by word, above the guard.
    while at < start && unsafe { (at as *const u32).read_volatile() } == cortex_m_rt::STACK_PAINT_VALUE {
        at += 4;
    }
    (start - at) as u32
}
