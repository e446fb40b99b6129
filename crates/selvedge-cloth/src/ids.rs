//! Index spaces as types: a vertex number cannot be used where an edge number is meant.

use serde::{Deserialize, Serialize};

macro_rules! index_type {
    ($name:ident, $what:literal) => {
        #[doc = concat!("The number of ", $what, ", from 0.")]
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
        )]
        #[repr(transparent)]
        #[serde(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The number as an array index.
            #[inline]
            pub const fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl From<u32> for $name {
            fn from(number: u32) -> Self {
                Self(number)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

index_type!(VertexId, "a vertex");
index_type!(FaceId, "a triangle");
index_type!(EdgeId, "an undirected edge");
