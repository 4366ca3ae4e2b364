//! Atoms of motion: turns of a joint about one axis within limits, theta = (hi - lo) / 2 tanh x + (hi + lo) / 2 (Wang 5.1.2).
//!
//! R_j = R_z R_y R_x of a joint's atoms, an axis without one is not turned about. 47 atoms move SMPL's joints: hips, spine, neck, head and shoulders
//! about three axes, ankles, elbows, collars and wrists about two, knees and toes about one, its hands not. Joints that are none of these, fingers, the
//! jaw and eyes, turn a quarter about each axis. Radians, limits from anatomy.

use glam::{DMat3, DVec3, EulerRot};

/// The smallest and the largest angle about x, y and z, where a joint turns about it.
type Ranges = [Option<(f64, f64)>; 3];

/// Of an axis, by the name of a left or a middle joint, degrees; of a right joint y and z are negated and swapped.
const RANGES: [(&str, Ranges); 12] = [
    ("hip", [Some((-130.0, 45.0)), Some((-60.0, 60.0)), Some((-40.0, 75.0))]),
    ("knee", [Some((0.0, 150.0)), None, None]),
    ("ankle", [Some((-45.0, 55.0)), Some((-35.0, 35.0)), None]),
    ("foot", [Some((-45.0, 60.0)), None, None]),
    ("spine", [Some((-25.0, 45.0)), Some((-30.0, 30.0)), Some((-30.0, 30.0))]),
    ("neck", [Some((-45.0, 45.0)), Some((-60.0, 60.0)), Some((-40.0, 40.0))]),
    ("head", [Some((-45.0, 45.0)), Some((-60.0, 60.0)), Some((-40.0, 40.0))]),
    ("collar", [None, Some((-30.0, 30.0)), Some((-20.0, 45.0))]),
    ("shoulder", [Some((-90.0, 90.0)), Some((-130.0, 60.0)), Some((-110.0, 90.0))]),
    ("elbow", [Some((-90.0, 90.0)), Some((-150.0, 5.0)), None]),
    ("wrist", [None, Some((-40.0, 40.0)), Some((-85.0, 85.0))]),
    ("hand", [None, None, None]),
];
/// Of joints of other names, degrees.
const OTHERS: (f64, f64) = (-90.0, 90.0);
/// Angles are at most this share of the way to a limit: x stays finite.
const NEAREST: f64 = 0.999;

/// A turn of a joint about one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Atom {
    /// Which joint.
    pub joint: usize,
    /// About x, y or z: 0, 1 or 2.
    pub axis: usize,
    /// The smallest angle.
    pub low: f64,
    /// The largest.
    pub high: f64,
}

/// The atoms of a skeleton (A), by joint, then by axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Atoms {
    /// (A).
    pub list: Vec<Atom>,
    /// J.
    pub joints: usize,
}

impl Atom {
    /// theta.
    pub fn angle(&self, x: f64) -> f64 {
        (self.high - self.low) / 2.0 * x.tanh() + (self.high + self.low) / 2.0
    }

    /// d theta / d x.
    pub fn slope(&self, x: f64) -> f64 {
        (self.high - self.low) / 2.0 * (1.0 - x.tanh().powi(2))
    }

    /// The x of an angle; of one beyond the limits, that of the limit.
    pub fn coordinate(&self, angle: f64) -> f64 {
        let share = (2.0 * angle - self.high - self.low) / (self.high - self.low);
        share.clamp(-NEAREST, NEAREST).atanh()
    }

    /// Whether a coordinate is that of a limit.
    pub fn is_at_limit(self, x: f64) -> bool {
        x.tanh().abs() >= NEAREST - 1e-9
    }
}

impl Atoms {
    /// Of joints with these names (J) but the root, which turns freely.
    pub fn of(names: &[String]) -> Self {
        let of_joint = |joint: usize| {
            let ranges = ranges(&names[joint]);
            (0..3).filter_map(move |axis| ranges[axis].map(|(low, high)| Atom { joint, axis, low, high }))
        };
        Self { list: (1..names.len()).flat_map(of_joint).collect(), joints: names.len() }
    }

    /// A.
    pub fn count(&self) -> usize {
        self.list.len()
    }

    /// The angles (A) of coordinates (A).
    pub fn angles(&self, x: &[f64]) -> Vec<f64> {
        self.list.iter().zip(x).map(|(atom, x)| atom.angle(*x)).collect()
    }

