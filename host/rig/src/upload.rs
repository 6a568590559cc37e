//! Upload of a scene: begin, chunks with a few under way at once, commit. After a lost or repeated chunk, sending resumes at the offset
//! that the board reports; the scene in use stays until the commit.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::time::Duration;

use heapless::Vec as Bounded;
use mortise_protocol::image::{CRC, Header, MAGIC};
use mortise_protocol::limits::MAX_CHUNK;
use mortise_protocol::message::{Refusal, ToDevice};

use crate::client::Client;
use crate::error::RigError;
use crate::exchange::ATTEMPTS;
use crate::link::Answer;
use crate::words::Words;

/// Number of chunks under way at once: hides the round trip, and stays far below the 64 KiB buffers on the way.
pub const UPLOAD_WINDOW: usize = 4;
/// Largest number of resumptions without progress of the board.
const MAX_SETBACKS: u32 = 8;
const BUSY_PAUSE: Duration = Duration::from_millis(5);

/// Progress of an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UploadProgress {
    /// Bytes the board has acknowledged.
    pub sent: usize,
    /// Total bytes.
    pub total: usize,
}

/// The message that begins the upload of `image`.
///
/// # Errors
/// `NotAScene` when the bytes do not start like a scene image. The board checks everything else.
pub fn begin_message(image: &[u8]) -> Result<ToDevice, RigError> {
    let not = |what: &str| RigError::NotAScene {
        what: what.to_owned(),
    };
    if image.len() < size_of::<Header>() {
        return Err(not(&format!("{} bytes are not a scene image", image.len())));
    }
    if image[..8] != MAGIC {
        return Err(not("the file is not a scene image"));
    }
    let length = u32::try_from(image.len()).map_err(|_| not("the file is larger than 4 GB"))?;
    Ok(ToDevice::SceneBegin {
        length,
        crc: CRC.checksum(image),
        layout: u32::from_le_bytes([image[8], image[9], image[10], image[11]]),
    })
}

/// The chunk of `image` that starts at `offset`; empty beyond its end.
pub fn chunk_message(image: &[u8], offset: usize) -> ToDevice {
    let start = offset.min(image.len());
    let end = (start + MAX_CHUNK).min(image.len());
    ToDevice::SceneChunk {
        offset: start as u32,
        // The range is never longer than the vector's capacity, so nothing is lost here.
        data: Bounded::from_slice(&image[start..end]).unwrap_or_default(),
    }
}

impl Client {
    /// Uploads a scene image and activates it. `progress` is called after each acknowledged chunk.
    ///
    /// # Errors
    /// `NotAScene`; `Refused` with the board's reason (armed, too large, other layout, damaged); `Timeout`, `LinkLost`. The scene that
    /// was in use stays in use after any of them.
    pub fn upload(&self, image: &[u8], progress: &mut dyn FnMut(UploadProgress)) -> Result<(), RigError> {
        let mut go_on = |now| {
            progress(now);
            ControlFlow::Continue(())
        };
        self.upload_while(image, &mut go_on).map(|_| ())
    }

    /// Like [`Self::upload`], until `progress` ends it: the board then discards the partial scene, and the one in use stays.
    ///
    /// # Errors
    /// As [`Self::upload`].
    pub fn upload_while(
        &self,
        image: &[u8],
        progress: &mut dyn FnMut(UploadProgress) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, RigError> {
        self.request(begin_message(image)?)?;
        let sent = self.send_chunks(image, progress);
        if !matches!(sent, Ok(ControlFlow::Continue(()))) {
            // Frees the board's buffer; the error itself is reported by the caller.
            let _ = self.send(ToDevice::SceneAbort);
            return sent;
        }
        self.commit(CRC.checksum(image))?;
        Ok(ControlFlow::Continue(()))
    }

    /// Commits the upload. The board refuses a second commit, so if the answer to the first is lost, the scene that it reports as in use
    /// decides.
    fn commit(&self, crc: u32) -> Result<(), RigError> {
        let mut result = self.request(ToDevice::SceneCommit);
        for _ in 1..ATTEMPTS {
            if !matches!(result, Err(RigError::Timeout { .. })) {
                break;
            }
            result = match self.request(ToDevice::SceneCommit) {
                Err(RigError::Refused {
                    reason: Refusal::NoUpload,
                    ..
                }) if self.refresh_capabilities()?.scene == Some(crc) => Ok(()),
                again => again,
            };
        }
        result
    }

    fn send_chunks(
        &self,
        image: &[u8],
        progress: &mut dyn FnMut(UploadProgress) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, RigError> {
        let total = image.len();
        let mut taken = 0;
        let mut setbacks = 0;
        while taken < total {
            match self.send_run(image, taken, &mut |sent| progress(UploadProgress { sent, total }))? {
                Run::Done => break,
                Run::Ended => return Ok(ControlFlow::Break(())),
                Run::StandsAt { offset, why } => {
                    setbacks = if offset > taken { 0 } else { setbacks + 1 };
                    if setbacks > MAX_SETBACKS || offset > total {
                        return Err(why);
                    }
                    taken = offset;
                }
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Sends from `start` to the end with a window; stops at the first refused chunk.
    fn send_run(
        &self,
        image: &[u8],
        start: usize,
        taken: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> Result<Run, RigError> {
        let mut position = start;
        let mut next = start;
        let mut window = VecDeque::with_capacity(UPLOAD_WINDOW);
        while position < image.len() {
            while window.len() < UPLOAD_WINDOW && next < image.len() {
                let message = chunk_message(image, next);
                let ticket = self.link().post(&message)?;
                next = (next + MAX_CHUNK).min(image.len());
                window.push_back((next, message, ticket));
            }
            let Some((end, message, ticket)) = window.pop_front() else {
                break;
            };
            let wait = self.patience_for(&message);
            let refused = |reason| RigError::Refused {
                what: message.words(),
                reason,
            };
            match ticket.wait(wait)? {
                Some(Answer::Done | Answer::Value(_)) => {
                    position = end;
                    if taken(position).is_break() {
                        return Ok(Run::Ended);
                    }
                }
                Some(Answer::Refused(reason @ Refusal::ChunkOrder { expected })) => {
                    let (offset, why) = (expected as usize, refused(reason));
                    return Ok(Run::StandsAt { offset, why });
                }
                Some(Answer::Refused(reason @ Refusal::Busy)) => {
                    std::thread::sleep(BUSY_PAUSE);
                    let (offset, why) = (position, refused(reason));
                    return Ok(Run::StandsAt { offset, why });
                }
                Some(Answer::Refused(reason)) => return Err(refused(reason)),
                None => {
                    let (offset, why) = (position, self.no_answer(&message, wait));
                    return Ok(Run::StandsAt { offset, why });
                }
            }
        }
        Ok(Run::Done)
    }
}

enum Run {
    Done,
    /// Ended by the progress callback.
    Ended,
    /// The board has taken all bytes before `offset`; `why` is the reason for stopping there.
    StandsAt {
        offset: usize,
        why: RigError,
    },
}
