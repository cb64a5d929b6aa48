//! Elements: shape gradients and volumes, local numbering only.

mod tet4;

pub use tet4::Tet4;
