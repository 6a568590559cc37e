//! Every bound host and board agree on. A limit nobody can name is a limit nobody can test.

/// Largest message in postcard form, bytes.
pub const MAX_MESSAGE: usize = 768;
/// Largest frame on the wire: sequence number, message, stamp and checksum, COBS overhead, delimiter.
pub const MAX_FRAME: usize = MAX_MESSAGE + 2 + 8 + 4 + (MAX_MESSAGE + 14).div_ceil(254) + 1;
/// Scene bytes in one chunk.
pub const MAX_CHUNK: usize = 512;
/// Parts in a scene.
pub const MAX_PARTS: usize = 256;
/// Touching face pairs in one telemetry message, deepest first.
pub const MAX_PAIRS: usize = 12;
/// Constraint targets active at once.
pub const MAX_TARGETS: usize = 8;
/// Face pairs a constraint target owns.
pub const MAX_TARGET_PAIRS: usize = 8;
/// Keyframes of a simulated hand's script.
pub const MAX_KEYFRAMES: usize = 12;
/// Faults at the inputs of a simulated mechanism.
pub const MAX_INPUT_FAULTS: usize = 8;
/// Bytes of log in one message.
pub const MAX_LOG: usize = 256;
/// Joints with motors that a rig's description can have.
pub const MAX_JOINTS: usize = 3;
/// Characters of a board's or firmware's name.
pub const MAX_NAME: usize = 32;
