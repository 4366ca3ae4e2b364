//! A model moved to another mesh that lies on its surface (Wang ch. 3; METHOD-BODY section 8).
//!
//! Row i of W holds the barycentric coordinates of vertex i's closest point on the model's template. Template' = the mesh's vertices; shapes' = W
//! shapes, correctives' = W correctives, weights' = W weights, whose rows still sum to 1. Joints keep their places: they are regressed anew from the mesh
//! (`joint_regressor`). Where the closest face looks the other way, as under arms and between fingers, the nearest that
//! agrees is taken instead. V vertices of the model, N of the mesh; metres.

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result};
use xavatar_mesh::{SurfaceIndex, TriangleMesh};

use super::joint_regressor::{JointFit, Motion};
use super::{BodyModel, Coefficients, PartLabelSource, PartLabels};

/// A face that agrees is looked for so far from a vertex, metres.
const REACH: f64 = 0.02;
/// Meshes that are further from the model than this on average are not aligned to it, metres.
const ALIGNED: f64 = 0.05;
/// Vertices that follow a joint less than this do not place it.
const FOLLOWS: f64 = 0.05;

/// Where points are on a mesh: the rows of W.
#[derive(Clone, Debug)]
pub struct SurfaceMap {
    /// The face of each point (N).
    pub faces: Vec<u32>,
    /// The corners of that face, and the point's coordinates of them (N).
    pub corners: Vec<([usize; 3], [f64; 3])>,
}

/// A model on another mesh.
#[derive(Clone, Debug)]
pub struct Moved {
    /// The arrays of its file.
    pub arrays: ArrayMap,
    /// W.
    pub map: SurfaceMap,
    /// How far the mesh is from the model's template: on average and at most, metres.
    pub gap: [f64; 2],
    /// How far a regressed joint is from the model's at most, metres.
    pub joint_error: f64,
    /// Vertices whose closest face looked the other way.
    pub turned_away: usize,
}

impl SurfaceMap {
    /// The closest points on a mesh. With `normals` of the points, on faces that look their way, as far as there are any near.
    ///
    /// # Errors
    /// Those of [`SurfaceIndex::new`].
    pub fn new(points: &[DVec3], vertices: &[DVec3], faces: &[[u32; 3]], normals: Option<&[DVec3]>) -> Result<Self> {
        let single = |point: &DVec3| point.as_vec3();
        let mesh = TriangleMesh {
            vertices: vertices.iter().map(single).collect(),
            faces: faces.to_vec(),
            ..TriangleMesh::default()
        };
        let index = SurfaceIndex::new(&mesh)?;
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); vertices.len()];
        for (number, face) in (0..).zip(faces) {
            face.iter().for_each(|corner| around[*corner as usize].push(number));
        }
        let corners = |face: u32| faces[face as usize].map(|corner| vertices[corner as usize]);
        let on_face = |point: DVec3, face: u32| {
            let (coordinates, distance) = closest_on_triangle(point, corners(face));
            (distance, face, coordinates)
        };
        let nearest = |one: &(f64, u32, [f64; 3]), other: &(f64, u32, [f64; 3])| {
            one.0.total_cmp(&other.0).then(one.1.cmp(&other.1))
        };
        let place = |(number, point): (usize, &DVec3)| {
            // The index is in single precision: among neighbours, double precision decides.
            let found = index.closest(point.as_vec3()).face;
            let neighbours = faces[found as usize].iter().flat_map(|corner| &around[*corner as usize]).copied();
            let best =
                neighbours.map(|face| on_face(*point, face)).min_by(nearest).unwrap_or_else(|| on_face(*point, found));
            let looks_away = |face: u32| {
                let [a, b, c] = corners(face);
                normals.is_some_and(|normals| normals[number].dot((b - a).cross(c - a)) < 0.0)
            };
            let best = match looks_away(best.1) {
                true => {
                    let all =
                        (0..faces.len() as u32).filter(|face| !looks_away(*face)).map(|face| on_face(*point, face));
                    all.filter(|found| found.0 < REACH).min_by(nearest).unwrap_or(best)
                }
                false => best,
            };
            (best.1, (faces[best.1 as usize].map(|corner| corner as usize), best.2))
        };
        let (faces, corners) = points.par_iter().enumerate().map(place).unzip();
        Ok(Self { faces, corners })
    }

    /// W times rows of `width` numbers, one a vertex: (N) rows.
    pub fn apply<T: Copy + Sync + Into<f64>>(&self, values: &[T], width: usize) -> Vec<f64> {
        let row = |(corners, coordinates): &([usize; 3], [f64; 3])| {
            let (corners, coordinates) = (*corners, *coordinates);
            (0..width).map(move |at| {
                (0..3).map(|corner| coordinates[corner] * values[corners[corner] * width + at].into()).sum::<f64>()
            })
        };
        self.corners.par_iter().flat_map_iter(row).collect()
    }

    /// W times points or offsets, one a vertex (N).
    pub fn points(&self, values: &[DVec3]) -> Vec<DVec3> {
        let row = |(corners, coordinates): &([usize; 3], [f64; 3])| {
            (0..3).map(|corner| values[corners[corner]] * coordinates[corner]).sum()
        };
        self.corners.par_iter().map(row).collect()
    }

    /// The vertex nearest to each point, by its coordinates (N).
    fn nearest_vertices(&self) -> impl Iterator<Item = usize> {
        self.corners.iter().map(|(corners, coordinates)| {
            let largest = (0..3).max_by(|one, other| coordinates[*one].total_cmp(&coordinates[*other]));
            corners[largest.unwrap_or_default()]
        })
    }

    /// The labels of the points, of those of the mesh's vertices.
    pub fn labels(&self, labels: &PartLabels) -> PartLabels {
        let (parts, detail) =
            self.nearest_vertices().map(|vertex| (labels.parts[vertex], labels.detail[vertex])).unzip();
        PartLabels { parts, detail, source: PartLabelSource::SkinningWeights }
    }
}

