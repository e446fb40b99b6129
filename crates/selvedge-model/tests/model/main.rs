//! Tests of the crate from outside: the network, the features, and the example.

mod embed;
mod invariance;
mod network;
mod pytorch;
mod reference;
mod specs;
mod strip;
