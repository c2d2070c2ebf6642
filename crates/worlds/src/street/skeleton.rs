//! The skeleton of people.

/// Joints of the skeleton: name, parent, and position in the bind pose, facing x, arms spread.
pub(super) const JOINTS: [(&str, Option<usize>, [f64; 3]); 17] = [
    ("Hips", None, [0.0, 0.0, 0.95]),
    ("Spine", Some(0), [0.0, 0.0, 1.06]),
    ("Chest", Some(1), [-0.01, 0.0, 1.2]),
    ("Neck", Some(2), [-0.015, 0.0, 1.47]),
    ("Head", Some(3), [0.0, 0.0, 1.57]),
    ("UpperArm_L", Some(2), [-0.01, 0.185, 1.41]),
    ("LowerArm_L", Some(5), [-0.01, 0.371, 1.188]),
    ("Hand_L", Some(6), [-0.01, 0.538, 0.989]),
    ("UpperArm_R", Some(2), [-0.01, -0.185, 1.41]),
    ("LowerArm_R", Some(8), [-0.01, -0.371, 1.188]),
    ("Hand_R", Some(9), [-0.01, -0.538, 0.989]),
    ("UpperLeg_L", Some(0), [0.0, 0.095, 0.92]),
    ("LowerLeg_L", Some(11), [0.0, 0.095, 0.49]),
    ("Foot_L", Some(12), [0.0, 0.095, 0.08]),
    ("UpperLeg_R", Some(0), [0.0, -0.095, 0.92]),
    ("LowerLeg_R", Some(14), [0.0, -0.095, 0.49]),
    ("Foot_R", Some(15), [0.0, -0.095, 0.08]),
];
