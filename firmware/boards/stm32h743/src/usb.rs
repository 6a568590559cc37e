//! The link's way: a USB serial port (CDC ACM) on the Nucleo's user connector CN13, full speed.
//!
//! Four tasks of one executor, polled from `idle` at the lowest priority: the USB device, a reader and a writer that each move packets between
//! the port and a bounded pipe, and the link between the pipes ([`crate::link`]). A slow or absent host fills the outgoing pipe and nothing else:
//! the link plane then drops telemetry and answers, and goes on reading.

use embassy_executor::Spawner;
use embassy_stm32::peripherals::{PA11, PA12, USB_OTG_FS};
use embassy_stm32::usb::{Driver, InterruptHandler};
use embassy_stm32::{Peri, bind_interrupts, uid};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_usb::class::cdc_acm::{CdcAcmClass, Receiver, Sender, State};
use embassy_usb::{Builder, Config, UsbDevice};
use mortise_firmware::board::Outbound;
use mortise_firmware::link::OUTBOUND_MIN;
use mortise_protocol::limits::MAX_FRAME;
use static_cell::{ConstStaticCell, StaticCell};

/// Bytes of a full-speed bulk packet.
const PACKET: usize = 64;
/// Bytes received that may wait.
pub const IN_BYTES: usize = 2 * MAX_FRAME;
/// Bytes to send that may wait: some telemetry beyond the least the link plane needs.
pub const OUT_BYTES: usize = 2 * OUTBOUND_MIN;
/// Vendor and product of pid.codes' test range: for own builds. Who sells boards needs an own pair.
const USB_IDS: (u16, u16) = (0x1209, 0x0001);

/// From the host.
pub type InPipe = Pipe<NoopRawMutex, IN_BYTES>;
/// To the host.
pub type OutPipe = Pipe<NoopRawMutex, OUT_BYTES>;

type Usb = Driver<'static, USB_OTG_FS>;

bind_interrupts!(
    /// The one HAL interrupt in use.
    pub struct Interrupts {
        OTG_FS => InterruptHandler<USB_OTG_FS>;
    }
);

/// The outgoing pipe as the link plane sees it.
pub struct Out(pub &'static OutPipe);

impl Outbound for Out {
    fn room(&self) -> usize {
        self.0.free_capacity()
    }

    fn write(&mut self, frame: &[u8]) {
        let mut rest = frame;
        // At most two pieces: the ring's end divides them. An error would mean a caller that did not ask `room`: the rest is lost, the frame damaged
        // and counted.
        while !rest.is_empty() {
            let Ok(written) = self.0.try_write(rest) else {
                return;
            };
            rest = &rest[written..];
        }
    }
}

/// Everything the port needs.
pub struct Port {
    device: UsbDevice<'static, Usb>,
    sender: Sender<'static, Usb>,
    receiver: Receiver<'static, Usb>,
}

impl Port {
    /// Sets the device up; it appears on the bus once its task runs.
    pub fn new(
        usb: Peri<'static, USB_OTG_FS>,
        plus: Peri<'static, PA12>,
        minus: Peri<'static, PA11>,
    ) -> Self {
        static OUT_ENDPOINTS: ConstStaticCell<[u8; 256]> = ConstStaticCell::new([0; 256]);
        static CONFIGURATION: ConstStaticCell<[u8; 128]> = ConstStaticCell::new([0; 128]);
        static BOS: ConstStaticCell<[u8; 32]> = ConstStaticCell::new([0; 32]);
        static CONTROL: ConstStaticCell<[u8; 64]> = ConstStaticCell::new([0; 64]);
        static STATE: StaticCell<State<'static>> = StaticCell::new();

        let mut hardware = embassy_stm32::usb::Config::default();
        // The Nucleo does not route VBUS to a pin that senses it.
        hardware.vbus_detection = false;
        let driver = Driver::new_fs(usb, Interrupts, plus, minus, OUT_ENDPOINTS.take(), hardware);

        let mut config = Config::new(USB_IDS.0, USB_IDS.1);
        config.manufacturer = Some("Mortise");
        config.product = Some("Mortise nucleo-h743zi");
        config.serial_number = Some(uid::uid_hex());
        config.max_packet_size_0 = PACKET as u8;
        let mut builder = Builder::new(
            driver,
            config,
            CONFIGURATION.take(),
            BOS.take(),
            &mut [],
            CONTROL.take(),
        );
        let class = CdcAcmClass::new(&mut builder, STATE.init_with(State::new), PACKET as u16);
        let (sender, receiver) = class.split();
        Self {
            device: builder.build(),
            sender,
            receiver,
        }
    }

    /// Starts the three tasks. Each can be spawned once; a second call does nothing.
    pub fn spawn(self, spawner: Spawner, incoming: &'static InPipe, outgoing: &'static OutPipe) {
        if let (Ok(device), Ok(read), Ok(write)) = (
            run_device(self.device),
            read_packets(self.receiver, incoming),
            write_packets(self.sender, outgoing),
        ) {
            spawner.spawn(device);
            spawner.spawn(read);
            spawner.spawn(write);
        }
    }
}

#[embassy_executor::task]
async fn run_device(mut device: UsbDevice<'static, Usb>) -> ! {
    device.run().await
}

/// Port to pipe; waits when the pipe is full, and USB makes the host wait.
#[embassy_executor::task]
async fn read_packets(mut receiver: Receiver<'static, Usb>, incoming: &'static InPipe) -> ! {
    let mut packet = [0u8; PACKET];
    loop {
        receiver.wait_connection().await;
        while let Ok(length) = receiver.read_packet(&mut packet).await {
            incoming.write_all(&packet[..length]).await;
        }
    }
}

/// Pipe to port. What waits when the cable is pulled is thrown away: the next host starts with a greeting.
#[embassy_executor::task]
async fn write_packets(mut sender: Sender<'static, Usb>, outgoing: &'static OutPipe) -> ! {
    let mut packet = [0u8; PACKET];
    loop {
        sender.wait_connection().await;
        outgoing.clear();
        loop {
            let length = outgoing.read(&mut packet).await;
            if sender.write_packet(&packet[..length]).await.is_err() {
                break;
            }
            // A full packet does not end a transfer; without an empty one the host would wait for more.
            if length == PACKET && outgoing.is_empty() && sender.write_packet(&[]).await.is_err() {
                break;
            }
        }
    }
}
