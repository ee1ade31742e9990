//! A generated quadruped with twelve joints, and how it stands and walks.

use super::kinematics::Kinematics;
use std::f32::consts::TAU;

/// Lengths in metres: of thigh and shin, and radius of the feet, which are spheres.
const LIMB: f32 = 0.3;
const FOOT_RADIUS: f32 = 0.035;
/// Height of the hips over the middle of the feet when it stands: knees bent by 37° to each side.
const HIP_HEIGHT: f32 = 0.48;
/// Where the hips are, and how far beside them the legs hang, metres.
const HIP: [f32; 2] = [0.26, 0.1];
const LEG_OFFSET: f32 = 0.08;

/// Legs in the order of their joints: name, sign of x, sign of y, and when in a cycle the leg swings: the
/// legs of a diagonal together.
const LEGS: [(&str, f32, f32, f32); 4] = [
    ("front_left", 1.0, 1.0, 0.0),
    ("front_right", 1.0, -1.0, 0.5),
    ("rear_left", -1.0, 1.0, 0.5),
    ("rear_right", -1.0, -1.0, 0.0),
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

/// A trot, without any look at the ground: it stands, walks ahead, and stands again. Hips do not roll.
#[derive(Clone, Debug)]
pub struct Walk {
    /// Indices of pitch and knee of each leg.
    joints: [[usize; 2]; 4],
    /// Number of joints of the URDF.
    count: usize,
}

/// Seconds for which it stands, then walks, then stands again.
const STAND: f32 = 2.0;
const WALK: f32 = 5.0;
const STAND_AGAIN: f32 = 1.0;
/// Seconds of a cycle: at 0.6 s feet land with five times their share of the weight, at 1 s with three times. Longer, and
/// the robot tips farther over the diagonal that is down.
const CYCLE: f32 = 1.0;
/// Share of a cycle in which a foot is down: more than half, so that one diagonal is down before the other
/// lifts.
const DOWN: f32 = 0.65;
/// Way of a foot on the ground in a cycle, and how high it is lifted, metres: three times the
/// highest step, since the robot sinks and tips meanwhile.
const STRIDE: f32 = 0.1;
const LIFT: f32 = 0.06;
/// Seconds in which the walk begins and ends.
const EASE: f32 = 0.6;

impl Walk {
    /// Finds the joints of [`quadruped`] by their names; `None` if this is another robot.
    pub fn of(kinematics: &Kinematics) -> Option<Self> {
        let named = |name: String| kinematics.joints.iter().position(|j| j.name == name);
        let mut joints = [[0; 2]; 4];
        for (own, (leg, ..)) in joints.iter_mut().zip(LEGS) {
            for (joint, part) in own.iter_mut().zip(["pitch", "knee"]) {
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
        let mut positions = vec![0.0; self.count];
        for ([pitch, knee], (_, side, _, offset)) in self.joints.iter().zip(LEGS) {
            let (x, lift) = foot((walked / CYCLE + offset).rem_euclid(1.0));
            let (to_pitch, to_knee) = leg_angles(side * strength * x, strength * lift - HIP_HEIGHT);
            positions[*pitch] = side * (to_pitch - thigh);
            positions[*knee] = side * (to_knee - bend);
        }
        positions
    }
}

/// Where in a cycle a foot is: ahead of its hip and over the ground, metres.
fn foot(phase: f32) -> (f32, f32) {
    if phase < DOWN {
        return (STRIDE * (0.5 - phase / DOWN), 0.0);
    }
    let t = (phase - DOWN) / (1.0 - DOWN);
    // Ahead as fast as it comes, then even: cycloid-like, so that it lands without sliding.
    let x = STRIDE * (t - (TAU * t).sin() / TAU - 0.5);
    (x, LIFT * 0.5 * (1.0 - (TAU * t).cos()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Description;
    use std::path::Path;
    use tldi::glamx::Vec3;

    fn robot() -> Description {
        Description::from_text(&quadruped(), Path::new("")).unwrap()
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

    /// Feet that are down move back evenly at the height of the stand, by the kinematics of the URDF;
    /// those that swing are over it.
    #[test]
    fn feet_that_are_down_stay_on_the_ground() {
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
        let standing = places(0.0);
        let mut down = 0;
        for k in 0..200 {
            let time = STAND + EASE + 0.02 + 0.01 * k as f32;
            // Twelve milliseconds before it lands and after it lifts, a foot is clearly over the ground.
            let [before, now, soon, after] =
                [-0.012, 0.0, 0.002, 0.014].map(|shift| places(time + shift));
            for foot in 0..feet.len() {
                let now = now[foot];
                assert!((now.x - standing[foot].x).abs() < 0.51 * STRIDE);
                assert!((now.y - standing[foot].y).abs() < 1e-3);
                assert!(now.z > -HIP_HEIGHT - 1e-3, "{now}");
                if [before[foot], now, after[foot]]
                    .iter()
                    .all(|p| p.z < -HIP_HEIGHT + 1e-4)
                {
                    down += 1;
                    let speed = (now.x - soon[foot].x) / 0.002;
                    assert!((speed - STRIDE / (DOWN * CYCLE)).abs() < 0.01, "{speed}");
                }
            }
        }
        assert!(down > 400, "{down}");
    }
}
