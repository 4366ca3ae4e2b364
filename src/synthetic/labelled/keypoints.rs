//! COCO-WholeBody's 133 points as places of a body: its joints, the tips of its fingers, and what stands out of its template.
//!
//! 17 of the body, 6 of the feet, 68 of the face, 21 of either hand. Nose, ears, toes and heels are the vertices of head and feet that are
//! farthest out at rest; the outline of the face is no place of a skeleton.

use glam::Vec3;

use crate::body::BodyModel;
use crate::register::landmarks::{Site, Sites, names_of_layout};
use crate::register::linear::Linkage;

/// COCO-WholeBody's points.
const COUNT: usize = 133;
/// Points that stand out: their number, name, the joint that their vertices follow, and the direction at rest.
const OUTSTANDING: [(usize, &str, &str, Vec3); 9] = [
    (0, "nose", "head", Vec3::Z),
    (3, "left_ear", "head", Vec3::X),
    (4, "right_ear", "head", Vec3::NEG_X),
    (17, "left_big_toe", "left_foot", Vec3::Z),
    (18, "left_small_toe", "left_foot", Vec3::X),
    (19, "left_heel", "left_ankle", Vec3::NEG_Z),
    (20, "right_big_toe", "right_foot", Vec3::Z),
    (21, "right_small_toe", "right_foot", Vec3::NEG_X),
    (22, "right_heel", "right_ankle", Vec3::NEG_Z),
];

/// Where on a body a point is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BodyPlace {
    /// At a joint.
    Joint(usize),
    /// At a vertex.
    Vertex(usize),
}

/// The points (133) that a body has, with their names.
pub(super) fn body_places(body: &BodyModel, joints_of_vertices: &[usize]) -> Vec<Option<(String, BodyPlace)>> {
    let sites = Sites::of(body, &Linkage::of(body));
    let place_of = |name: String| {
        let place = match sites.site(sites.named(&name)?).at {
            Site::Joint(joint) => BodyPlace::Joint(joint),
            Site::Vertex(tip) => BodyPlace::Vertex(sites.tips()[tip]),
        };
        Some((name, place))
    };
    let names = names_of_layout(COUNT).unwrap_or_default();
    let mut places: Vec<Option<(String, BodyPlace)>> = names.into_iter().map(place_of).collect();
    for (number, name, joint, direction) in OUTSTANDING {
        let Some(joint) = body.skeleton().joint(joint) else { continue };
        let following = (0..body.vertex_count()).filter(|vertex| joints_of_vertices[*vertex] == joint);
        let out = |vertex: &usize| body.template()[*vertex].dot(direction);
        let farthest = following.max_by(|a, b| out(a).total_cmp(&out(b)));
        places[number] = farthest.map(|vertex| (name.to_owned(), BodyPlace::Vertex(vertex)));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::BuiltInSubject;

    #[test]
    fn points_are_where_their_names_say() {
        let subject = BuiltInSubject::new().unwrap();
        let body = subject.model();
        let joints = body.skeleton().joints.len();
        let dominant: Vec<usize> = body
            .skinning_weights()
            .chunks_exact(joints)
            .map(|row| (0..joints).max_by(|a, b| row[*a].total_cmp(&row[*b])).unwrap())
            .collect();
        let places = body_places(body, &dominant);
        let rest = body.pose(&body.skeleton().rest_pose()).unwrap();
        let at = |name: &str| {
            let (_, place) = places.iter().flatten().find(|(found, _)| found == name).unwrap();
            match place {
                BodyPlace::Joint(joint) => rest.joints[*joint],
                BodyPlace::Vertex(vertex) => rest.vertices[*vertex],
            }
        };
        assert_eq!(places.len(), 133);
        assert_eq!(places[9], Some(("left_wrist".to_owned(), BodyPlace::Joint(20))));
        assert!(places[23..91].iter().all(Option::is_none), "the face's outline is unknown");
        assert!(at("left_ear").x > at("nose").x && at("nose").x > at("right_ear").x);
        assert!(at("nose").z > at("left_ear").z && at("nose").y > at("left_shoulder").y);
        assert!(at("left_big_toe").z > at("left_heel").z + 0.1 && at("left_small_toe").x > at("left_ankle").x);
        assert!(at("right_small_toe").x < at("right_ankle").x);
        assert!(at("left_index").x > at("left_index3").x, "the tip is beyond the last joint");
    }
}