    /// The coordinates (A) of angles (A).
    pub fn coordinates(&self, angles: &[f64]) -> Vec<f64> {
        self.list.iter().zip(angles).map(|(atom, angle)| atom.coordinate(*angle)).collect()
    }

    /// The rotations (J) of angles (A).
    pub fn rotations(&self, angles: &[f64]) -> Vec<DMat3> {
        let mut turns = vec![DVec3::ZERO; self.joints];
        self.list.iter().zip(angles).for_each(|(atom, angle)| turns[atom.joint][atom.axis] = *angle);
        turns.iter().map(|turn| DMat3::from_euler(EulerRot::ZYX, turn.z, turn.y, turn.x)).collect()
    }

    /// The axes (A) that atoms turn about, in the coordinates of the joints' parents.
    pub fn axes(&self, angles: &[f64]) -> Vec<DVec3> {
        let mut turns = vec![DVec3::ZERO; self.joints];
        self.list.iter().zip(angles).for_each(|(atom, angle)| turns[atom.joint][atom.axis] = *angle);
        let axis = |atom: &Atom| {
            let turn = turns[atom.joint];
            match atom.axis {
                0 => DMat3::from_rotation_z(turn.z) * DMat3::from_rotation_y(turn.y) * DVec3::X,
                1 => DMat3::from_rotation_z(turn.z) * DVec3::Y,
                _ => DVec3::Z,
            }
        };
        self.list.iter().map(axis).collect()
    }

    /// The coordinates (A) of rotations (J), and the largest angle that the limits cut off, radians.
    pub fn of_rotations(&self, rotations: &[DMat3]) -> (Vec<f64>, f64) {
        let mut cut = 0.0_f64;
        let coordinate = |atom: &Atom| {
            let (z, y, x) = rotations[atom.joint].to_euler(EulerRot::ZYX);
            let angle = [x, y, z][atom.axis];
            cut = cut.max(angle - atom.high).max(atom.low - angle);
            atom.coordinate(angle)
        };
        let coordinates = self.list.iter().map(coordinate).collect();
        (coordinates, cut)
    }
}

/// The limits of a joint's axes, radians.
fn ranges(name: &str) -> Ranges {
    let is_of = |word: &str| name.trim_end_matches(|last: char| last.is_ascii_digit()).ends_with(word);
    let found = RANGES.iter().find(|(word, _)| is_of(word)).map_or([Some(OTHERS); 3], |(_, ranges)| *ranges);
    let mirrored = |axis: usize, (low, high): (f64, f64)| match axis > 0 && name.starts_with("right_") {
        true => (-high, -low),
        false => (low, high),
    };
    [0, 1, 2].map(|axis| {
        let (low, high) = mirrored(axis, found[axis]?);
        Some((low.to_radians(), high.to_radians()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{indices, largest_difference, reference};
    use xavatar_body::smpl;

    #[test]
    fn smpls_joints_have_the_47_atoms_of_the_reference() {
        let golden = reference("blsm_forward");
        let found = Atoms::of(&smpl::skeleton().joints).list;
        assert_eq!(found.iter().map(|atom| atom.joint).collect::<Vec<_>>(), indices(&golden["atom_joint"]));
        assert_eq!(found.iter().map(|atom| atom.axis).collect::<Vec<_>>(), indices(&golden["atom_axis"]));
        for atom in found {
            assert!(atom.low < atom.high && atom.low <= 0.0 && atom.high >= 0.0, "{atom:?}");
        }
    }

    #[test]
    fn angles_are_the_references_and_never_beyond_their_limits() {
        let golden = reference("blsm_forward");
        let atom = |at: usize| Atom {
            joint: golden["atom_joint"][at] as usize,
            axis: golden["atom_axis"][at] as usize,
            low: golden["low"][at],
            high: golden["high"][at],
        };
        let atoms = Atoms { list: (0..47).map(atom).collect(), joints: 24 };
        let angles = atoms.angles(&golden["x"][..47]);
        assert!(largest_difference(&angles, &golden["angles"][..47]) < 1e-14);
        let rotations = atoms.rotations(&angles);
        let (found, cut) = atoms.of_rotations(&rotations);
        assert!(cut < 1e-12 && largest_difference(&found, &golden["x"][..47]) < 1e-9);
        let far = atoms.angles(&[50.0; 47]);
        assert!(far.iter().zip(&atoms.list).all(|(angle, atom)| *angle <= atom.high + 1e-15));
        let (_, cut) = atoms.of_rotations(&vec![DMat3::from_rotation_x(-1.0); 24]);
        assert!(cut > 0.5, "a knee that bends forward is cut off: {cut}");
    }
}
