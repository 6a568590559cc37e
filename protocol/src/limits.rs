//! All limits shared by host and board. Each limit has a name, so that it can be tested.

/// Largest message in postcard form, bytes.
pub const MAX_MESSAGE: usize = 768;
/// Largest frame on the wire: sequence number, message, stamp and checksum, COBS overhead, delimiter.
pub const MAX_FRAME: usize = MAX_MESSAGE + 2 + 8 + 4 + (MAX_MESSAGE + 14).div_ceil(254) + 1;
/// Scene bytes per chunk.
pub const MAX_CHUNK: usize = 512;
/// Parts per scene.
pub const MAX_PARTS: usize = 512;
/// Touching face pairs per telemetry message, deepest first.
pub const MAX_PAIRS: usize = 12;
/// Constraint targets active at the same time.
pub const MAX_TARGETS: usize = 8;
/// Face pairs of a constraint target.
pub const MAX_TARGET_PAIRS: usize = 8;
/// Largest rate of a path's turn with its travel, rad/m: a pitch of 0.63 mm.
pub const MAX_PATH_RATE: f32 = 1e4;
/// Keyframes of the simulated operator's script.
pub const MAX_KEYFRAMES: usize = 12;
/// Ticks in a message of recorded inputs.
pub const MAX_TICKS: usize = 10;
/// Faults at the inputs of a simulated mechanism.
pub const MAX_INPUT_FAULTS: usize = 8;
/// Bytes of log per message.
pub const MAX_LOG: usize = 256;
/// Joints with motors in a rig's description.
pub const MAX_JOINTS: usize = 3;
/// Encoders in a rig's description: one for each joint, then those of a wrist.
pub const MAX_ENCODERS: usize = MAX_JOINTS + 3;
/// Smallest and largest force at the handle in a motor's test, N.
pub const MOTOR_TEST_FORCE: [f32; 2] = [0.1, 2.0];
/// Characters of a board's or firmware's name.
pub const MAX_NAME: usize = 32;
