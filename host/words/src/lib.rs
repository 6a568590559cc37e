//! Assembly by plain words.
pub mod lexicon;
pub mod phrase;
pub mod token;
pub mod grammar;
mod noun;
pub mod port;
pub mod reference;
pub mod solid;
pub mod turn;
