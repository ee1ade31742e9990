//! A generated quadruped with twelve joints, and how it stands and walks.

use super::kinematics::Kinematics;
use std::f32::consts::{PI, TAU};

/// Lengths in metres: of thigh and shin, and radius of the feet, which are spheres.
const LIMB: f32 = 0.3;
const FOOT_RADIUS: f32 = 0.035;
/// Height of the hips over the middle of the feet when it stands: knees bent by 37° to each side.
const HIP_HEIGHT: f32 = 0.48;
/// Where the hips are, and how far beside them the legs hang, metres.
const HIP: [f32; 2] = [0.26, 0.1];
const LEG_OFFSET: f32 = 0.08;

/// Legs in the order of their joints: name, sign of x, sign of y, and when in a cycle the quarter begins in which the
/// leg swings: one leg after the other, each hind leg before the front leg of its side.
const LEGS: [(&str, f32, f32, f32); 4] = [
    ("front_left", 1.0, 1.0, 0.25),
    ("front_right", 1.0, -1.0, 0.75),
    ("rear_left", -1.0, 1.0, 0.0),
    ("rear_right", -1.0, -1.0, 0.5),
];

/// The URDF of a quadruped of 50 kg: z up, x ahead, twelve joints (hip roll, hip pitch and knee of each
/// leg), feet of spheres. With all joints at 0 it stands.
pub fn quadruped() -> String {
    let (thigh, _) = leg_angles(0.0, -HIP_HEIGHT);
    let link = |name: &str, mass: f32, inertia: [f32; 3], center: f32, geometry: &str| {
        let [xx, yy, zz] = inertia;
        format!(
            r#"<link name="{name}"><inertial><mass value="{mass}"/><origin xyz="0 0 {center}"/>
<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 {center}"/><geometry>{geometry}</geometry></collision></link>
"#
        )
    };
    let joint = |[name, parent, child]: [&str; 3], at: [f32; 3], pitch: f32, axis: &str, range| {
        let [x, y, z] = at;
        format!(
            r#"<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{x} {y} {z}" rpy="0 {pitch} 0"/><axis xyz="{axis}"/>
<limit lower="-{range}" upper="{range}" effort="120" velocity="12"/></joint>
"#
        )
    };
    let mut parts = link(
        "trunk",
        28.0,
        [0.25, 1.0, 1.15],
        0.0,
        r#"<box size="0.66 0.22 0.14"/>"#,
    );
    for (leg, ahead, aside, _) in LEGS {
        let name = |part: &str| format!("{leg}_{part}");
        let [hip, upper, lower, foot] = ["hip", "thigh", "shin", "foot"].map(name);
        let rod = format!(r#"<capsule radius="0.028" length="{}"/>"#, LIMB - 0.08);
        parts += &link(&hip, 1.8, [0.003; 3], 0.0, r#"<sphere radius="0.05"/>"#);
        parts += &link(&upper, 2.4, [0.02, 0.02, 0.002], -0.5 * LIMB, &rod);
        parts += &link(&lower, 1.0, [0.008, 0.008, 0.001], -0.5 * LIMB, &rod);
        let sphere = format!(r#"<sphere radius="{FOOT_RADIUS}"/>"#);
        parts += &link(&foot, 0.3, [0.0002; 3], 0.0, &sphere);
        let at = [ahead * HIP[0], aside * HIP[1], 0.0];
        let joints = ["roll", "pitch", "knee", "ankle"].map(name);
        let [roll, pitch, knee, ankle] = &joints;
        parts += &joint([roll, "trunk", &hip], at, 0.0, "1 0 0", 0.7);
        let beside = [0.0, aside * LEG_OFFSET, 0.0];
        parts += &joint([pitch, &hip, &upper], beside, ahead * thigh, "0 1 0", 1.2);
        let below = [0.0, 0.0, -LIMB];
        parts += &joint(
            [knee, &upper, &lower],
            below,
            -2.0 * ahead * thigh,
            "0 1 0",
            1.3,
        );
        parts += &format!(
            r#"<joint name="{ankle}" type="fixed"><parent link="{lower}"/><child link="{foot}"/><origin xyz="0 0 -{LIMB}"/></joint>
"#
        );
    }
    format!("<robot name=\"quadruped\">\n{parts}</robot>\n")
}

/// Angles of hip pitch and knee, radians, that bring the foot to `x`, `z` (metres, seen from the hip),
/// the knee behind. Hind legs are mirrored: if all knees bent to one side, every leg would push the robot that way as its
/// load came, and slide as it went.
fn leg_angles(x: f32, z: f32) -> (f32, f32) {
    let square = (x * x + z * z).min((1.99 * LIMB).powi(2));
    let knee = -(square / (2.0 * LIMB * LIMB) - 1.0).clamp(-1.0, 1.0).acos();
    ((-x).atan2(-z) - 0.5 * knee, knee)
}

/// A walk without any look at the ground: the robot stands, walks ahead, and stands again. Three feet are down at
/// least, and the trunk leans over them before the fourth is lifted. In a trot, a diagonal carries twice the share of
/// each foot, and the robot falls about it onto the next: its feet were pushed with three to four shares.
#[derive(Clone, Debug)]
pub struct Walk {
    /// Indices of roll, pitch and knee of each leg.
    joints: [[usize; 3]; 4],
    /// Number of joints of the URDF.
    count: usize,
}

/// Seconds for which it stands, then walks, then stands again.
const STAND: f32 = 1.0;
const WALK: f32 = 6.0;
const STAND_AGAIN: f32 = 1.0;
/// Seconds of a cycle, and share of it in which a foot swings: all four are down between two swings. In a shorter cycle,
/// feet land faster: at 1.4 s they are pushed a tenth more.
const CYCLE: f32 = 1.6;
const SWING: f32 = 0.2;
/// Way of a foot on the ground in a cycle, and how high it is lifted, metres: more than twice the
/// highest step, since the robot sinks and tips meanwhile.
const STRIDE: f32 = 0.16;
const LIFT: f32 = 0.05;
/// How far the trunk goes to each side, away from the legs of a side while these swing, and ahead and back, away from the
/// foot that swings, metres. Accelerating, it leans farther than it goes: by half more, and by twice more.
const SWAY: f32 = 0.04;
const NOD: f32 = 0.01;
/// Seconds in which the walk begins and ends.
const EASE: f32 = 0.6;

impl Walk {
    /// Finds the joints of [`quadruped`] by their names; `None` if this is another robot.
    pub fn of(kinematics: &Kinematics) -> Option<Self> {
        let named = |name: String| kinematics.joints.iter().position(|j| j.name == name);
        let mut joints = [[0; 3]; 4];
        for (own, (leg, ..)) in joints.iter_mut().zip(LEGS) {
            for (joint, part) in own.iter_mut().zip(["roll", "pitch", "knee"]) {
                *joint = named(format!("{leg}_{part}"))?;
            }
        }
        Some(Self {
            joints,
            count: kinematics.joints.len(),
        })
    }

    /// Seconds until it has stood again for a second.
    pub fn seconds(&self) -> f32 {
        STAND + WALK + STAND_AGAIN
    }

    /// Where the joints should be at a time.
    pub(super) fn positions(&self, time: f32) -> Vec<f32> {
        let walked = (time - STAND).clamp(0.0, WALK);
        let strength = (walked / EASE).min((WALK - walked) / EASE).clamp(0.0, 1.0);
        let (thigh, bend) = leg_angles(0.0, -HIP_HEIGHT);
        let cycles = walked / CYCLE;
        let nod = NOD * (2.0 * TAU * cycles - 0.5 * PI).cos();
        let sway = -SWAY * (TAU * cycles).sin();
        let mut positions = vec![0.0; self.count];
        for ([roll, pitch, knee], (_, side, aside, offset)) in self.joints.iter().zip(LEGS) {
            let (ahead, lift) = foot((cycles - offset).rem_euclid(1.0));
            let x = strength * (ahead - nod);
            let y = aside * LEG_OFFSET - strength * sway;
            let z = strength * lift - HIP_HEIGHT;
            // The leg moves in a plane that hangs beside the hip, and rolls with it.
            let down = (y * y + z * z - LEG_OFFSET * LEG_OFFSET).sqrt();
            let (to_pitch, to_knee) = leg_angles(side * x, -down);
            positions[*roll] = z.atan2(y) - (-down).atan2(aside * LEG_OFFSET);
            positions[*pitch] = side * (to_pitch - thigh);
            positions[*knee] = side * (to_knee - bend);
        }
        positions
    }
}

/// Where in a cycle a foot is that swings in the first quarter: ahead of its hip and over the ground, metres.
fn foot(phase: f32) -> (f32, f32) {
    let lifts = 0.5 * (0.25 - SWING);
    let down = (phase - lifts - SWING).rem_euclid(1.0) / (1.0 - SWING);
    if down < 1.0 {
        return (STRIDE * (0.5 - down), 0.0);
    }
    let t = (phase - lifts) / SWING;
    // Ahead as fast as it comes, then even: cycloid-like, so that it lands without sliding.
    let x = STRIDE * (t - (TAU * t).sin() / TAU - 0.5);
    (x, LIFT * 0.5 * (1.0 - (TAU * t).cos()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Description, MeshFolders};
    use std::path::Path;
    use tldi::glamx::{Vec2, Vec3};

    fn robot() -> Description {
        Description::from_text(&quadruped(), &MeshFolders::new(Path::new(""), &[])).unwrap()
    }

    #[test]
    fn it_has_twelve_joints_and_weighs_fifty_kilograms() {
        let robot = robot();
        let driven = (robot.kinematics.joints.iter()).filter(|joint| joint.kind.is_driven());
        assert_eq!(driven.count(), 12);
        let mass: f64 = (robot.urdf.links.iter())
            .map(|link| link.inertial.mass.value)
            .sum();
        assert!((mass - 50.0).abs() < 0.5, "{mass}");
        assert!(robot.warnings.is_empty(), "{:?}", robot.warnings);
    }

    /// By the kinematics of the URDF: feet that are down move back evenly at the height of the stand, as the trunk
    /// goes; at most one foot is over it, and then the trunk's middle lies within the other three.
    #[test]
    fn three_feet_are_down_and_the_trunk_is_over_them() {
        let robot = robot();
        let kinematics = &robot.kinematics;
        let walk = Walk::of(kinematics).unwrap();
        let feet: Vec<usize> = (robot.urdf.links.iter().enumerate())
            .filter(|(_, link)| link.name.ends_with("foot"))
            .map(|(k, _)| k)
            .collect();
        let places = |time: f32| -> Vec<Vec3> {
            let poses = kinematics.poses(&walk.positions(time));
            feet.iter().map(|foot| poses[*foot].translation).collect()
        };
        let is_up = |p: &Vec3| p.z > -HIP_HEIGHT + 1e-4;
        let [mut swings, mut compared] = [0, 0];
        for k in 0..400 {
            let time = STAND + EASE + 0.02 + 0.01 * k as f32;
            let (now, soon) = (places(time), places(time + 0.002));
            assert!(now.iter().all(|p| p.z > -HIP_HEIGHT - 1e-4), "{now:?}");
            // Feet that are down move as one, and never ahead by more than the trunk nods.
            let down = |p: &[Vec3]| (0..4).filter(|i| !is_up(&p[*i])).collect::<Vec<_>>();
            // Twelve milliseconds before it lands and after it lifts, a foot is clearly over the ground.
            let around = [places(time - 0.012), soon.clone(), places(time + 0.014)];
            if around.iter().all(|places| down(places) == down(&now)) {
                let ways: Vec<Vec3> = down(&now).iter().map(|i| soon[*i] - now[*i]).collect();
                for way in &ways {
                    assert!(way.distance(ways[0]) < 2e-5, "{time}: {ways:?}");
                    let speed = STRIDE / ((1.0 - SWING) * CYCLE);
                    let nodding = NOD * 2.0 * TAU / CYCLE;
                    assert!((way.x / -0.002 - speed).abs() < nodding + 0.01, "{ways:?}");
                }
                compared += 1;
            }
            let up: Vec<usize> = (0..4).filter(|i| is_up(&now[*i])).collect();
            assert!(up.len() < 2, "{now:?}");
            let Some(up) = up.first() else { continue };
            swings += 1;
            // The others, around the triangle: the middle is on the same side of each edge as the third.
            let others: Vec<Vec3> = (0..4).filter(|i| i != up).map(|i| now[i]).collect();
            for i in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|j| others[(i + j) % 3].truncate());
                let side = |p: Vec2| (b - a).perp_dot(p - a);
                let inside = side(Vec2::ZERO) * side(c).signum() / a.distance(b);
                // A foot that has just left the ground, or is about to touch it, may still be needed. Where it is
                // highest, the trunk must not tip where a slab of 2 cm under a foot tilts it by 3°.
                let lift = now[*up].z + HIP_HEIGHT;
                let least = match lift > 0.9 * LIFT {
                    true => 3.0_f32.to_radians() * HIP_HEIGHT,
                    false => 0.0,
                };
                if lift > 0.2 * LIFT {
                    assert!(
                        inside > least,
                        "{time}: {inside} of {least}, {up} {others:?}"
                    );
                }
            }
        }
        assert!(swings > 250 && compared > 250, "{swings} {compared}");
    }
}
