// The given normal of a point, in the frame of the query.
fn given_normal(side: u32, index: u32) -> vec3f {
    let facts = &pairs[side / 2u].sides[side % 2u];
    let at = 3u * ((*facts).first_normal + index);
    return turned(
        (*facts).frame_from_cloud_x,
        (*facts).frame_from_cloud_y,
        (*facts).frame_from_cloud_z,
        vec3f(normals[at], normals[at + 1u], normals[at + 2u]),
    );
}
