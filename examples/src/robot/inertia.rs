//! Inertias of links as rapier's reader takes them.

use crate::mesh::Mesh;
use rapier3d_urdf::urdf_rs;
use tldi::glamx::{DMat3, DQuat, EulerRot};

/// Inertias about the axes of their `<origin rpy>` become inertias about the axes of their links: the reader takes of an
/// `<origin>` the place only.
pub(super) fn align_inertia(urdf: &mut urdf_rs::Robot) {
    for link in &mut urdf.links {
        let [roll, pitch, yaw] = std::mem::take(&mut link.inertial.origin.rpy.0);
        let link_from_inertial =
            DMat3::from_quat(DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll));
        let i = &mut link.inertial.inertia;
        let own = DMat3::from_cols_array_2d(&[
            [i.ixx, i.ixy, i.ixz],
            [i.ixy, i.iyy, i.iyz],
            [i.ixz, i.iyz, i.izz],
        ]);
        let aligned = link_from_inertial * own * link_from_inertial.transpose();
        let [x, y, z] = aligned.to_cols_array_2d();
        (i.ixx, i.ixy, i.ixz) = (x[0], x[1], x[2]);
        (i.iyy, i.iyz, i.izz) = (y[1], y[2], z[2]);
    }
}

/// A mass without inertia would turn like nothing, or not at all: it gets that of a solid box around its link.
pub(super) fn fill_inertia(urdf: &mut urdf_rs::Robot, meshes: &[Mesh], warnings: &mut Vec<String>) {
    for (link, mesh) in urdf.links.iter_mut().zip(meshes) {
        let (mass, inertia) = (link.inertial.mass.value, &mut link.inertial.inertia);
        let is_zero = [inertia.ixx, inertia.iyy, inertia.izz] == [0.0; 3];
        if mass > 0.0 && is_zero && !mesh.faces.is_empty() {
            warnings.push(format!(
                "link {}: its mass has no inertia: that of a box around it is used",
                link.name
            ));
            let [x, y, z] = mesh.bounds().extents().to_array().map(f64::from);
            let moment = |a: f64, b: f64| mass / 12.0 * (a * a + b * b);
            inertia.ixx = moment(y, z);
            inertia.iyy = moment(x, z);
            inertia.izz = moment(x, y);
        }
    }
}
