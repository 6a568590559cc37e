//! Verbs and the words that begin a question.

/// What a verb asks for, before its objects are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VerbClass {
    /// Take apart: "remove".
    Remove,
    /// Put together: "insert".
    Connect,
    /// Along an axis outwards, or apart when no amount is given: "pull".
    Pull,
    /// Along an axis inwards, or together when a place is given: "push".
    Push,
    /// Either way, by what follows: "slide".
    Move,
    /// Apart with "off" or "out", otherwise only a choice of the part: "take".
    Take,
    /// About an axis: "turn".
    Turn,
    /// The turn before: "undo"; with a part: apart.
    Undo,
    /// The turn undone: "redo".
    Redo,
    /// Not an assembly operation: "paint".
    Other,
}

/// Verbs and their classes.
pub const VERBS: &[(VerbClass, &[&str])] = &[
    (
        VerbClass::Remove,
        &[
            "remove",
            "disconnect",
            "detach",
            "dismount",
            "demount",
            "unmount",
            "disassemble",
            "dismantle",
            "unscrew",
            "unbolt",
            "extract",
            "unplug",
            "uninstall",
            "separate",
            "eject",
            "unfasten",
            "unclip",
            "pry",
            "strip",
            "disengage",
            "decouple",
        ],
    ),
    (
        VerbClass::Connect,
        &[
            "insert",
            "connect",
            "attach",
            "mount",
            "install",
            "fit",
            "join",
            "screw",
            "plug",
            "put",
            "place",
            "set",
            "fasten",
            "fix",
            "bolt",
            "seat",
            "assemble",
            "thread",
            "mate",
            "return",
            "replace",
            "reinstall",
            "reattach",
            "reinsert",
            "reconnect",
            "refit",
            "remount",
            "add",
            "stick",
            "clip",
            "couple",
            "feed",
        ],
    ),
    (
        VerbClass::Pull,
        &[
            "pull", "withdraw", "draw", "loosen", "lift", "raise", "back", "drag", "retract",
        ],
    ),
    (
        VerbClass::Push,
        &[
            "push", "press", "drop", "lower", "shove", "tighten", "advance", "drive",
        ],
    ),
    (VerbClass::Move, &["slide", "move", "shift", "slip", "adjust"]),
    (
        VerbClass::Take,
        &["take", "get", "bring", "grab", "pick", "hold", "select"],
    ),
    (
        VerbClass::Turn,
        &[
            "turn", "rotate", "spin", "twist", "give", "swivel", "crank", "swing", "revolve", "pivot",
        ],
    ),
    (VerbClass::Undo, &["undo", "revert"]),
    (VerbClass::Redo, &["redo"]),
    (
        VerbClass::Other,
        &[
            "paint",
            "weigh",
            "measure",
            "drill",
            "cut",
            "weld",
            "buy",
            "order",
            "clean",
            "heat",
            "cool",
            "show",
            "tell",
            "make",
            "color",
            "colour",
            "print",
            "delete",
            "save",
            "open",
            "close",
            "machine",
            "mill",
            "grind",
            "polish",
            "grease",
            "oil",
            "glue",
            "bend",
            "break",
            "scale",
            "copy",
            "rename",
            "hide",
            "explain",
            "describe",
            "count",
            "list",
            "name",
            "find",
            "check",
            "inspect",
            "calculate",
            "compute",
            "design",
            "draw up",
            "sell",
            "wash",
            "lubricate",
            "melt",
            "sing",
            "help",
            "stop",
            "start",
            "wait",
            "zoom",
            "look",
            "call",
            "write",
            "read",
            "eat",
            "kick",
            "throw",
            "smash",
            "sharpen",
            "wipe",
            "shorten",
            "lengthen",
            "stretch",
            "duplicate",
            "mirror",
            "highlight",
            "export",
            "think",
            "like",
            "love",
        ],
    ),
];

/// Words that begin a question.
pub const QUESTIONS: &[&str] = &[
    "how", "what", "where", "why", "which", "when", "who", "whose", "is", "are", "does", "do", "did", "will",
    "was", "were", "has", "have", "should",
];

/// All verbs, for corrections of the first word.
pub fn verbs() -> impl Iterator<Item = &'static str> {
    VERBS.iter().flat_map(|(_, words)| words.iter().copied())
}

/// Class of a verb.
pub fn verb(word: &str) -> Option<VerbClass> {
    let found = VERBS.iter().find(|(_, words)| words.contains(&word));
    found.map(|&(class, _)| class)
}
