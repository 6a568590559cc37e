//! A scene image without parts, of any size; and faulty boards.
#![allow(dead_code)]

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::time::Duration;

use mortise_protocol::frame::{Decoder, encode};
use mortise_protocol::image::{CRC, Header, LAYOUT_VERSION, MAGIC, Section};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{FromDevice, ToDevice};
use mortise_rig::{Patience, PipeReader, PipeWriter, Transport, pipe};

/// Short waiting times, for boards that never answer.
pub fn short() -> Patience {
    Patience {
        greeting: Duration::from_millis(600),
        answer: Duration::from_millis(300),
        silence: Duration::from_secs(2),
    }
}

/// A valid scene image without parts: a header and `filling` bytes of blob that depend on `seed`.
pub fn image(filling: usize, seed: u8) -> Vec<u8> {
    let head = size_of::<Header>();
    let length = head + filling.next_multiple_of(4);
    let none = Section {
        offset: head as u32,
        count: 0,
    };
    let header = Header {
        magic: MAGIC,
        layout: LAYOUT_VERSION,
        length: length as u32,
        crc: 0,
        energies: 0,
        parts: none,
        shapes: none,
        fields: none,
        nodes: none,
        points: none,
        faces: none,
        bricks: none,
        palette: none,
        grid: none,
        patches: none,
        edges: none,
        spans: none,
        blob: Section {
            offset: head as u32,
            count: (length - head) as u32,
        },
    };
    let mut bytes = bytemuck::bytes_of(&header).to_vec();
    bytes.extend((0..length - head).map(|i| (i as u8).wrapping_mul(31).wrapping_add(seed)));
    let crc = CRC.checksum(&bytes[20..]);
    bytes[16..20].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// The board's end of a transport.
pub struct FarEnd {
    pub from_host: PipeReader,
    pub to_host: PipeWriter,
    decoder: Decoder,
}

/// A transport and its far end.
pub fn wire() -> (Transport, FarEnd) {
    let (to_board, from_host) = pipe();
    let (to_host, from_board) = pipe();
    let transport = Transport {
        reader: Box::new(from_board),
        writer: Box::new(to_board),
        keep: None,
    };
    let far = FarEnd {
        from_host,
        to_host,
        decoder: Decoder::new(),
    };
    (transport, far)
}

impl FarEnd {
    /// The next message from the host; `None` when the host is gone.
    pub fn next(&mut self) -> Option<(u16, ToDevice)> {
        let mut byte = [0];
        loop {
            match self.from_host.read(&mut byte) {
                Ok(0) => return None,
                Ok(_) => {
                    if let Some(Ok(message)) = self.decoder.push(byte[0]) {
                        return Some(message);
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::TimedOut => {}
                Err(_) => return None,
            }
        }
    }

    pub fn say(&mut self, message: &FromDevice) {
        let mut frame = [0; MAX_FRAME];
        let bytes = encode(0, message, &mut frame).expect("fits");
        // The host may be gone already.
        let _ = self.to_host.write_all(bytes);
    }
}

/// A reader that now and then loses or changes a byte.
pub struct Faulty<T> {
    pub inner: T,
    pub random: Random,
    /// Mean number of bytes per harmed byte.
    pub one_in: u64,
}

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

impl<T: Read> Read for Faulty<T> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(out)?;
        if count == 0 {
            return Ok(0);
        }
        let mut kept: VecDeque<u8> = VecDeque::new();
        for &byte in &out[..count] {
            match self.random.next() {
                dice if dice % self.one_in != 0 => kept.push_back(byte),
                // The byte is lost.
                dice if dice & (1 << 40) != 0 => {}
                dice => kept.push_back(byte ^ (1 << ((dice >> 41) % 8))),
            }
        }
        if kept.is_empty() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        for (place, byte) in out.iter_mut().zip(&kept) {
            *place = *byte;
        }
        Ok(kept.len())
    }
}
