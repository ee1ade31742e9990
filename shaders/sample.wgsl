// Stage `aim`, first half: normals of an even selection of the near points of each side.

@group(0) @binding(1) var<storage, read> pairs: array<Pair>;
@group(0) @binding(5) var<storage, read> normals: array<f32>;
@group(0) @binding(6) var<storage, read_write> survivors: array<Survivor>;
@group(0) @binding(8) var<storage, read_write> work: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(10) var<storage, read_write> samples: array<Sample>;

@compute @workgroup_size(256)
fn sample(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(group) * GROUP + lane;
    if i >= min(atomicLoad(&work[SURVIVORS]), batch.survivors) || survivors[i].is_near == 0u {
        return;
    }
    let side = survivors[i].side;
    let facts = &pairs[side / 2u].sides[side % 2u];
    let state = batch.sides_at + side * SIDE_WORDS;
    let near_count = atomicLoad(&work[state + NEAR_COUNT]);
    let step = max((near_count + AIM_SAMPLES - 1u) / AIM_SAMPLES, 1u);
    if hash(survivors[i].index) % step != 0u {
        return;
    }
    var normal = vec3f();
    if ((*facts).flags & HAS_NORMALS) != 0u {
        normal = given_normal(side, survivors[i].index);
    } else {
        let plane = bare_plane(side, survivors[i].position, true);
        if plane.stands_out > 0u {
            return;
        }
        normal = plane.normal;
    }
    let slot = atomicAdd(&work[state + SAMPLE_COUNT], 1u);
    if slot < SAMPLE_SLOTS {
        samples[side * SAMPLE_SLOTS + slot] = Sample(normal, 0u, survivors[i].position, 0u);
    }
}
