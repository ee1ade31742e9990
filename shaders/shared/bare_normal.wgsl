// The plane of a point without a normal: across the direction of least covariance of the points around it.
// Sums are integers, so that they do not depend on the order in which points were found.

// Steps of an offset within the neighbourhood's radius: the squares of MAX_CANDIDATES = 512 of them
// stay below 2^31.
const OFFSET_STEPS: f32 = 2047.0;

// Radius of the neighbourhood, metres.
fn support_radius(side: u32) -> f32 {
    let facts = &pairs[side / 2u].sides[side % 2u];
    var mean = (*facts).mean_radius;
    if ((*facts).flags & RADII_DIFFER) != 0u {
        let state = batch.sides_at + side * SIDE_WORDS;
        let low = f32(atomicLoad(&work[state + RADIUS_LOW]));
        let high = f32(atomicLoad(&work[state + RADIUS_HIGH]));
        let count = f32(max(atomicLoad(&work[state + KEPT_COUNT]), 1u));
        mean = (high * 65536.0 + low) / RADIUS_STEPS / count * (*facts).max_radius;
    }
    return SUPPORT * mean * (*facts).radius_scale;
}

// Variance up to which points within `radius` metres are on a plane, square metres.
fn on_plane(side: u32, radius: f32) -> f32 {
    let deviation = ON_PLANE / SUPPORT * radius;
    let noise = pairs[side / 2u].sides[side % 2u].noise;
    return deviation * deviation + OF_NOISE * noise * noise;
}

fn cell_of(side: u32, position: vec3f) -> vec3u {
    let facts = &pairs[side / 2u].sides[side % 2u];
    return grid_cell(position, pairs[side / 2u].overlap_min, (*facts).cell_inv, (*facts).cell_dims);
}

// Of how many points in these cells one is taken: of a crowd, a selection represents it. Hashes select half of what
// there is room for, give or take 16 points: that some were left out, by their order, takes 16 times as many.
fn selection_step(side: u32, low: vec3u, high: vec3u) -> u32 {
    let facts = &pairs[side / 2u].sides[side % 2u];
    let dims = (*facts).cell_dims;
    let begins = batch.cells_at + (*facts).cell_first;
    var total = 0u;
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                let cell = begins + (z * dims.y + y) * dims.x + x;
                total += atomicLoad(&work[batch.cells + cell]) - atomicLoad(&work[cell]);
            }
        }
    }
    let half = MAX_CANDIDATES / 2u;
    return select((total + half - 1u) / half, 1u, total <= MAX_CANDIDATES);
}

// In the frame of the query; the normal's sign is arbitrary.
fn bare_plane(side: u32, position: vec3f, near_only: bool) -> Plane {
    let facts = &pairs[side / 2u].sides[side % 2u];
    let radius = support_radius(side);
    let dims = (*facts).cell_dims;
    let low = cell_of(side, position - radius);
    let high = cell_of(side, position + radius);
    let begins = batch.cells_at + (*facts).cell_first;
    let ends = begins + batch.cells;
    let step = selection_step(side, low, high);
    var count = 0;
    var sum = vec3i();
    var squares = vec3i();
    // xy, xz, yz
    var products = vec3i();
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                let cell = (z * dims.y + y) * dims.x + x;
                let end = atomicLoad(&work[ends + cell]);
                for (var k = atomicLoad(&work[begins + cell]); k < end; k++) {
                    let other = entries[min(k, arrayLength(&entries) - 1u)];
                    let d = other.position - position;
                    var is_taken = dot(d, d) <= radius * radius && count < i32(MAX_CANDIDATES);
                    is_taken = is_taken && (!near_only || (other.id & NEAR) != 0u);
                    if step > 1u && is_taken {
                        is_taken = hash(survivors[other.id & ~NEAR].index) % step == 0u;
                    }
                    if is_taken {
                        let q = vec3i(round(d * (OFFSET_STEPS / radius)));
                        count += 1;
                        sum += q;
                        squares += q * q;
                        products += vec3i(q.x * q.y, q.x * q.z, q.y * q.z);
                    }
                }
            }
        }
    }
    var plane: Plane;
    plane.normal = vec3f(0.0, 0.0, 1.0);
    plane.variance = INFINITE;
    if count == 0 {
        return plane;
    }
    let s = vec3f(sum);
    let mean = s / f32(count);
    let covariance = Symmetric(
        vec3f(squares) - s * mean,
        vec3f(products) - vec3f(s.x * mean.y, s.x * mean.z, s.y * mean.z),
    );
    let found = least_variance(covariance);
    plane.normal = found.xyz;
    if found.w > 0.0 && count > 3 {
        let n = plane.normal;
        let mixed = vec3f(n.x * n.y, n.x * n.z, n.y * n.z);
        let off = dot(n * n, covariance.diagonal) + 2.0 * dot(mixed, covariance.rest);
        let step = radius / OFFSET_STEPS;
        let all_squares = max(off, 0.0) * step * step;
        plane.variance = all_squares / f32(count - 3);
        plane.height = -dot(n, mean) * step;
        let own_square = plane.height * plane.height;
        if own_square > on_plane(side, radius) && own_square > STANDS_OUT * all_squares {
            plane.stands_out = 1u;
            // No other point adopts it.
            plane.variance = INFINITE;
        }
    }
    return plane;
}

// The direction of least variance: powers of the adjugate, as on the CPU; where points lie on a
// line, its eigenvector. Last whether they do not.
fn least_variance(covariance: Symmetric) -> vec4f {
    let trace = covariance.diagonal.x + covariance.diagonal.y + covariance.diagonal.z;
    if !(trace > 0.0) {
        return vec4f(0.0, 0.0, 1.0, 0.0);
    }
    let xx = covariance.diagonal.x / trace;
    let yy = covariance.diagonal.y / trace;
    let zz = covariance.diagonal.z / trace;
    let xy = covariance.rest.x / trace;
    let xz = covariance.rest.y / trace;
    let yz = covariance.rest.z / trace;
    var d = vec3f(yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy);
    // xy, xz, yz
    var r = vec3f(xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz);
    if d.x + d.y + d.z < LEAST_PLANAR {
        return vec4f(eigenvector(covariance, false), 0.0);
    }
    for (var k = 0u; k < 4u; k++) {
        let inverse = 1.0 / (d.x + d.y + d.z);
        let e = d * inverse;
        let f = r * inverse;
        d = vec3f(
            e.x * e.x + f.x * f.x + f.y * f.y,
            f.x * f.x + e.y * e.y + f.z * f.z,
            f.y * f.y + f.z * f.z + e.z * e.z,
        );
        r = vec3f(
            e.x * f.x + f.x * e.y + f.y * f.z,
            e.x * f.y + f.x * f.z + f.y * e.z,
            f.x * f.y + e.y * f.z + f.z * e.z,
        );
    }
    if d.x >= d.y && d.x >= d.z {
        return vec4f(normalize(vec3f(d.x, r.x, r.y)), 1.0);
    }
    if d.y >= d.z {
        return vec4f(normalize(vec3f(r.x, d.y, r.z)), 1.0);
    }
    return vec4f(normalize(vec3f(r.y, r.z, d.z)), 1.0);
}
