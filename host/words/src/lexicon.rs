//! The closed vocabulary: verbs, particles, places, units, and nouns that mean the same part.
//!
//! Words are lower case and singular. A word that is here or in a part's name is never taken for a misspelling of another.

pub use crate::verbs::{QUESTIONS, VERBS, VerbClass, verb, verbs};

/// Words skipped before a verb.
pub const LEADS: &[&str] = &[
    "please",
    "now",
    "then",
    "next",
    "ok",
    "okay",
    "so",
    "well",
    "and",
    "also",
    "first",
    "finally",
    "afterwards",
    "could",
    "can",
    "would",
    "you",
    "i",
    "want",
    "to",
    "let",
    "us",
    "lets",
    "just",
    "go",
    "ahead",
    "kindly",
    "need",
    "like",
    "try",
    "we",
];

/// Words without effect on the meaning, anywhere between phrases.
pub const FILLERS: &[&str] = &[
    "please",
    "now",
    "then",
    "again",
    "too",
    "also",
    "well",
    "as",
    "carefully",
    "gently",
    "slowly",
    "straight",
    "right",
    "just",
    "thanks",
    "first",
    "together",
    "yourself",
    "me",
    "for",
    "properly",
    "so",
    "there",
    "here",
    "where",
    "was",
    "were",
    "quickly",
    "away",
];

/// Articles and the like before a noun.
pub const DETERMINERS: &[&str] = &[
    "the", "its", "their", "this", "that", "these", "those", "my", "our", "your", "of",
];

/// Prepositions that name a destination; true: the part goes into it, false: around or against it.
pub const INTO: &[(&str, Relation)] = &[
    ("into", Relation::Inside),
    ("in", Relation::Inside),
    ("inside", Relation::Inside),
    ("through", Relation::Inside),
    ("onto", Relation::Around),
    ("over", Relation::Around),
    ("on", Relation::Around),
    ("around", Relation::Around),
    ("to", Relation::Any),
    ("with", Relation::Any),
    ("against", Relation::Any),
    ("at", Relation::Any),
];

/// How a moving part stands to its destination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// A shaft into a bore, when fits are searched.
    Inside,
    /// A bore over a shaft, or on a face.
    Around,
    /// Either.
    Any,
}

/// Particles that mean outwards.
pub const OUT: &[&str] = &["out", "off", "away", "apart", "loose"];
/// Particles that mean inwards.
pub const IN: &[&str] = &["in", "on", "back", "home", "inwards", "inward"];

/// "fully".
pub const FULLY: &[&str] = &["fully", "completely", "entirely", "totally", "flush"];

/// Direction or place along an axis of the file: x to the right, y to the rear, z up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// −x.
    Left,
    /// +x.
    Right,
    /// −y.
    Front,
    /// +y.
    Rear,
    /// +z.
    Upper,
    /// −z.
    Lower,
    /// Nearest to the middle of the others.
    Middle,
}

/// Words for places, each with the tokens of a part's name that say the same.
pub const PLACES: &[(Place, &[&str])] = &[
    (Place::Left, &["left", "lefthand", "leftmost"]),
    (Place::Right, &["right", "righthand", "rightmost"]),
    (Place::Front, &["front", "frontmost", "forward", "foremost"]),
    (Place::Rear, &["rear", "back", "hind", "rearmost", "behind"]),
    (Place::Upper, &["upper", "top", "topmost", "uppermost", "highest"]),
    (
        Place::Lower,
        &["lower", "bottom", "lowest", "bottommost", "underside"],
    ),
    (Place::Middle, &["middle", "center", "centre", "central", "mid"]),
];

/// Words for directions: where "from …" comes from.
pub const SIDES: &[(Place, &[&str])] = &[
    (Place::Upper, &["above", "top", "overhead"]),
    (
        Place::Lower,
        &["below", "underneath", "beneath", "bottom", "under"],
    ),
    (Place::Left, &["left"]),
    (Place::Right, &["right"]),
    (Place::Front, &["front"]),
    (Place::Rear, &["rear", "behind", "back"]),
];

/// Words for directions of motion.
pub const WAYS: &[(Place, &[&str])] = &[
    (Place::Upper, &["up", "upward", "upwards"]),
    (Place::Lower, &["down", "downward", "downwards"]),
    (Place::Left, &["left", "leftwards"]),
    (Place::Right, &["rightwards"]),
    (Place::Front, &["forward", "forwards"]),
    (Place::Rear, &["backward", "backwards", "rearwards"]),
];

