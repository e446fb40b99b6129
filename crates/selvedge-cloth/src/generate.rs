//! Meshes made from numbers: irregular sheets (jittered Delaunay, no grid lines) with evenly
//! spaced boundary vertices and all faces counter-clockwise (data.md §2).
