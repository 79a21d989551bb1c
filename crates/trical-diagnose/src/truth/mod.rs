//! Arms for a virtual cell: true ones, drawn by chance, with effects hidden in them.

mod draw;
mod error;
mod hidden;

pub use draw::draw_truth;
pub use error::TruthError;
pub use hidden::{hidden_in, hide};