/// Size of a part among others, by volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// The largest.
    Large,
    /// The smallest.
    Small,
    /// The longest.
    Long,
    /// The shortest.
    Short,
}

/// Words for sizes.
pub const SIZES: &[(Size, &[&str])] = &[
    (
        Size::Large,
        &[
            "large", "big", "larger", "largest", "bigger", "biggest", "huge", "heavy", "thick", "thickest",
        ],
    ),
    (
        Size::Small,
        &[
            "small", "little", "smaller", "smallest", "littlest", "tiny", "thin", "thinnest",
        ],
    ),
    (Size::Long, &["long", "longer", "longest"]),
    (Size::Short, &["short", "shorter", "shortest"]),
];

/// Ordinals; 0 stands for the last.
pub const ORDINALS: &[(usize, &[&str])] = &[
    (1, &["first", "1st"]),
    (2, &["second", "2nd"]),
    (3, &["third", "3rd"]),
    (4, &["fourth", "4th"]),
    (5, &["fifth", "5th"]),
    (6, &["sixth", "6th"]),
    (7, &["seventh", "7th"]),
    (8, &["eighth", "8th"]),
    (9, &["ninth", "9th"]),
    (10, &["tenth", "10th"]),
    (11, &["eleventh", "11th"]),
    (12, &["twelfth", "12th"]),
    (0, &["last", "final"]),
];

/// Numbers as words.
pub const NUMBERS: &[(f64, &str)] = &[
    (1.0, "one"),
    (2.0, "two"),
    (3.0, "three"),
    (4.0, "four"),
    (5.0, "five"),
    (6.0, "six"),
    (7.0, "seven"),
    (8.0, "eight"),
    (9.0, "nine"),
    (10.0, "ten"),
    (11.0, "eleven"),
    (12.0, "twelve"),
    (15.0, "fifteen"),
    (20.0, "twenty"),
    (30.0, "thirty"),
    (45.0, "forty-five"),
    (60.0, "sixty"),
    (90.0, "ninety"),
];

/// Units of length and their millimetres.
pub const LENGTHS: &[(f64, &[&str])] = &[
    (1.0, &["mm", "millimetre", "millimeter", "mil"]),
    (10.0, &["cm", "centimetre", "centimeter"]),
    (1000.0, &["m", "metre", "meter"]),
    (25.4, &["inch", "inches", "in."]),
    (0.001, &["um", "µm", "μm", "micron", "micrometre", "micrometer"]),
];

/// Units of angle and their radians.
pub const ANGLES: &[(f64, &[&str])] = &[
    (std::f64::consts::PI / 180.0, &["deg", "degree", "°"]),
    (1.0, &["rad", "radian"]),
    (std::f64::consts::TAU, &["turn", "revolution", "rev", "rotation"]),
];

/// Nouns for openings.
pub const HOLES: &[&str] = &["hole", "bore", "slot", "opening", "pocket", "borehole", "seat"];

/// Nouns that mean the same part; asked only when no part has the word itself.
pub const SYNONYMS: &[&[&str]] = &[
    &["axle", "shaft", "axis", "spindle", "arbor"],
    &["screw", "bolt", "fastener", "capscrew"],
    &["cover", "lid", "cap", "endcap", "flange"],
    &["seal", "gasket", "oring", "packing"],
    &["body", "housing", "case", "casing", "enclosure", "shell", "box"],
    &["leaf", "flap", "wing"],
    &["bush", "bushing", "sleeve", "liner"],
    &["pin", "peg", "dowel"],
    &["ring", "circlip", "clip"],
    &["rod", "bar"],
    &["bracket", "angle", "support"],
    &["board", "pcb", "circuitboard", "card"],
    &["gear", "cog", "gearwheel", "cogwheel"],
    &["base", "plate", "baseplate"],
    &["plug", "stopper"],
    &["free", "loose"],
    &["input", "drive", "driving"],
    &["output", "driven"],
    &["fixed", "stationary"],
    &["swing", "swinging", "moving"],
];

/// Modifiers that name a kind of part and are no part's distinction: "ball bearing", "circuit board".
pub const KINDS: &[&str] = &[
    "ball",
    "circuit",
    "base",
    "retaining",
    "snap",
    "hex",
    "cap",
    "machine",
    "end",
    "fixing",
    "roller",
    "guide",
    "mounting",
    "main",
    "set",
    "cylinder",
    "socket",
    "hinge",
    "retainer",
    "permanent",
    "whole",
    "entire",
    "same",
    "remaining",
];

