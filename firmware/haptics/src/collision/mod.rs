//! Where the held part is near others: sphere tree of one part against the distance field of the other, both ways.
//!
//! | file | what |
//! |---|---|
//! | `search`, `leaf` | traversal of all trees within a work budget; the points of one leaf |
//! | `directed_pair` | one part's tree against the other's field, and the transforms between them |
//! | `exact_surface`, `facing` | distance by exact surfaces; normals that rule a contact out |
//! | `coherence`, `node_key`, `ancestors`, `face_cache` | what earlier ticks proved, so that it is not computed again |
//! | `rules`, `exclusion` | what constraints say about pairs of faces; leaves they keep from touching |
//! | `cost`, `decimation` | what work counts; what is left out when there is too much of it |
//! | `contact`, `face_pairs` | bounded store of contacts; touching faces |
//! | `placement`, `node_cursor` | where parts stand; where a search stopped |

pub(crate) mod ancestors;
pub(crate) mod coherence;
pub(crate) mod contact;
pub mod cost;
pub(crate) mod decimation;
pub(crate) mod directed_pair;
pub(crate) mod exact_surface;
mod exclusion;
mod face_cache;
pub(crate) mod face_pairs;
mod facing;
mod leaf;
pub(crate) mod node_cursor;
pub(crate) mod node_key;
pub(crate) mod placement;
pub(crate) mod rules;
pub(crate) mod search;
