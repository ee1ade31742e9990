// Stage `normals`, last part: points whose neighbours are not on a plane adopt the flat planes of those of them that they
// are on, then what their neighbours have adopted. See the CPU's `normals_sharpen`. Sums are integers, so that they do not
// depend on the order in which points were found.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
// After the first pass.
@group(0) @binding(2) var<storage, read_write> adopted: array<Plane>;
@group(0) @binding(6) var<storage, read_write> survivors: array<Survivor>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(17) var<storage, read_write> planes: array<Plane>;

// Steps of a weight: MAX_CANDIDATES = 512 of them stay below 2^31.
const WEIGHT_STEPS: f32 = 1048576.0;

// The plane of survivor `i` after the pass.
fn sharpened(i: u32, is_second: bool) -> Plane {
    var own = planes[i];
    if is_second {
        own = adopted[i];
    }
    let side = survivors[i].side;
    let facts = &pairs[side / 2u].sides[side % 2u];
    let radius = support_radius(side);
    let most = on_plane(side, radius);
    if own.is_needed == 0u || !(own.variance > most) {
        return own;
    }
    let position = survivors[i].position;
    let flat = FLAT_PLANE / SUPPORT * radius;
    let dims = (*facts).cell_dims;
    let low = cell_of(side, position - radius);
    let high = cell_of(side, position + radius);
    let begins = batch.cells_at + (*facts).cell_first;
    let ends = begins + batch.cells;
    let step = selection_step(side, low, high);
    var count = 0u;
    var weights = 0;
    var normals = vec3i();
    // Variances and heights, in the largest ones.
    var offs = vec2i();
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                let cell = (z * dims.y + y) * dims.x + x;
                let end = min(atomicLoad(&work[ends + cell]), arrayLength(&entries));
                for (var k = atomicLoad(&work[begins + cell]); k < end; k++) {
                    let j = entries[k].id & ~NEAR;
                    var plane = planes[j];
                    if is_second {
                        plane = adopted[j];
                    }
                    let off = position - entries[k].position;
                    let height = dot(plane.normal, off) + plane.height;
                    let misfit = plane.variance + height * height;
                    var is_taken = misfit < flat * flat && dot(off, off) <= radius * radius;
                    if step > 1u && is_taken {
                        is_taken = hash(survivors[j].index) % step == 0u;
                    }
                    if is_taken && count < MAX_CANDIDATES {
                        count += 1u;
                        let weight = (1.0 - misfit / (flat * flat)) * WEIGHT_STEPS;
                        let facing = select(weight, -weight, dot(own.normal, plane.normal) < 0.0);
                        weights += i32(round(weight));
                        normals += vec3i(round(facing * plane.normal));
                        offs += vec2i(round(vec2f(
                            weight * (plane.variance / (flat * flat)),
                            facing * (height / flat),
                        )));
                    }
                }
            }
        }
    }
    let normal = vec3f(normals);
    let weight = f32(weights);
    if weight > 0.0 && dot(normal, normal) > 0.0 {
        let off_plane = (own.variance / most - 1.0) / (OFF_PLANE - 1.0);
        let share = clamp(off_plane, 0.0, 1.0) * min(weight / WEIGHT_STEPS, 1.0);
        let mean = vec2f(offs) / weight * vec2f(flat * flat, flat);
        if share >= 1.0 {
            // Nothing of its own is left. It may be INFINITE, beside which some drivers' `mix` loses all else.
            own.normal = normalize(normal);
            own.variance = mean.x;
            own.height = mean.y;
            return own;
        }
        let between = mix(own.normal, normalize(normal), share);
        if dot(between, between) > 0.0 {
            own.normal = normalize(between);
        }
        own.variance = mix(own.variance, mean.x, share);
        own.height = mix(own.height, mean.y, share);
    }
    return own;
}

fn is_complete() -> bool {
    return atomicLoad(&work[TILES]) <= batch.tiles && atomicLoad(&work[SURVIVORS]) <= batch.survivors
        && atomicLoad(&work[ENTRIES]) <= arrayLength(&entries);
}

@compute @workgroup_size(256)
fn normals_sharpen(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(group) * GROUP + lane;
    if is_complete() && k < atomicLoad(&work[ENTRIES]) {
        let i = entries[k].id & ~NEAR;
        adopted[i] = sharpened(i, false);
    }
}

@compute @workgroup_size(256)
fn normals_settle(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(group) * GROUP + lane;
    if is_complete() && k < atomicLoad(&work[ENTRIES]) {
        let i = entries[k].id & ~NEAR;
        planes[i] = sharpened(i, true);
    }
}