/// Nouns for a piece of a divided part: "the upper half of the housing".
pub const PIECES: &[&str] = &["half", "part", "piece", "section", "side"];

/// Other words that are well spelt, so that they are never corrected into something else.
pub const WELL_SPELT: &[&str] = &[
    "motor",
    "engine",
    "machine",
    "assembly",
    "subassembly",
    "washer",
    "spring",
    "crank",
    "handle",
    "lever",
    "wheel",
    "fan",
    "battery",
    "cable",
    "wire",
    "nut",
    "bolt",
    "stud",
    "rivet",
    "key",
    "gearbox",
    "hinge",
    "fixture",
    "table",
    "tool",
    "hammer",
    "wrench",
    "coffee",
    "weather",
    "joke",
    "part",
    "parts",
    "thing",
    "everything",
    "nothing",
    "something",
    "step",
    "action",
    "move",
    "change",
    "operation",
    "side",
    "end",
    "axis",
    "direction",
    "clockwise",
    "anticlockwise",
    "counterclockwise",
    "way",
    "far",
    "bit",
    "little",
    "quarter",
    "half",
    "halfway",
    "turns",
    "other",
    "others",
    "rest",
    "one",
    "ones",
    "it",
    "them",
    "they",
    "both",
    "all",
    "every",
    "each",
    "any",
    "some",
    "an",
    "number",
    "no",
    "nr",
    "from",
    "by",
    "about",
    "approximately",
    "roughly",
    "along",
    "own",
    "until",
    "if",
    "not",
    "dont",
    "never",
    "red",
    "blue",
    "green",
    "steel",
    "plastic",
    "long",
    "house",
    "door",
    "car",
    "bracket",
    "piston",
    "valve",
    "pump",
    "flange",
    "pulley",
    "belt",
    "chain",
    "coupling",
    "clutch",
    "brake",
    "clamp",
    "lock",
    "knob",
    "button",
    "switch",
    "rotor",
    "stator",
    "coil",
    "magnet",
    "frame",
    "chassis",
    "panel",
    "foot",
    "leg",
    "arm",
    "head",
    "today",
    "tomorrow",
    "sleep",
    "ideas",
];

/// Whether `word` is in the closed vocabulary.
pub fn known(word: &str) -> bool {
    let pairs = |table: &[&[&str]]| table.iter().any(|words| words.contains(&word));
    verb(word).is_some()
        || [
            QUESTIONS,
            LEADS,
            FILLERS,
            DETERMINERS,
            OUT,
            IN,
            FULLY,
            HOLES,
            KINDS,
            PIECES,
            WELL_SPELT,
        ]
        .iter()
        .any(|words| words.contains(&word))
        || pairs(SYNONYMS)
        || INTO.iter().any(|(w, _)| *w == word)
        || [PLACES, SIDES, WAYS]
            .iter()
            .any(|table| find(table, word).is_some())
        || find(SIZES, word).is_some()
        || find(ORDINALS, word).is_some()
        || NUMBERS.iter().any(|(_, w)| *w == word)
        || find(LENGTHS, word).is_some()
        || find(ANGLES, word).is_some()
}

/// The value beside the list that holds `word`.
pub fn find<T: Copy>(table: &[(T, &[&str])], word: &str) -> Option<T> {
    table
        .iter()
        .find(|(_, words)| words.contains(&word))
        .map(|&(value, _)| value)
}

/// Whether two nouns mean the same kind of part.
pub fn same_kind(a: &str, b: &str) -> bool {
    SYNONYMS
        .iter()
        .any(|group| group.contains(&a) && group.contains(&b))
}

/// Singular of a plural noun, by the regular endings; other words unchanged.
pub fn singular(word: &str) -> String {
    let irregular = [
        ("axes", "axis"),
        ("axles", "axle"),
        ("leaves", "leaf"),
        ("halves", "half"),
        ("feet", "foot"),
        ("bodies", "body"),
        ("bushes", "bush"),
        ("inches", "inch"),
        ("boxes", "box"),
        ("cases", "case"),
        ("bases", "base"),
        ("holes", "hole"),
        ("axis", "axis"),
        ("chassis", "chassis"),
        ("brushes", "brush"),
        ("switches", "switch"),
        ("knives", "knife"),
    ];
    if let Some((_, one)) = irregular.iter().find(|(many, _)| *many == word) {
        return (*one).to_owned();
    }
    match word.strip_suffix('s') {
        Some(one) if word.len() > 3 && !one.ends_with('s') && !one.ends_with('u') => one.to_owned(),
        _ => word.to_owned(),
    }
}
