//! What a check says.

/// What a check saw, or what was wrong.
pub type Verdict = Result<String, String>;