/// The model of a file, whose arrays these are, on a mesh that was aligned to its template.
///
/// # Errors
/// [`Error::Unfit`] for a mesh that is not where the template is; those of [`BodyModel::from_arrays`] for the arrays.
pub fn moved(path: &Path, arrays: &ArrayMap, mesh: &TriangleMesh) -> Result<Moved> {
    mesh.check()?;
    let body = BodyModel::from_arrays_with(path, arrays, Coefficients::All)?;
    let template: Vec<DVec3> = body.template().iter().map(|vertex| vertex.as_dvec3()).collect();
    let points: Vec<DVec3> = mesh.vertices.iter().map(|vertex| vertex.as_dvec3()).collect();
    let normals: Vec<DVec3> = mesh.vertex_normals().iter().map(|normal| normal.as_dvec3()).collect();
    let plain = SurfaceMap::new(&points, &template, body.faces(), None)?;
    let map = SurfaceMap::new(&points, &template, body.faces(), Some(&normals))?;
    let turned_away = plain.faces.iter().zip(&map.faces).filter(|(plain, agreed)| plain != agreed).count();
    let flat: Vec<f64> = template.iter().flat_map(|vertex| vertex.to_array()).collect();
    let on_surface = map.apply(&flat, 3);
    let gaps = points.iter().zip(on_surface.as_chunks::<3>().0).map(|(point, found)| point.distance((*found).into()));
    let (sum, most) = gaps.fold((0.0, 0.0_f64), |(sum, most), gap| (sum + gap, most.max(gap)));
    let gap = [sum / points.len().max(1) as f64, most];
    if gap[0].is_nan() || gap[0] > ALIGNED {
        return Err(Error::Unfit {
            message: format!("the mesh is {:.0} mm from the model's template on average", gap[0] * 1e3),
            remedy: "align it first: in metres, in the template's pose, on its surface".into(),
        });
    }
    let joints = body.skeleton().joints.len();
    let weights = map.apply(body.skinning_weights(), joints);
    let mut moved = arrays.clone();
    let single = |values: Vec<f64>| ArrayData::F32(values.into_iter().map(|value| value as f32).collect());
    let mut set = |key: &str, shape: Vec<usize>, data| moved.insert(key.to_owned(), Array { shape, data });
    set(
        "v_template",
        vec![points.len(), 3],
        ArrayData::F64(points.iter().flat_map(|point| point.to_array()).collect()),
    );
    let corners = mesh.faces.iter().flatten().map(|corner| i64::from(*corner)).collect();
    set("f", vec![mesh.faces.len(), 3], ArrayData::I64(corners));
    for key in ["shapedirs", "posedirs"] {
        let Some(values) = arrays.get(key).and_then(Array::to_f32) else { continue };
        let width = values.len() / template.len();
        set(key, vec![points.len(), 3, width / 3], single(map.apply(&values, width)));
    }
    let (regressor, joint_error) = regressor(&body, &map, &points, &weights);
    let is_affine = arrays.get("J_regressor").is_some_and(|array| array.shape.first() == Some(&(3 * joints)));
    let (shape, values) =
        if is_affine { affine(&regressor, points.len()) } else { (vec![joints, points.len()], regressor.concat()) };
    set("J_regressor", shape, ArrayData::F64(values));
    set("weights", vec![points.len(), joints], ArrayData::F64(weights));
    // What speaks of the old mesh's vertices or faces.
    for key in ["vt", "ft", "lmk_faces_idx", "lmk_bary_coords", "dynamic_lmk_faces_idx", "dynamic_lmk_bary_coords"] {
        moved.remove(key);
    }
    Ok(Moved { arrays: moved, map, gap, joint_error, turned_away })
}

