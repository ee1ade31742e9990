// The frame of a view along an axis.

// `VirtualCamera::along(z, ..)`.
fn view_along(z: vec3f) -> View {
    var view = View();
    // The sign of a negative zero is negative.
    let side = select(1.0, -1.0, bitcast<u32>(z.z) >= 0x80000000u);
    let a = -1.0 / (side + z.z);
    let b = z.x * z.y * a;
    view.view_x = vec4f(1.0 + side * z.x * z.x * a, side * b, -side * z.x, 0.0);
    view.view_y = vec4f(b, side + z.y * z.y * a, -z.y, 0.0);
    view.view_z = vec4f(z, 0.0);
    view.axis = z;
    view.exists = DRAWN;
    return view;
}
