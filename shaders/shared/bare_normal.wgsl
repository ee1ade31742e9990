// The normal of a point without one: the direction of least covariance of the points around it.
// Sums are integers, so that they do not depend on the order in which points were found.

// Steps of an offset within the neighbourhood's radius: the squares of MAX_CANDIDATES = 512 of them
// stay below 2^31.
const OFFSET_STEPS: f32 = 2047.0;

// Radius of the neighbourhood, metres.
fn support_radius(side: u32) -> f32 {
    var mean = sides[side].mean_radius;
    if (sides[side].flags & RADII_DIFFER) != 0u {
        let state = batch.sides_at + side * SIDE_WORDS;
        let low = f32(atomicLoad(&work[state + RADIUS_LOW]));
        let high = f32(atomicLoad(&work[state + RADIUS_HIGH]));
        let count = f32(max(atomicLoad(&work[state + KEPT_COUNT]), 1u));
        mean = (high * 65536.0 + low) / RADIUS_STEPS / count * sides[side].max_radius;
    }
    return SUPPORT * mean * sides[side].radius_scale;
}

fn cell_of(side: u32, position: vec3f) -> vec3u {
    let dims = sides[side].cell_dims;
    let at = (position - pairs[side / 2u].overlap_min) * sides[side].cell_inv;
    return vec3u(
        truncated(at.x, f32(dims.x - 1u)),
        truncated(at.y, f32(dims.y - 1u)),
        truncated(at.z, f32(dims.z - 1u)),
    );
}

// In the frame of the query; the sign is arbitrary.
fn bare_normal(side: u32, position: vec3f, near_only: bool) -> vec3f {
    let radius = support_radius(side);
    let dims = sides[side].cell_dims;
    let low = cell_of(side, position - radius);
    let high = cell_of(side, position + radius);
    let begins = batch.cells_at + sides[side].cell_first;
    let ends = begins + batch.cells;
    var total = 0u;
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                let cell = (z * dims.y + y) * dims.x + x;
                total += atomicLoad(&work[ends + cell]) - atomicLoad(&work[begins + cell]);
            }
        }
    }
    // Of a crowd, a selection represents it.
    let step = max((total + MAX_CANDIDATES - 1u) / MAX_CANDIDATES, 1u);
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
    if count == 0 {
        return vec3f(0.0, 0.0, 1.0);
    }
    let s = vec3f(sum);
    let mean = s / f32(count);
    return least_variance(Symmetric(
        vec3f(squares) - s * mean,
        vec3f(products) - vec3f(s.x * mean.y, s.x * mean.z, s.y * mean.z),
    ));
}

// The direction of least variance: powers of the adjugate, as on the CPU; where points lie on a
// line, its eigenvector.
fn least_variance(covariance: Symmetric) -> vec3f {
    let trace = covariance.diagonal.x + covariance.diagonal.y + covariance.diagonal.z;
    if !(trace > 0.0) {
        return vec3f(0.0, 0.0, 1.0);
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
        return eigenvector(covariance, false);
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
        return normalize(vec3f(d.x, r.x, r.y));
    }
    if d.y >= d.z {
        return normalize(vec3f(r.x, d.y, r.z));
    }
    return normalize(vec3f(r.y, r.z, d.z));
}
