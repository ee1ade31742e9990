// Source `unproject`: a depth image becomes points with the radii of its pixels. Runs before the
// stages of a batch.

struct DepthCamera {
    // Columns and rows.
    size: vec2u,
    focal_px: vec2f,
    principal_px: vec2f,
    metres_per_unit: f32,
    near: f32,
    far: f32,
    // Radius of a point in pixels.
    radius_px: f32,
    // Word of the first point.
    first_point: u32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> camera: DepthCamera;
// Two depths in a word, the first in the lower half.
@group(0) @binding(1) var<storage, read> depths: array<u32>;
// x, y, z and radius of each.
@group(0) @binding(2) var<storage, read_write> points: array<f32>;

// What no bounds hold.
const NOWHERE: f32 = 1.0e30;

@compute @workgroup_size(256)
fn unproject(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = (group.y * MAX_GROUPS + group.x) * GROUP + lane;
    if k >= camera.size.x * camera.size.y {
        return;
    }
    let units = (depths[k / 2u] >> (16u * (k % 2u))) & 0xffffu;
    let depth = f32(units) * camera.metres_per_unit;
    var point = vec4f(vec3f(NOWHERE), 0.0);
    if units != 0u && units != 0xffffu && depth >= camera.near && depth <= camera.far {
        let pixel = vec2f(f32(k % camera.size.x), f32(k / camera.size.x));
        let plane = (pixel - camera.principal_px) / camera.focal_px;
        point = vec4f(plane * depth, depth, camera.radius_px * depth / camera.focal_px.x);
    }
    for (var c = 0u; c < 4u; c++) {
        points[camera.first_point + 4u * k + c] = point[c];
    }
}
