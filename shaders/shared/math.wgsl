// Order-preserving numbers, rigid motions, hashes.

// A number whose order as an unsigned integer is that of `x`. Zero is below all of them.
fn ordered(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return select(bits | 0x80000000u, ~bits, bits >= 0x80000000u);
}

fn unordered(key: u32) -> f32 {
    return bitcast<f32>(select(~key, key & 0x7fffffffu, key >= 0x80000000u));
}

// The integer part of `value` within 0 to `most`; 0 for what is not a number.
fn truncated(value: f32, most: f32) -> u32 {
    let positive = select(0.0, value, value > 0.0);
    return u32(select(most, positive, positive < most));
}

// The cell, of a grid with its first corner at `low`, that holds a place; beside the grid, the nearest one.
fn grid_cell(place: vec3f, low: vec3f, inv_cell: f32, dims: vec3u) -> vec3u {
    let at = (place - low) * inv_cell;
    return vec3u(
        truncated(at.x, f32(dims.x - 1u)),
        truncated(at.y, f32(dims.y - 1u)),
        truncated(at.z, f32(dims.z - 1u)),
    );
}

fn moved(x: vec4f, y: vec4f, z: vec4f, p: vec3f) -> vec3f {
    return vec3f(
        x.x * p.x + x.y * p.y + x.z * p.z + x.w,
        y.x * p.x + y.y * p.y + y.z * p.z + y.w,
        z.x * p.x + z.y * p.y + z.z * p.z + z.w,
    );
}

fn turned(x: vec4f, y: vec4f, z: vec4f, v: vec3f) -> vec3f {
    return vec3f(dot(x.xyz, v), dot(y.xyz, v), dot(z.xyz, v));
}

fn is_within(p: vec3f, low: vec3f, high: vec3f) -> bool {
    return all(p >= low) && all(p <= high);
}

// See `tldi::plan::is_aim_sample`.
fn hash(index: u32) -> u32 {
    var h = (index ^ (index >> 16u)) * 0x7feb352du;
    h = (h ^ (h >> 15u)) * 0x846ca68bu;
    return h ^ (h >> 16u);
}

fn group_index(group: vec3u) -> u32 {
    return group.y * MAX_GROUPS + group.x;
}

// `v` as a unit vector, or `other` where it is none.
fn unit_or(v: vec3f, other: vec3f) -> vec3f {
    let length_squared = dot(v, v);
    if length_squared > 0.0 && length_squared < INFINITE {
        return v * inverseSqrt(length_squared);
    }
    return other;
}

// Sizes in `groups` of an indirect dispatch of so many workgroups.
fn split_groups(count: u32) -> vec3u {
    return vec3u(min(count, MAX_GROUPS), (count + MAX_GROUPS - 1u) / MAX_GROUPS, 1u);
}

fn splat_radius(radius: f32, pixel_size: f32) -> f32 {
    return max(radius, LEAST_RADIUS_PX * pixel_size);
}

fn is_edge_on(normal: vec3f) -> bool {
    return abs(normal.z) < EDGE_ON;
}

fn is_steep(normal: vec3f) -> bool {
    return abs(normal.z) < STEEP;
}

// Length of a motion, metres, if it is along the axis; else 0.
fn moved_along(motion: vec3f, axis: vec3f) -> f32 {
    return select(0.0, length(motion), dot(motion, axis) > 0.0);
}