/// The joint regressor on the mesh (J, N), and how far it is off at most.
fn regressor(body: &BodyModel, map: &SurfaceMap, points: &[DVec3], weights: &[f64]) -> (Vec<Vec<f64>>, f64) {
    /// Directions that are followed: more are no harder for a mean of vertices.
    const FOLLOWED: usize = 20;
    let (skeleton, basis) = (body.skeleton(), &body.anatomy.joints);
    let count = skeleton.joints.len();
    let offsets: Vec<Vec<DVec3>> = body
        .anatomy
        .shapes
        .directions()
        .take(FOLLOWED)
        .map(|direction| match direction.is_empty() {
            true => vec![DVec3::ZERO; points.len()],
            false => map.apply(direction, 3).as_chunks::<3>().0.iter().map(|offset| DVec3::from(*offset)).collect(),
        })
        .collect();
    let fit = |joint: usize| {
        let follows = |vertex: &usize| {
            let row = &weights[vertex * count..(vertex + 1) * count];
            let above = skeleton.parents[joint].map_or(0.0, |parent| row[parent]);
            let below = (0..count).filter(|child| skeleton.parents[*child] == Some(joint)).map(|child| row[child]);
            row[joint] + above + 0.5 * below.sum::<f64>() > FOLLOWS
        };
        let motions = offsets.iter().zip(&basis.directions);
        let motions = motions.map(|(offsets, joints)| Motion { offsets, joint: joints[joint], weight: 1.0 }).collect();
        let candidates = (0..points.len()).filter(follows).collect();
        JointFit { template: points, joint: basis.template[joint], candidates, motions }.row()
    };
    let rows: Vec<Vec<f64>> = (0..count).into_par_iter().map(fit).collect();
    let place = |row: &Vec<f64>| row.iter().zip(points).map(|(weight, point)| *point * *weight).sum::<DVec3>();
    let error = rows.iter().zip(&basis.template).map(|(row, joint)| place(row).distance(*joint)).fold(0.0, f64::max);
    (rows, error)
}

/// SUPR's layout: (3 J, 3 N + 1), without a bias.
fn affine(rows: &[Vec<f64>], points: usize) -> (Vec<usize>, Vec<f64>) {
    let width = 3 * points + 1;
    let mut values = vec![0.0; 3 * rows.len() * width];
    for (joint, row) in rows.iter().enumerate() {
        for axis in 0..3 {
            let start = (3 * joint + axis) * width;
            row.iter().enumerate().for_each(|(point, weight)| values[start + 3 * point + axis] = *weight);
        }
    }
    (vec![3 * rows.len(), width], values)
}

/// The barycentric coordinates of the point of a triangle that is closest, and how far it is (Ericson 2005, 5.1.5).
fn closest_on_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> ([f64; 3], f64) {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    let bp = point - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let coordinates = if d1 <= 0.0 && d2 <= 0.0 {
        [1.0, 0.0, 0.0]
    } else if d3 >= 0.0 && d4 <= d3 {
        [0.0, 1.0, 0.0]
    } else if d6 >= 0.0 && d5 <= d6 {
        [0.0, 0.0, 1.0]
    } else if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let share = d1 / (d1 - d3);
        [1.0 - share, share, 0.0]
    } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let share = d2 / (d2 - d6);
        [1.0 - share, 0.0, share]
    } else if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        [0.0, 1.0 - share, share]
    } else {
        let sum = va + vb + vc;
        // Without an area the corners are all that there is.
        if sum > 0.0 {
            [va / sum, vb / sum, vc / sum]
        } else {
            nearest_corner([a, b, c].map(|corner| corner.distance(point)))
        }
    };
    let found = a * coordinates[0] + b * coordinates[1] + c * coordinates[2];
    (coordinates, found.distance(point))
}

fn nearest_corner(distances: [f64; 3]) -> [f64; 3] {
    let nearest = distances.into_iter().fold(f64::INFINITY, f64::min);
    let first = distances.iter().position(|distance| *distance == nearest);
    std::array::from_fn(|corner| f64::from(u8::from(first == Some(corner))))
}
