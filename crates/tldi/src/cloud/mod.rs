//! Point clouds: how they are built, checked and searched.

pub(crate) mod builder;
pub(crate) mod checks;
pub(crate) mod error;
pub(crate) mod gather;
pub(crate) mod knn;
pub(crate) mod leaf;
pub(crate) mod morton;
pub(crate) mod neighborhoods;
pub(crate) mod point_cloud;
pub(crate) mod point_normals;
pub(crate) mod radii;
pub(crate) mod reach;
pub(crate) mod recipe;
pub(crate) mod tree_building;
