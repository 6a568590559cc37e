//! Contact search: the sphere tree of one part against the distance field of another, in both directions.
//!
//! | file | what |
//! |---|---|
//! | `search`, `leaf`, `boxes` | traversal of all trees within a work budget; the points of one leaf; shapes whose boxes are apart |
//! | `edge_search`, `edge_crossing` | edges of one part against edges of the other; contact of two edges |
//! | `span` | lowest place of a span of an edge over the other part's surface |
//! | `directed_pair` | one part's tree against the other's field, and the transforms between their frames |
//! | `exact_surface`, `patch`, `facing` | distance to exact surfaces, and to local patches of free-form ones; normals that rule out a contact |
//! | `span`, `span_search` | spans of sharp edges: the distance along one, and the place of it that touches |
//! | `coherence`, `node_key`, `ancestors`, `face_cache`, `edge_cache` | advancement bounds, cached faces and near pairs of edges kept from earlier ticks |
//! | `rules`, `exclusion` | constraint rules for face pairs; leaves that contact exclusions keep apart |
//! | `cost`, `decimation` | cost model of the work budget; decimation of points when the budget does not suffice |
//! | `contact`, `side`, `face_pairs` | bounded store of contacts; side from which a leaf came to a thin part; touching face pairs |
//! | `placement`, `node_cursor` | placement of a part; position of the search in all trees |

pub(crate) mod ancestors;
mod boxes;
pub(crate) mod coherence;
pub(crate) mod contact;
pub mod cost;
pub(crate) mod decimation;
pub(crate) mod directed_pair;
mod edge_cache;
pub(crate) mod edge_crossing;
mod edge_search;
pub(crate) mod exact_surface;
mod exclusion;
mod face_cache;
pub(crate) mod face_pairs;
mod facing;
mod leaf;
pub(crate) mod node_cursor;
pub(crate) mod node_key;
pub mod patch;
pub(crate) mod placement;
pub(crate) mod rules;
pub(crate) mod search;
pub(crate) mod side;
pub(crate) mod span;
pub(crate) mod span_search;
