//! A body with bent knees, elbows and fingers, which says where a mesh must not lose vertices: a limb that is straight looks like a tube that needs none.

use xavatar_mesh::TriangleMesh;

use super::{Atom, BlsmBody, BlsmParameters};

/// How far, degrees.
const BENT: f64 = 60.0;
/// Of the fingers.
const FINGERS: [&str; 5] = ["thumb", "index", "middle", "ring", "pinky"];

impl BlsmBody {
    /// The mean body with its joints bent.
    pub fn bent(&self) -> TriangleMesh {
        let angle = |atom: &Atom| {
            let name = &self.names[atom.joint];
            // Left elbows and fingers bend forward and down by negative turns, right ones by positive.
            let side = if name.starts_with("left") { -1.0 } else { 1.0 };
            let is_finger = FINGERS.iter().any(|finger| name.contains(finger));
            match atom.axis {
                0 if name.ends_with("knee") => BENT,
                1 if name.ends_with("elbow") => side * BENT,
                2 if is_finger => side * BENT,
                _ => 0.0,
            }
        };
        let atoms = self.atoms.list.iter().map(|atom| atom.coordinate(angle(atom).to_radians())).collect();
        let posed = self.posed(&BlsmParameters { atoms, ..self.rest() });
        let vertices = posed.vertices.iter().map(|vertex| vertex.as_vec3()).collect();
        TriangleMesh { vertices, faces: self.faces.clone(), ..TriangleMesh::default() }
    }
}
